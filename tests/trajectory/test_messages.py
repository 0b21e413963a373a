"""ROS 2's JointTrajectory, as it is exported, echoed and wrapped; one kind of error for all else."""

import json

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armdyn.errors import TrajectoryError
from armdyn.parsing import yaml_text
from armdyn.trajectory import Trajectory
from armdyn.trajectory.formats import Ros2
from armdyn.trajectory.planned import read_planned

JOINTS = ("shoulder", "elbow")
T = np.linspace(0, 1, 5)
Q = np.column_stack([np.sin(T), 1e-6 * T**2])
V = np.column_stack([np.cos(T), 2e-6 * T])


def fields(**more):
    """A message of five points."""
    stamps = [{"sec": int(t), "nanosec": int(t % 1 * 1e9)} for t in T]
    points = [
        {"positions": q.tolist(), "velocities": v.tolist(), "time_from_start": stamp}
        for stamp, q, v in zip(stamps, Q, V, strict=True)
    ]
    return {"header": {}, "joint_names": list(JOINTS), "points": points, **more}


def written(tmp_path, content, name="motion.json"):
    path = tmp_path / name
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


@pytest.mark.parametrize("suffix", [".json", ".yaml", ".yml"])
def test_an_exported_motion_is_read_back(tmp_path, suffix):
    samples = Trajectory(T, Q, V, 3 * V, JOINTS).resample(100)
    planned = read_planned(written(tmp_path, Ros2().text(samples), f"a{suffix}"), JOINTS)
    assert planned.t == pytest.approx(samples.t, abs=0.5e-9)  # whole nanoseconds
    for what in ("q", "v", "a", "tau"):
        np.testing.assert_array_equal(getattr(planned, what), getattr(samples, what))


def test_efforts_of_own_messages_are_held_and_those_of_others_are_not(tmp_path):
    samples = Trajectory(T, Q, V, 3 * V, JOINTS).resample(100)
    message = samples.to_joint_trajectory()
    for own in (Ros2().text(samples), message, {"goal": {"trajectory": message}}, yaml.safe_dump(message)):
        for name in ("a.json", "a.yaml") if not isinstance(own, str) or own[0] == "{" else ("a.yaml",):
            assert read_planned(written(tmp_path, own, name), JOINTS).hold == "zero-order"  # means until the next row
    message["header"]["frame_id"] = "base_link"
    assert read_planned(written(tmp_path, message), JOINTS).hold == "linear"
    table = samples.to_csv(tmp_path / "a.csv")
    assert read_planned(table, JOINTS).hold == "zero-order"


def test_joints_come_in_any_order_and_others_are_left_out(tmp_path):
    names = ["gripper", "elbow", "shoulder"]
    message = fields(joint_names=names)
    for k, point in enumerate(message["points"]):
        point["positions"] = [7.0, Q[k, 1], Q[k, 0]]
        point["velocities"] = [0.0, V[k, 1], V[k, 0]]
    planned = read_planned(written(tmp_path, message), JOINTS)
    np.testing.assert_array_equal(planned.q, Q)
    np.testing.assert_array_equal(planned.v, V)


@pytest.mark.parametrize(
    "wrap", ["trajectory", "joint_trajectory", ("goal", "trajectory"), ("trajectory", "joint_trajectory")]
)
def test_messages_that_have_one_inside(tmp_path, wrap):
    message = fields()
    for key in reversed([wrap] if isinstance(wrap, str) else wrap):
        message = {key: message, "goal_time_tolerance": {"sec": 0}}
    np.testing.assert_array_equal(read_planned(written(tmp_path, message), JOINTS).q, Q)


def test_yaml_as_ros2_topic_echo_prints_it(tmp_path):
    text = yaml.safe_dump(fields()) + "---\n"
    assert "e-06" in text  # which YAML 1.1 has as text, where no point is before the e
    for point in ("1.0e-06", "1e-06"):
        path = written(tmp_path, text.replace("1.0e-06", point), "motion.yaml")
        planned = read_planned(path, JOINTS)
        np.testing.assert_array_equal(planned.q, Q)
        np.testing.assert_array_equal(planned.t, T)


def test_empty_lists_are_nothing(tmp_path):
    message = fields()
    for point in message["points"]:
        point |= {"velocities": [], "effort": []}
    planned = read_planned(written(tmp_path, message), JOINTS)
    assert planned.v is None and planned.a is None and planned.tau is None


def test_ros_1_has_other_names_for_times(tmp_path):
    message = fields()
    for point in message["points"]:
        time = point["time_from_start"]
        point["time_from_start"] = {"secs": time["sec"], "nsecs": time["nanosec"]}
    np.testing.assert_array_equal(read_planned(written(tmp_path, message), JOINTS).t, T)


def point(**changed):
    """A message whose third point says something else."""
    message = fields()
    message["points"][2] |= changed
    return message


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "not JSON"), ("[1, 2]", "no JointTrajectory; a JointTrajectory has joint_names"),
        ("{}", "no JointTrajectory"),
        (fields(joint_names=None), "joint_names is None; it must be a list of names"),
        (fields(joint_names=["shoulder", "wrist"]), "joint 'elbow' is not among them. The robot moves shoulder, elbow"),
        (fields(joint_names=["elbow", "elbow"]), "joint_names has 'elbow' twice"),
        (fields(points=[]), "points: 0; a motion has two or more"), (fields(points=3), "points: 3; a motion has two"),
        (fields(points=[1, 2]), "points[0] is 1"),
        (point(positions=[1]), "positions of points[2]: 1; one of each of 2 joints is needed"),
        (point(velocities=[]), "velocities of points[2]: 0; one of each of 2 joints"),
        (point(positions=[1, "x"]), "positions of points[2] has 'x', which is no number"),
        (point(positions=[1, True]), "has True, which is no number"),
        (point(positions={"a": 1}), "positions of points[2]:"),
        (point(time_from_start=0.5), "time_from_start of points[2] is 0.5; it must be sec and nanosec, whole numbers"),
        (point(time_from_start={"sec": 1}), "time_from_start of points[2]"),
        (point(time_from_start={"sec": 10**400, "nanosec": 0}), "time_from_start of points[2]"),
        (json.dumps(point(positions=[1, 2])).replace("[1, 2]", "[1, 1e999]"), "has inf, which is no number"),
    ],
)  # fmt: skip
def test_a_wrong_message_is_refused(tmp_path, content, words):
    with pytest.raises(TrajectoryError, match=r"motion\.json: ") as caught:
        read_planned(written(tmp_path, content), JOINTS)
    assert words in str(caught.value)


def test_a_wrong_yaml_is_refused(tmp_path):
    for text, words in (
        ("a: [", "not YAML"),
        ("joint_names: !!python/object/apply:os.system [ls]", "no JointTrajectory"),  # a tag makes no object
        ("a: 1\n---\nb: 2\n", "2 documents; it must be one"),
        ("[" * 5000, "deeper than 40"),
        (f"# {'x' * yaml_text.MAX_BYTES}", "larger than"),
    ):
        with pytest.raises(TrajectoryError, match=r"motion\.yaml: ") as caught:
            read_planned(written(tmp_path, text, "motion.yaml"), JOINTS)
        assert words in str(caught.value)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(
                st.sampled_from(["joint_names", "points", "positions", "time_from_start", "sec", "trajectory"]), inner
            )
        ),
        max_leaves=12,
    )
)
def test_any_json_is_one_kind_of_error(tmp_path, content):
    with pytest.raises(TrajectoryError):
        read_planned(written(tmp_path, content), JOINTS)
