"""Motions as planners leave them: columns by their names, arrays by theirs, and one kind of error for all else."""

import io
import json
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armdyn.errors import TrajectoryError
from armdyn.trajectory import Trajectory
from armdyn.trajectory.planned import Planned, read_planned

JOINTS = ("shoulder", "elbow")
T = np.linspace(0, 1, 5)
Q = np.column_stack([np.sin(T), T**2])
V = np.column_stack([np.cos(T), 2 * T])


def table(tmp_path, head, *columns, between=",", name="motion.csv"):
    path = tmp_path / name
    rows = [between.join(map(repr, map(float, row))) for row in np.column_stack(columns)]
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    "head",
    [
        "t,q1,q2,v1,v2", "time,q0,q1,qd0,qd1", "t,q_1,q_2,dq_1,dq_2", "t [s],q[0],q[1],v[0],v[1]",
        "Time,shoulder,elbow,v_shoulder,v_elbow",
        "time_from_start, position_shoulder, position_elbow, velocity_shoulder, velocity_elbow",
        "t,shoulder.pos,elbow.pos,shoulder.vel,elbow.vel", "# t,q1,q2,v1,v2",
        "\ufefft,joint_position_1,joint_position_2,joint_velocity_1,joint_velocity_2",
        "t [s],q_shoulder [rad or m],q_elbow [rad or m],v_shoulder [rad/s or m/s],v_elbow [rad/s or m/s]",
    ],
)  # fmt: skip
def test_heads_of_tables(tmp_path, head):
    planned = read_planned(table(tmp_path, head, T, Q, V), JOINTS)
    assert np.array_equal(planned.t, T) and np.array_equal(planned.q, Q) and np.array_equal(planned.v, V)
    assert planned.a is None and planned.tau is None


def test_named_columns_come_in_any_order_and_others_are_left_out(tmp_path):
    path = table(tmp_path, "q_elbow;why;t;q_shoulder", Q[:, 1], T, T, Q[:, 0], between=";")
    planned = read_planned(path, JOINTS)
    assert np.array_equal(planned.q, Q) and planned.v is None and planned.hold == "linear"


def test_units_are_converted(tmp_path):
    path = table(
        tmp_path, "t,shoulder [deg],elbow (deg),v1 [deg/s],v2 [rad/s]", T, np.rad2deg(Q), np.rad2deg(V[:, 0]), V[:, 1]
    )
    planned = read_planned(path, JOINTS)
    assert planned.q == pytest.approx(Q, rel=1e-14) and planned.v == pytest.approx(V, rel=1e-14)
    planned = read_planned(table(tmp_path, "t [ms],shoulder [mm],elbow [m]", 1e3 * T, 1e3 * Q[:, 0], Q[:, 1]), JOINTS)
    assert planned.t == pytest.approx(T, rel=1e-14) and planned.q == pytest.approx(Q, rel=1e-14)


def test_one_name_may_be_the_end_of_another(tmp_path):
    joints = ("arm", "left_arm")
    planned = read_planned(table(tmp_path, "t,q_left_arm,q_arm", T, Q[:, 1], Q[:, 0]), joints)
    assert np.array_equal(planned.q, Q)


def test_a_table_of_armdyn_is_read_back(tmp_path):
    own = Trajectory(T, Q, V, 3 * V, JOINTS)
    own.to_csv(tmp_path / "own.csv")
    planned = read_planned(tmp_path / "own.csv", JOINTS)
    assert np.array_equal(planned.q, Q) and planned.tau.shape == planned.a.shape == Q.shape
    assert planned.hold == "zero-order"  # means until the next row


@pytest.mark.parametrize(
    "names", [("t", "q", "v"), ("ts_sample", "qs_sample", "qds_sample"), ("times", "positions", "dq")]
)
def test_arrays(tmp_path, names):
    np.savez(tmp_path / "a.npz", **dict(zip(names, (T[:, None], Q, V), strict=True)), other=np.zeros(3))
    planned = read_planned(tmp_path / "a.npz", JOINTS)
    assert np.array_equal(planned.t, T) and np.array_equal(planned.q, Q) and np.array_equal(planned.v, V)
    np.savez(tmp_path / "b.npz", t=T, q=Q[:, 0].astype(np.float32))
    assert read_planned(tmp_path / "b.npz", JOINTS[:1]).q.shape == (5, 1)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "no rows"), ("t,q1,q2", "no rows"), ("0,1,2\n1,2,3\n", "its first line is numbers"),
        ("t,q1,q2\n0,1\n", "line 2: 2 values; the first line names 3"),
        ("t,q1,q2\n0,1,x\n", "line 2: 'x' is not a number"),
        ("t,v1,v2\n0,1,2\n", "there is no q"), ("q1,q2\n0,1\n", "there is no t"),
        ("t,q1\n0,1\n", "1 columns are q, of 2 joints"),
        ("t,q1,q3\n0,1,2\n", "2 columns are q"), ("t,q1,q1\n0,1,2\n", "column 'q1' is there twice"),
        ("t,q1 [turns],q2\n0,1,2\n", "column 'q1 [turns]' has no unit that is known: s, sec, rad"),
        ("t,q1 [%],q2\n0,1,2\n", "column 'q1 [%]' has no unit that is known"),
        ("t [rad/ms],q1,q2\n0,1,2\n", "column 't [rad/ms]' has no unit that is known"),
        ("t,q1,q2\n0,1,\n", "line 2: '' is not a number"), ("a\0b,c\n1,2", "there is no t and no q"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_refused(tmp_path, content, words):
    (tmp_path / "bad.csv").write_text(content)
    with pytest.raises(TrajectoryError, match=r"bad\.csv") as caught:
        read_planned(tmp_path / "bad.csv", JOINTS)
    assert words in str(caught.value)


def test_a_wrong_npz_is_refused(tmp_path):
    path = tmp_path / "bad.npz"
    for make in (
        lambda: path.write_bytes(b"no zip"),
        lambda: np.savez(path, t=T, q=np.array([{}, {}], dtype=object)),
        lambda: np.savez(path, t=T, q=np.array(["a", "b"])),
        lambda: np.savez(path, t=T),
        lambda: np.savez(path, t=T, time=T, q=Q),
    ):
        make()
        with pytest.raises(TrajectoryError, match=r"bad\.npz: "):
            read_planned(path, JOINTS)
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("t.npy", head.getvalue())
    with pytest.raises(TrajectoryError, match=r"bad\.npz: "):  # of a terabyte that it does not have
        read_planned(path, JOINTS)


def test_missing_files_and_devices():
    for path in ("/nowhere/a.csv", "/nowhere/a.npz", "/dev/zero"):
        with pytest.raises(TrajectoryError, match=path):
            read_planned(path, JOINTS)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.text(st.sampled_from("tqv12,;\t\n.\"'[]deg# "), max_size=60))
def test_any_text_is_a_motion_or_one_kind_of_error(tmp_path, text):
    (tmp_path / "any.csv").write_text(text)
    try:
        planned = read_planned(tmp_path / "any.csv", JOINTS)
    except TrajectoryError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert planned.q.shape == (planned.t.size, 2)


def test_accelerations_are_exact_of_parabolas_and_never_beyond_at_a_jump():
    t = np.array([0.0, 0.1, 0.3, 0.4, 0.7, 1.0, 1.1, 1.5])
    a = np.where(t < 0.55, 4.0, -2.0)  # 4 up to 0.55, which is between samples, -2 from then on
    v = np.where(t < 0.55, 4 * t, 2.2 - 2 * (t - 0.55))
    q = np.where(t < 0.55, 2 * t**2, 0.605 + 2.2 * (t - 0.55) - (t - 0.55) ** 2)
    for planned in (Planned(t, q[:, None]), Planned(t, q[:, None], v[:, None])):
        found = planned.accelerations()[:, 0]
        assert found[[0, 1, 2, 5, 6, 7]] == pytest.approx(a[[0, 1, 2, 5, 6, 7]], abs=1e-12)  # rounding
        assert np.all((found >= -2 - 1e-12) & (found <= 4 + 1e-12))


def test_accelerations_need_three_times():
    with pytest.raises(TrajectoryError, match="at least three increasing times"):
        Planned(np.array([0.0, 1.0]), np.zeros((2, 1))).accelerations()
    with pytest.raises(TrajectoryError, match=r"t\[2\]: t = 1 s does not rise above the 1 s of t\[1\]; both rows"):
        Planned(np.array([0.0, 1.0, 1.0]), np.zeros((3, 1))).accelerations()


def twice(tmp_path, kind, later, row):
    """A motion of four rows, whose third has the time `later`, and its second row's values where `row` says so."""
    t, q = np.array([0.0, 1.0, later, 3.0]), np.cumsum(np.ones((4, 2)), axis=0)
    q[2] = q[1] if row else q[2]
    if kind == "npz":
        np.savez(tmp_path / "a.npz", t=t, q=q)
        return tmp_path / "a.npz"
    if kind == "csv":
        return table(tmp_path, "t,q1,q2", t, q)
    stamps = [{"sec": int(one), "nanosec": 0} for one in t]
    points = [{"positions": at.tolist(), "time_from_start": one} for at, one in zip(q, stamps, strict=True)]
    (tmp_path / "a.json").write_text(json.dumps({"joint_names": JOINTS, "points": points}))
    return tmp_path / "a.json"


@pytest.mark.parametrize(
    ("kind", "later", "before"),
    [("csv", "row 3 (line 4)", "row 2 (line 3)"), ("npz", "t[2]", "t[1]"), ("json", "points[2]", "points[1]")],
)
def test_rows_whose_times_do_not_rise_are_named(tmp_path, kind, later, before):
    for time, row, more in ((1.0, True, "one of them may be removed"), (1.0, False, "must increase"), (0.0, True, "")):
        with pytest.raises(TrajectoryError) as caught:
            read_planned(twice(tmp_path, kind, time, row), JOINTS)
        assert f"{later}: t = {time:g} s does not rise above the 1 s of {before}; " in str(caught.value)
        assert str(caught.value).endswith(more) and ("removed" in str(caught.value)) == (row and time == 1)
