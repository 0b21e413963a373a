"""Logs: their checks and their files."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import LogError
from armdyn.identification import Log
from armdyn.identification.log import Signals
from oracles import robot_named
from simulated_logs import simulated_log

NAMES = ("joint1", "joint2", "joint3")
RRR = robot_named("rrr")
GOOD = simulated_log(RRR, duration=1.0, velocities=True)


def changed(t=GOOD.t, q=GOOD.q, **more):
    return Log(t=t, q=q, v=GOOD.v, tau=GOOD.tau, **more)


def test_bad_shapes_numbers_and_clocks():
    t, q = GOOD.t.copy(), GOOD.q.copy()
    with pytest.raises(LogError, match=r"t has shape \(1000,\) and q \(999, 3\)"):
        changed(q=q[1:])
    q[7, 1] = np.nan
    with pytest.raises(LogError, match="q is not finite in sample 7") as caught:
        changed(q=q)
    assert caught.value.joint == "joint 2"
    t[500:] -= 0.1
    with pytest.raises(LogError, match=r"clock jumps back or stands still: t is 0\.499000 s in sample 499"):
        changed(t=t)
    t[500:] += 0.4
    with pytest.raises(LogError, match=r"a gap of 0.301 s after t = 0.499000 s"):
        changed(t=t)
    with pytest.raises(LogError, match="3 samples"):
        Log(t=[0, 1, 2], q=np.zeros((3, 1)), tau=np.zeros((3, 1)))


def test_columns_go_into_the_order_of_the_robot():
    log = changed(joint_names=("joint3", "joint1", "joint2"))
    np.testing.assert_array_equal(log.in_order(RRR).q, GOOD.q[:, [1, 2, 0]])
    with pytest.raises(LogError, match="has no joint 'joint3'"):
        changed(joint_names=("elbow", "joint1", "joint2")).in_order(RRR)
    with pytest.raises(LogError, match="has 3 joints, the robot 2"):
        GOOD.in_order(robot_named("rr"))


def test_accelerations_have_no_phase():
    t = np.arange(0, 2, 1e-3)
    log = Log(t=t, q=np.sin(5 * t)[:, None], tau=np.zeros((t.size, 1)))
    own = Signals.of(log, smoothing=0.01)
    np.testing.assert_allclose(own.v[:, 0], 5 * np.cos(5 * own.t), atol=0.0013 * 5)
    # A Gaussian of 10 ms makes a sine of 5 rad/s 0.12 % flatter.
    np.testing.assert_allclose(own.a[:, 0], -25 * np.sin(5 * own.t), atol=0.0013 * 25)


def test_tables_arrays_and_runs(tmp_path):
    head = ["t", *(f"{what}{i}" for what in ("q", "v", "tau") for i in (1, 2, 3))]
    head[1] = "q1 [deg]"
    rows = np.column_stack([GOOD.t, np.rad2deg(GOOD.q[:, :1]), GOOD.q[:, 1:], GOOD.v, GOOD.tau])
    table, arrays = tmp_path / "log.csv", tmp_path / "log.npz"
    np.savetxt(table, rows, delimiter=",", header=",".join(head), comments="", fmt="%.17g")
    np.savez(arrays, t=GOOD.t, q=GOOD.q, v=GOOD.v, tau=GOOD.tau)
    for file in (table, arrays):
        log = Log.load(file, RRR)
        np.testing.assert_allclose(log.q, GOOD.q, atol=1e-12)
        np.testing.assert_array_equal(log.tau, GOOD.tau)
    run = ad.Trajectory(t=GOOD.t, q=GOOD.q, v=GOOD.v, tau=GOOD.tau, joint_names=NAMES)
    assert Log.of(run).joint_names == NAMES
    np.savez(arrays, t=GOOD.t, q=GOOD.q)
    with pytest.raises(LogError, match="there are no torques"):
        Log.load(arrays, RRR)
    np.savez(arrays, t=np.array([None]), q=GOOD.q)
    with pytest.raises(LogError):
        Log.load(arrays, RRR)
    with pytest.raises(LogError, match="no such file"):
        Log.load(tmp_path / "none.csv", RRR)


def test_bags(tmp_path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    state, header, time = (
        store.types[name]
        for name in ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    folder, order = tmp_path / "bag", [2, 0, 1]
    with rosbag2.Writer(folder, version=9) as writer:
        connection = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        for i, at in enumerate(GOOD.t):
            stamp = time(sec=int(at), nanosec=round(1e9 * (at - int(at))))
            values = (np.ascontiguousarray(one[i, order]) for one in (GOOD.q, GOOD.v, GOOD.tau))
            message = state(header(stamp, ""), [NAMES[k] for k in order], *values)
            writer.write(connection, int(1e9 * at), store.serialize_cdr(message, state.__msgtype__))
    log = Log.load(folder, RRR)
    np.testing.assert_array_equal(log.tau, GOOD.tau)
    np.testing.assert_allclose(log.t, GOOD.t, atol=1e-9)
    with pytest.raises(LogError, match="no sensor_msgs/JointState has all of shoulder_pan"):
        Log.load(folder, robot_named("ur5"))
    (tmp_path / "x.mcap").write_bytes(b"nothing")
    with pytest.raises(LogError, match="not a readable bag"):
        Log.load(tmp_path / "x.mcap", RRR)


def test_a_run_s_file_is_the_log_of_the_run(tmp_path):
    run = ad.track(RRR, ad.ramp(RRR, [0, 0, 0], [1.0, 0.5, -0.5], 0.3), ad.ComputedTorque())
    own, read = Log.of(run.trajectory), Log.load(run.trajectory.save(tmp_path / "trajectory.npz"), RRR)
    assert np.abs(own.tau - run.trajectory.tau).max() > 1e-3  # they are held from tick to tick
    assert np.array_equal(read.tau, own.tau) and np.array_equal(read.q, own.q) and read.name == "trajectory.npz"
    table = Log.load(run.trajectory.to_csv(tmp_path / "trajectory.csv"), RRR)
    assert np.allclose(table.tau[:-1], own.tau[:-1], atol=1e-12)  # the last torque of a run is never applied
