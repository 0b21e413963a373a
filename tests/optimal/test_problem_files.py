"""A problem in TOML is the problem in Python, and back; mistakes have a line; strangers' files reach nothing else."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

import armdyn as ad
from armdyn.errors import ProblemError, SpecError
from armdyn.models.tables import KEYS, likely_from, likely_tables, robot_from, robot_table
from armdyn.optimal.problem_files import OPTIONS, PROBLEM, read_problem_file
from armdyn.parsing.toml import read_toml
from problems import RR_FILE

DOCS = (Path(__file__).parents[2] / "docs" / "problem_files.md").read_text()


def refused(name):
    with pytest.raises(ProblemError) as caught:
        ad.read_problem(name)
    return str(caught.value)


def test_names_are_those_of_python():
    fields = {field.name for field in dataclasses.fields(ad.MinimumTimeProblem) if field.init}
    assert set(PROBLEM) == fields - {"robot"}
    assert set(OPTIONS) <= {field.name for field in dataclasses.fields(ad.MinimumTimeOptions)}
    named = {"name", "urdf", "mjcf", "spec", "limits", "likely"}
    assert set(KEYS) - named == {field.name for field in dataclasses.fields(ad.RobotOptions)} - {"package_dirs"}


def test_a_file_is_the_problem_in_python(write_problem):
    file = read_problem_file(write_problem(RR_FILE))
    problem = file.new_problem()
    arm = problem.robot
    same = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), ad.Payload(mass=0.1006))
    assert arm.model_hash == same.model_hash and file.options == {"search": "quick"}
    assert np.array_equal(problem.q_start, [-1.5, np.deg2rad(2)])
    assert np.array_equal(problem.q_goal, [0.2, -np.pi / 84])


def test_the_example_of_the_docs_is_a_problem(write_problem):
    example = re.search(r"```toml\n(.*?)```", DOCS, re.S)[1]
    problem = ad.read_problem(write_problem(example))
    assert np.array_equal(problem.q_start, ad.Robot.from_library("panda").pose("ready"))
    assert problem.robot.payload.mass == 0.5 and len(problem.via) == 1 and problem.obstacles[0].radius == 0.1
    assert problem.path_constraints[0].limit == 2.5 and np.all(np.asarray(problem.reserve) == 0.05)
    # The lines commented out there are right, too.
    other = example.replace('# lock = { panda_joint7 = "45deg" }   arm', 'lock = { panda_joint7 = "45deg" }\narm')
    other = re.sub(r"(?m)^(q_goal|via|reserve|path_constraints).*$", "", other).replace("# goal_pose", "goal_pose")
    other = re.sub(r"}   instead.*", "}", re.sub(r"\[\[problem.obstacles.*?\n\n", "", other, flags=re.S))
    other = (
        other.replace('q_start = "ready"', "q_start = [0, -0.785, 0, -2.356, 0, 1.571]")
        .replace('"panda_hand_tcp"', '"panda_link7"')
        .replace(", rpy = [0, 3.14, 0]", "")
    )
    problem = ad.read_problem(write_problem(other))
    assert problem.robot.nv == 6 and problem.robot.locked["panda_joint7"] == pytest.approx(np.pi / 4)
    assert problem.goal_pose.frame == "panda_link7"


def test_a_urdf_next_to_the_file_and_below(write_problem, tmp_path):
    text = ad.urdf_from_spec(ad.ArmSpec.paper("rr"))
    (tmp_path / "home" / "arms").mkdir()
    (tmp_path / "home" / "arms" / "mine.urdf").write_text(text)
    name = write_problem(RR_FILE.replace('"rr"', '"arms/mine.urdf"'))
    assert ad.read_problem(name).robot.nv == 2
    assert ad.read_problem(f"{tmp_path}/home/../home/{name}").robot.nv == 2


def test_a_file_reaches_nothing_outside_its_folder(write_problem, tmp_path):
    (tmp_path / "outside.urdf").write_text(ad.urdf_from_spec(ad.ArmSpec.paper("rr")))
    Path("link.urdf").symlink_to(tmp_path / "outside.urdf")
    for name in ("../outside.urdf", str(tmp_path / "outside.urdf"), "link.urdf", "/etc/passwd", "x/../../outside.urdf"):
        assert "is outside the folder" in refused(write_problem(RR_FILE.replace('"rr"', f'"{name}"'))), name
    assert "fetched from the internet" in refused(write_problem(RR_FILE.replace('"rr"', '"panda_description"')))
    assert "is no path" in refused(write_problem(RR_FILE.replace('"rr"', '"a\\u0000.urdf"')))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("q_goal", "q_gaol", "line 7: no key 'q_gaol' in [problem]; did you mean 'q_goal'?"),
        ("[problem]", "[cycle]", "line 5: [cycle] is of a cycle file, which armdyn cycle"),
        ("mass", "mas", "line 3: no key 'mas' in [robot.payload]; did you mean 'mass'?"),
        ("[options]", "[optoins]", "line 9: no table 'optoins' at the top; did you mean 'options'?"),
        ('"quick"', '"fast"', "line 10: search is 'fast'; it is one of"),
        ("-1.5,", "-90,", "line 6: start of joint 'joint1' (index 0) is -90 rad, outside its limits"),
        ("0.2,", "true,", "line 7: q_goal has True; a position is a number"),
        ('"-pi/84"]', '"-pi/84", 1]', "line 7: q_goal has shape (3,)"),
        ('"2deg"', '"2m"', "line 6: q_start: '2m', but the joint turns"),
        ('[0.2, "-pi/84"]', '"hoem"', "line 7: q_goal is 'hoem'; expected a number per joint"),
        ("mass = 0.1006", "mass = -1", "line 3: payload mass is -1"),
        ("{ mass = 0.1006 }", "1", "line 3: payload is 1; it is a table"),
        ('name = "rr"', "name = 1", "line 2: name of the robot is 1"),
        ('name = "rr"', "", "line 1: there is no robot; write [robot] and name = 'panda', or a file"),
        ('name = "rr"', 'name = "rrrr"', "line 2: no robot named 'rrrr'; did you mean 'rrr'?"),
        ("q_start = ", "wrap = 1\nq_start = ", "line 6: wrap is 1; it must be True or False"),
        ("q_start = ", "via = 1\nq_start = ", "line 6: via is 1; it must be a list"),
        ("q_start = ", "obstacles = [1]\nq_start = ", 'line 6: obstacle 1: "type" is None'),
        ("q_start = ", "path_constraints = ['x']\nq_start = ", "line 6: --limit: no limit is called 'x'"),
        ("q_start = ", "#", "line 5: [problem] has no q_start: 2 positions of joint1, joint2"),
        ("payload =", "lock = { thumb = 1 }\npayload =", "line 3: cannot lock 'thumb'"),
        ("payload =", "limits = { effort = 1 }\npayload =", "line 3: no key 'effort' in [robot.limits]"),
        ("payload =", "limits = { velocity = [1] }\npayload =", "line 3: limits: velocity is [1]; expected one number"),
        ("payload =", "urdf = '<robot/>'\npayload =", "line 3: [robot] has name and urdf; give one of them"),
        ('name = "rr"', "spec = { name = 'x' }", "line 2: links of spec is None; it is a list of tables"),
        ("payload =", "torque_speed = { x = [[0, 3], [9, 1]] }\npayload =", "line 3: torque_speed: there is no joint"),
        ("payload =", "torque_speed = { joint1 = [[0, 3]] }\npayload =", "line 3: torque_speed of joint 'joint1' is"),
        ("payload =", "torque_speed = 3\npayload =", "line 3: torque_speed is 3; it is a table"),
        ("payload =", "arm = 'x'\npayload =", "line 3: arm is 'x'; it is two joints or links"),
    ],
)  # fmt: skip
def test_mistakes_have_their_line(write_problem, old, new, words):
    assert f"problem.toml, {words}" in refused(write_problem(RR_FILE.replace(old, new, 1)))


SPEC = ad.ArmSpec(name="mine", links=(ad.LinkSpec(length=0.3, com=0.1, mass=0.4, inertia=1e-3),) * 2, effort_limit=5.0)
MJCF = """<mujoco model="two"><worldbody><body name="a"><joint name="j" axis="0 1 0" range="-1 1" limited="true"/>
<inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.01"/></body></worldbody>
<actuator><motor joint="j" ctrlrange="-3 2" ctrllimited="true"/></actuator></mujoco>"""
ROBOTS = (
    lambda **options: ad.Robot.from_spec(ad.ArmSpec.paper("rr"), **options),
    lambda **options: ad.Robot.from_spec(SPEC, **options),
    lambda **options: ad.Robot.from_library("cart_pole", **options),
    lambda **options: ad.Robot.from_library("ur5", lock={"elbow_joint": 0.5}, **options),
    lambda **options: ad.Robot.from_urdf_string(ad.urdf_from_spec(SPEC), **options),
    lambda **options: ad.Robot.from_mjcf_string(MJCF, velocity_limit=4.0, **options),
)


def assert_same(one, other):
    """Two problems are the same, field by field; a rotation goes through a quaternion and back."""
    for own in dataclasses.fields(ad.MinimumTimeProblem):
        a, b = getattr(one, own.name), getattr(other, own.name)
        if own.name == "robot":
            assert (a.model_hash, a.joint_names, a.tip, a.payload) == (b.model_hash, b.joint_names, b.tip, b.payload)
            assert_fields(a.limits, b.limits)
            assert dict(a.locked) == dict(b.locked)
        elif own.name == "limits":
            assert_fields(a, b)
        elif own.name in ("obstacles", "path_constraints"):
            assert list(map(type, a)) == list(map(type, b))
            for mine, its in zip(a, b, strict=True):
                assert_fields(mine, its)
        elif own.name == "goal_pose" and a is not None:
            assert_fields(a, b)
        elif a is None or b is None:
            assert a is b
        elif own.name in ("effort_limit", "position_limit") and isinstance(a, tuple):
            lower, upper, _ = np.broadcast_arrays(*a, one.limits.velocity)
            assert np.array_equal([lower, upper], np.broadcast_arrays(*b, one.limits.velocity)[:2])
        else:
            a, b = np.asarray(a), np.asarray(b)
            assert a.shape == b.shape, own.name
            assert np.array_equal(a, b) if a.dtype != float else np.allclose(a, b, rtol=0, atol=1e-12), own.name


def assert_fields(one, other):
    for own in (field for field in dataclasses.fields(one) if field.compare):  # not the policy of a constraint
        a, b = getattr(one, own.name), getattr(other, own.name)
        if own.name == "actuators":
            assert type(a) is type(b)
            assert np.array_equal(a.lines, b.lines)
        elif a is None or isinstance(a, str):
            assert a == b
        else:
            assert np.allclose(a, b, rtol=0, atol=1e-15), own.name


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::armdyn.ArmdynWarning")  # weak motors cannot hold the goal
@settings(max_examples=30, deadline=None, phases=[Phase.generate])  # shrinking takes minutes
@given(data=st.data())
def test_a_problem_is_written_and_read_again(data, tmp_path_factory):
    draw = data.draw
    number = st.floats(0.05, 0.9)
    mass = draw(st.sampled_from([None, 0.1 + 0.2]))
    payload = None if mass is None else ad.Payload(mass=mass, com=(0.01, 0, 1 / 3), inertia=(1e-3, 2e-3, 2.5e-3))
    robot = draw(st.sampled_from(ROBOTS))(payload=payload)
    n = robot.nv
    if draw(st.booleans()):
        robot = robot.with_limits(3 + draw(number), 1 / 3 + draw(number))
    if draw(st.booleans()):
        robot = robot.with_torque_speed({robot.joint_names[-1]: [[0, 3 + draw(number)], [1, 3], [2, 1 / 3]]})
    if draw(st.booleans()):
        robot = robot.with_armature(draw(number)).with_friction(draw(number), [draw(number)] * n, 0.1 / 3)
    low, high = (
        np.clip(np.array(q), robot.limits.position_lower, robot.limits.position_upper) for q in ([-0.7] * n, [0.6] * n)
    )
    least = np.maximum(robot.limits.effort_upper, 1e-3)
    choices = {
        "v_start": 0.01 * np.ones(n),
        "effort_limit": draw(st.sampled_from([2.0 + draw(number), (-least, 2 * least)])),
        "velocity_limit": draw(st.sampled_from([2.0, np.inf, [2.0 + draw(number)] * n])),
        "position_limit": ([-1.0] * n, 1.0),
        "reserve": draw(number),
        "velocity_reserve": [draw(number)] * n,
        "effort_weight": draw(number),
        "wrap": True,
        "via": [0.3 * low],
        "clearance": 1e-3,
        "acceleration_limit": [10 + draw(number)] * n,
        "jerk_limit": 100 + draw(number),
        "path_constraints": [
            ad.FrameSpeedLimit(1 + draw(number)),
            ad.TorqueRateLimit([50 + draw(number)] * n),
            ad.RmsTorque([2.0 + draw(number)] * n, dwell=0.1 + 0.2),
        ],
        "obstacles": [
            ad.Sphere((5, 5, draw(number)), 0.1, name='a "ball"'),
            ad.Capsule((5, 5, 1), (5, 5, 2), 0.1),
            ad.Box((0.1, 0.2, 0.3), [[0, -1, 0, 5], [1, 0, 0, 5], [0, 0, 1, 5], [0, 0, 0, 1]]),
        ],
    }
    if not robot.urdf or robot.name == "mine":
        choices.pop("obstacles")
    chosen = draw(st.sets(st.sampled_from(sorted(choices))))
    try:
        problem = ad.MinimumTimeProblem(robot, q_start=low, q_goal=high, **{key: choices[key] for key in chosen})
    except ProblemError:  # such as both torque limits above zero
        return
    file = tmp_path_factory.mktemp("toml") / "problem.toml"
    file.write_text(problem.to_toml(), encoding="utf-8")
    again = ad.read_problem(file)
    assert_same(problem, again)
    assert again.to_toml() == problem.to_toml() or "obstacles" in chosen or robot.origin.text


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::armdyn.ArmdynWarning")  # a joint without a motor holds nothing
def test_goal_poses_passive_joints_and_weights_are_written(tmp_path):
    file, rr = tmp_path / "problem.toml", ad.Robot.from_library("ur5")
    turned = np.eye(4)
    turned[:3, :3], turned[:3, 3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]], [0.4, 0.2, 0.3]
    for placement in (turned, [0.4, 0.2, 0.3]):
        problem = ad.MinimumTimeProblem(rr, q_start=np.zeros(6), goal_pose=ad.GoalPose("tool0", placement))
        file.write_text(problem.to_toml())
        assert_same(problem, ad.read_problem(file))
    arm = ad.Robot.from_spec(SPEC)
    for more in ({"passive": ["joint2"]}, {"relative_effort_weight": 0.1 + 0.2, "v_goal": [0.1, 0.2]}):
        problem = ad.MinimumTimeProblem(arm, q_start=[0, 0], q_goal=[1, 0], **more)
        file.write_text(problem.to_toml())
        assert_same(problem, ad.read_problem(file))


def test_a_robots_file_is_named_if_it_is_inside_the_folder(tmp_path):
    (tmp_path / "arms").mkdir()
    (tmp_path / "arms" / "mine.urdf").write_text(ad.urdf_from_spec(SPEC))
    robot = ad.Robot.from_urdf(tmp_path / "arms" / "mine.urdf", arm=("joint1", "link2"))
    problem = ad.MinimumTimeProblem(robot, q_start=[0, 0], q_goal=[1, 0])
    inside, outside = problem.to_toml(tmp_path), problem.to_toml()
    assert 'name = "arms/mine.urdf"' in inside and "<robot" in outside
    for text in (inside, outside):
        (tmp_path / "problem.toml").write_text(text)
        assert_same(problem, ad.read_problem(tmp_path / "problem.toml"))


def test_values_without_a_file_form_are_refused(tmp_path):
    arm = ad.Robot.from_spec(SPEC)
    ends = {"q_start": [0, 0], "q_goal": [1, 0]}
    with pytest.raises(SpecError, match="no file and no text"):
        ad.MinimumTimeProblem(ad.Robot.from_model(arm.model), **ends).to_toml()
    model = arm.model.copy()
    model.gravity.linear = np.zeros(3)
    with pytest.raises(SpecError, match="was changed after it was read"):
        ad.MinimumTimeProblem(dataclasses.replace(arm, model=model), **ends).to_toml()
    before = arm.model_hash
    arm.model.gravity.linear = np.zeros(3)  # in place: the hash is of the model as it is
    assert arm.model_hash != before
    with pytest.raises(SpecError, match="was changed after it was read"):
        ad.MinimumTimeProblem(arm, **ends).to_toml()
    file = tmp_path / "arm.urdf"
    file.write_text(ad.urdf_from_spec(SPEC))
    problem = ad.MinimumTimeProblem(ad.Robot.from_urdf(file), **ends)
    file.write_text(ad.urdf_from_spec(ad.ArmSpec.paper("rr")))
    with pytest.raises(SpecError, match="was changed after it was read"):
        problem.to_toml()


def test_likely_arms_are_as_the_robot_but_for_their_differences(tmp_path):
    file = tmp_path / "identified.toml"
    file.write_text("[robot]\nname = 'rr'\npayload = { mass = 0.1 }\n[[robot.likely]]\npayload = { mass = 0.11 }\n"
                    "[[robot.likely]]\nfriction = [0.1, 0.2]\n")  # fmt: skip
    table = read_toml(file).table("robot")
    assert robot_from(table).payload.mass == 0.1
    one, other = likely_from(table)
    assert one.payload.mass == 0.11 and other.payload.mass == 0.1 and list(other.friction.coulomb) == [0.1, 0.2]
    made = likely_tables(robot_table(robot_from(table)), (one, other))
    assert [set(each) for each in made] == [{"payload"}, {"friction"}]
    file.write_text("[robot]\nname = 'rr'\n[[robot.likely]]\nmass = 0.11\n")
    with pytest.raises(ProblemError, match=r"line 4: no key 'mass' in \[robot.likely\[1\]\]"):
        likely_from(read_toml(file).table("robot"))
