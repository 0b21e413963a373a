"""A table, ROS 2's message, MuJoCo's XML: read back by those who read them."""

import io
import json
import pickle
import sys
from dataclasses import replace

import numpy as np
import pandas
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from armdyn.errors import MissingPackageError, TrajectoryError
from armdyn.trajectory import Samples
from armdyn.trajectory.formats import FORMATS, CsvTable, Ros2, register
from problems import solved
from trajectory.motions import trajectories

STORE = get_typestore(Stores.ROS2_JAZZY)
"""The message definitions of ROS 2 Jazzy."""
MESSAGE = "trajectory_msgs/msg/JointTrajectory"
WHOLE = {"int32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1)}
ARRAYS = ("q", "v", "a", "tau")
FINITE = st.floats(allow_nan=False, allow_infinity=False)


def expect(value, kind):
    """The value is of the type that the definition says, down to the last number."""
    node, detail = kind
    if node is Nodetype.NAME:
        fields = STORE.fielddefs[detail][1]
        assert list(value) == [name for name, _ in fields]
        for name, inner in fields:
            expect(value[name], inner)
    elif node is Nodetype.SEQUENCE:
        assert type(value) is list
        for each in value:
            expect(each, detail[0])
    elif detail[0] == "float64":
        assert type(value) is float and np.isfinite(value)
    elif detail[0] == "string":
        assert type(value) is str
    else:
        least, most = WHOLE[detail[0]]
        assert type(value) is int and least <= value <= most


def stamps(fields):
    """Nanoseconds."""
    times = [point["time_from_start"] for point in fields["points"]]
    assert all(0 <= time["nanosec"] < 10**9 for time in times)
    return np.array([time["sec"] * 10**9 + time["nanosec"] for time in times])


def message(fields):
    """The message itself, as rosbags makes it of its definition."""
    types = STORE.types

    def made(name, values):
        return types[name](**values)

    time = "builtin_interfaces/msg/Duration"
    points = [
        made(
            "trajectory_msgs/msg/JointTrajectoryPoint",
            {k: np.array(v) if k != "time_from_start" else made(time, v) for k, v in point.items()},
        )
        for point in fields["points"]
    ]
    header = fields["header"]
    stamp = made("builtin_interfaces/msg/Time", header["stamp"])
    head = made("std_msgs/msg/Header", {"stamp": stamp, "frame_id": header["frame_id"]})
    return made(MESSAGE, {"header": head, "joint_names": fields["joint_names"], "points": points})


@pytest.mark.parametrize("rate", [None, 1000, 333.3])
def test_the_message_is_as_ros_defines_it(rate):
    samples = solved("rr").trajectory.resample(rate)
    fields = samples.to_joint_trajectory()
    expect(fields, (Nodetype.NAME, MESSAGE))
    back = STORE.deserialize_cdr(STORE.serialize_cdr(message(fields), MESSAGE), MESSAGE)
    assert back.joint_names == list(samples.joint_names)
    for ours, theirs in zip(ARRAYS, ("positions", "velocities", "accelerations", "effort"), strict=True):
        sent = np.array([getattr(point, theirs) for point in back.points])
        np.testing.assert_array_equal(sent, getattr(samples, ours))
    seconds = [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in back.points]
    np.testing.assert_allclose(seconds, samples.t, rtol=0, atol=0.51e-9)  # half a nanosecond


@pytest.mark.slow
@given(trajectories(), st.one_of(st.none(), st.floats(0.01, 1e5)))
def test_nanoseconds_increase_strictly_from_zero(motion, rate):
    if rate is not None and motion.duration * rate > 3000:
        rate = 3000 / motion.duration  # a message of more points takes longer, and shows no more
    found = stamps(motion.resample(rate).to_joint_trajectory())
    assert found[0] == 0 and np.all(np.diff(found) > 0)
    assert abs(found[-1] - motion.duration * 1e9) <= 0.51


def test_seconds_carry():
    rest = np.zeros((4, 1))
    t = [0.0, 0.9999999999, 1.0000000016, 2.0000000024]  # the nearest whole nanoseconds
    fields = Samples(t, rest, rest, rest, rest, ("a",)).to_joint_trajectory()
    assert stamps(fields).tolist() == [0, 10**9, 10**9 + 2, 2 * 10**9 + 2]
    assert fields["points"][1]["time_from_start"] == {"sec": 1, "nanosec": 0}


def test_motions_that_no_message_can_have():
    rest = np.zeros((2, 1))
    motion = solved("r").trajectory
    with pytest.raises(TrajectoryError, match="joint_names is empty"):
        replace(motion, joint_names=()).to_joint_trajectory()
    with pytest.raises(TrajectoryError, match=r"t.0. and t.1.*same nanosecond"):
        Samples([0.0, 1e-10], rest, rest, rest, rest, ("a",)).to_joint_trajectory()
    with pytest.raises(TrajectoryError, match=r"lasts 3e.09 s; ROS counts to 2147483647 s"):
        Samples([0.0, 3e9], rest, rest, rest, rest, ("a",)).to_joint_trajectory()


@pytest.mark.slow
@given(
    trajectories(), st.lists(FINITE, min_size=3, max_size=3), st.text(max_size=8).filter(lambda name: _sayable(name))
)
def test_the_text_is_json_and_yaml(motion, extreme, name):
    samples = motion.resample(5)
    q = samples.q.copy()
    q[0] = extreme[: q.shape[1]]
    samples = replace(samples, q=q, joint_names=(name, *samples.joint_names[1:]))
    text, fields = Ros2().text(samples), samples.to_joint_trajectory()
    assert json.loads(text) == fields
    assert yaml.safe_load(text) == fields  # which takes 1e-05 for text, and so does ROS


def _sayable(name):
    """Texts that UTF-8 has."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


@pytest.mark.slow
@given(trajectories(), st.floats(0.5, 200), st.text("ab,;\"' µ", max_size=6))
def test_a_table_reads_back_to_the_last_bit(motion, rate, name):
    samples = motion.resample(rate)
    samples = replace(samples, joint_names=(name, *samples.joint_names[1:]))
    table = pandas.read_csv(io.StringIO(CsvTable().text(samples), newline=""))
    written = np.column_stack([samples.t, *(getattr(samples, what) for what in ARRAYS)])
    np.testing.assert_array_equal(table.to_numpy(), written)
    assert len(table.columns) == 1 + 4 * samples.q.shape[1]


def test_the_table_on_disk(tmp_path):
    samples = solved("rr").trajectory.resample(1000)
    path = samples.to_csv(tmp_path / "rr.csv")
    own = np.loadtxt(path, delimiter=",", skiprows=1)
    for k, what in enumerate(ARRAYS):
        np.testing.assert_array_equal(own[:, 1 + 2 * k : 3 + 2 * k], getattr(samples, what))
    head = path.read_text().splitlines()[0]
    assert head.startswith("t [s],q_joint1 [rad or m],q_joint2 [rad or m],v_joint1 [rad/s or m/s],")
    assert head.endswith("a_joint2 [rad/s^2 or m/s^2],tau_joint1 [N m or N],tau_joint2 [N m or N]")
    pandas.testing.assert_frame_equal(samples.to_dataframe(), pandas.read_csv(path))


def test_a_trajectory_says_its_own_samples(tmp_path):
    motion = solved("rr").trajectory
    own = motion.resample()
    assert motion.to_csv(tmp_path / "own.csv").read_text() == CsvTable().text(own)
    pandas.testing.assert_frame_equal(motion.to_dataframe(), own.to_dataframe())
    assert motion.to_joint_trajectory() == own.to_joint_trajectory()


def test_joints_without_names_are_numbered():
    motion = replace(solved("rr").trajectory, joint_names=())
    assert list(motion.to_dataframe().columns[:3]) == ["t [s]", "q_joint1 [rad or m]", "q_joint2 [rad or m]"]


def test_without_pandas_it_has_a_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)  # Python's mark of a module that cannot be imported
    with pytest.raises(
        MissingPackageError, match="to_dataframe needs pandas: pip install pandas; to_csv does"
    ) as caught:
        solved("r").trajectory.to_dataframe()
    assert pickle.loads(pickle.dumps(caught.value)).package == "pandas"


def test_each_format_is_registered_once():
    assert list(FORMATS) == ["csv", "ros2", "mujoco", "urscript", "ur-rtde", "panda-python"]
    assert all(name == kind.name and kind.suffix.startswith(".") and kind.summary for name, kind in FORMATS.items())
    register(CsvTable)  # again: the same

    class Other(CsvTable):
        """Of the same name."""

    with pytest.raises(TrajectoryError, match="there is a format 'csv' already, CsvTable"):
        register(Other)
