import warnings
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.answer.words import assessment
from armdyn.optimal.curves.goals import screened
from armdyn.optimal.problem.task import Task
from problems import CART, POSES, paper_arm, paper_problem


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q_start": [0.0]}, r"q_start has shape \(1,\).*joint1, joint2"),
        ({"q_goal": [0.0, np.nan]}, "q_goal of joint .joint2. is nan rad or m .index 1.; it must be finite"),
        ({"v_goal": [0.0, np.inf]}, "v_goal .*must be finite"),
        ({"q_goal": [0.1, 3.2]}, r"goal of joint 'joint2' \(index 1\) is 3.2 rad, outside its limits"),
        ({"q_start": [-3.3, 0.0]}, "start of joint 'joint1'"),
        ({"v_start": [2000.0, 0.0]}, "start velocity of joint 'joint1'.*1000 rad/s"),
        ({"q_goal": POSES["rr"][0]}, "start and goal are the same state"),
        (
            {"q_start": [np.pi, 0], "v_start": [0.5, 0]},
            "start of joint 'joint1'.* 3.14159 rad, .* 0.5 rad/s leads beyond",
        ),
        ({"q_goal": [0, -np.pi], "v_goal": [0, 0.5]}, "goal of joint 'joint2'.* comes from beyond: no motion"),
        ({"jerk_limit": -1.0}, "is -1.0 rad/s³ "),
        ({"effort_limit": 0.0}, "no joint has a motor: all torque limits are zero .joint1, joint2."),
        ({"effort_limit": [3.0, np.inf]}, "joint 'joint2' has torque limits"),
        ({"effort_limit": [3.0, 3.0, 3.0]}, "effort_limit has shape"),
        ({"velocity_limit": -1.0}, "velocity limit -1.0 rad/s"),
        ({"velocity_limit": np.nan}, "velocity_limit .* NaN"),
        ({"position_limit": (1.0, -1.0)}, "no room"),
        ({"effort_weight": -1.0}, "effort_weight is -1.0"),
    ],
)
def test_ill_posed(change, message):
    given = {"q_start": POSES["rr"][0], "q_goal": POSES["rr"][1], **change}
    with pytest.raises(ProblemError, match=message):
        ad.MinimumTimeProblem(paper_arm("rr"), **given)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"v_start": [2000.0]}, "is 2000 m/s, beyond its limit 1000 m/s"),
        ({"velocity_limit": 1e-10}, "velocity limit 1e-10 m/s"),
        ({"effort_limit": np.inf}, r"\[-inf, inf\] N;"),
        ({"position_limit": (1.0, 1.0)}, r"\[1.0, 1.0\] m: no room"),
        ({"acceleration_limit": -2.0}, "is -2.0 m/s² "),
    ],
)
def test_limits_of_a_joint_that_slides_have_its_units(change, message):
    with pytest.raises(ProblemError, match=message):
        ad.MinimumTimeProblem(ad.Robot.from_urdf_string(CART), q_start=[0.0], q_goal=[1.0], **change)


def test_a_motion_may_leave_a_limit_and_end_on_one():
    ends = {"q_start": [np.pi, 0], "v_start": [-0.5, 0], "q_goal": [0, -np.pi], "v_goal": [0, -0.5]}
    assert ad.MinimumTimeProblem(paper_arm("rr"), **ends).v_goal[1] == -0.5
    sliding = {**ends, "v_start": [1e-6, 1.0], "v_goal": [0, 0]}
    assert ad.MinimumTimeProblem(paper_arm("rr"), **sliding).v_start[0] == 1e-6


def test_a_way_back_to_the_start_has_via_points():
    home, there = POSES["rr"]
    assert len(ad.MinimumTimeProblem(paper_arm("rr"), q_start=home, q_goal=home, via=[there]).poses) == 3
    with pytest.raises(ProblemError, match="has zero length"):
        ad.MinimumTimeProblem(paper_arm("rr"), q_start=home, q_goal=home, via=[home])


def test_a_joint_without_torque_is_refused_by_name():
    robot = ad.Robot.from_library("double_pendulum")
    with pytest.raises(ProblemError, match="give `effort_limit`"):
        ad.MinimumTimeProblem(robot, q_start=[0, 0], q_goal=[1, 0])
    ad.MinimumTimeProblem(robot, q_start=[0, 0], q_goal=[1, 0], effort_limit=50, velocity_limit=10)


def test_limits_are_resolved():
    problem = paper_problem("rr", effort_limit=([-1.0, -2.0], 3.0), velocity_limit=[5, np.inf])
    np.testing.assert_array_equal(problem.limits.effort_lower, [-1, -2])
    np.testing.assert_array_equal(problem.limits.effort_upper, [3, 3])
    np.testing.assert_array_equal(problem.limits.velocity, [5, np.inf])
    # The first joint turns 11/20 of π at 5 rad/s; the second has no limit.
    assert problem.duration_bound() == pytest.approx(11 * np.pi / 20 / 5, rel=1e-14)
    assert paper_problem("rr", position_limit=(-np.inf, np.inf)).limits.position_upper[0] == np.inf


def test_goal_that_cannot_be_held_is_a_warning():
    # 5.510 N m: reference.json's static holding torque of RR with 1 kg at the tip.
    with pytest.warns(ad.ArmdynWarning, match=r"'joint1' needs 5.51 N m to hold the goal but its limit is 3 N m"):
        problem = paper_problem("rr", 1.0)
    assert problem.holding_torque()[0] == pytest.approx(5.510426069386133, rel=1e-9)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        paper_problem("rr", 0.2)


def test_a_motion_to_a_goal_that_cannot_be_held_is_not_usable():
    """1 kg at RR's tip takes 5.51 N m at the goal, where a motor has 3: the fastest motion there falls down again."""
    with pytest.warns(ad.ArmdynWarning):
        problem = paper_problem("rr", 1.0)
    solution = ad.solve_minimum_time(problem)
    assert solution.success and solution.feasible and solution.certified and not solution.usable
    assert "joint 'joint1' needs 5.51 N m to hold the goal but its limit is 3 N m" in solution.message
    (advice,) = solution.what_to_do
    assert "`payload`" in advice and "`v_goal`" in advice
    assert problem.holding_deficit.excess == pytest.approx((5.510426069386133 - 3) / 3, rel=1e-9)


def test_ends_at_which_the_arm_does_not_stay_by_itself_are_in_the_verdict():
    """Issue of the state that says "usable: yes" alone: a start beyond the motors, a goal off a pendulum's balance."""
    heavy = paper_arm("rr", 1.0)
    falls = ad.MinimumTimeProblem(heavy, q_start=[0.0, 0.0], q_goal=[-np.pi / 2, 0.0])
    (words,) = falls.unstable_ends
    assert (
        falls.holding_deficit is None
        and words.startswith("joint 'joint1' needs 5.566")
        and "to hold the start but" in words
    )
    assert f"The arm does not stay there by itself: {words}." in assessment(ad.solve_minimum_time(falls))
    assert not falls.variant(v_start=[0.1, 0]).unstable_ends  # it passes there in flight
    pole = ad.Robot.from_library("pendubot")
    with pytest.warns(ad.ArmdynWarning):
        aside = ad.MinimumTimeProblem(pole, q_start=[0, 0], q_goal=[0.3, 0.2])
    assert "it has no motor" in aside.unstable_ends[-1]
    assert not ad.MinimumTimeProblem(pole, q_start=[0, 0], q_goal=[np.pi, 0]).unstable_ends


@pytest.mark.slow
def test_a_start_that_cannot_be_held_is_named_before_the_search_and_where_it_fails():
    """RR lies with 1.5 kg at its tip, and is to be lifted by a tenth of the torque; it has no room to swing."""
    arm = paper_arm("rr", 1.5).with_limits(0.8, None)
    room = ([-0.5, -0.5], [2.0, 0.5])
    problem = ad.MinimumTimeProblem(arm, q_start=[0.0, 0.0], q_goal=[np.pi / 2, 0.0], position_limit=room)
    (weak,) = problem.weak_ends
    needed = arm.holding_torque([0.0, 0.0])[0]
    assert (weak.joint, weak.pose) == ("joint1", "start") and problem.holding_deficit is None
    words = f"joint 'joint1' needs {needed:.4g} N m to hold the start but its limit is 0.8 N m"
    told = []
    solution = ad.solve_minimum_time(problem, progress=told.append)
    assert not solution.moves and told[0].startswith(words) and "quick search" in told[0]
    assert solution.message.startswith(f"no motion was found: {words}") and "worst" not in solution.message
    assert "`search` thorough" in solution.message
    (advice,) = solution.what_to_do
    assert "cannot stay at the start" in advice and "`effort_limit`" in advice and "`v_goal`" not in advice
    assert not problem.variant(v_start=[0.1, 0.0]).weak_ends


def test_the_holding_deficit_counts_friction_reserve_and_passive_joints():
    def holding_deficit(**more):
        robot = more.pop("robot", paper_arm("rr", 1.0))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ad.MinimumTimeProblem(robot, q_start=POSES["rr"][0], q_goal=POSES["rr"][1], **more).holding_deficit

    assert holding_deficit().joint == "joint1"
    assert holding_deficit(v_goal=[0.1, 0]) is None  # it does not stay
    assert holding_deficit(effort_limit=5.52) is None
    assert holding_deficit(effort_limit=5.5) is not None
    assert holding_deficit(effort_limit=5.52, reserve=0.5) is None  # feedback has the rest of the motor
    assert (
        holding_deficit(robot=paper_arm("rr", 1.0).with_friction(friction=2.6)) is None
    )  # dry friction holds the rest
    assert holding_deficit(passive=("joint1",)) is None  # it has no motor to hold it


def test_of_a_goal_pose_the_branches_that_can_be_held_are_solved():
    robot = paper_arm("rr")
    pose = ad.GoalPose("tip", [0.35, 0, 0.1])
    free = ad.MinimumTimeProblem(robot, q_start=POSES["rr"][0], goal_pose=pose)
    needed = [float(np.max(np.abs(free.variant(q_goal=q, goal_pose=None).holding_torque()))) for q in free.goals]
    assert abs(needed[0] - needed[1]) > 0.05
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        problem = free.variant(effort_limit=sum(needed) / 2)
    tasks, tried = screened(Task.of(problem))
    assert len(tasks) == 1 and tasks[0].problem.holding_deficit is None and len(tried) == 2
    np.testing.assert_array_equal(tasks[0].problem.q_goal, free.goals[int(np.argmin(needed))])


def test_values_are_frozen():
    problem = paper_problem("r")
    with pytest.raises(ValueError, match="read-only"):
        problem.q_start[0] = 1.0
    assert replace(problem, effort_weight=1.0).effort_weight == 1.0


@pytest.mark.parametrize("way", [1e-12, 1e-9, 9e-7])
def test_below_the_goals_tolerance_no_motion_is_needed(way):
    """A motion of 1e-12 rad was one of 1.5e-8 s, and those of 1e-9 rad took longer than those of 1e-5."""
    with pytest.raises(ProblemError, match=rf"are {way:g} m apart .*less than the 1e-06 m .*: no motion is needed"):
        ad.MinimumTimeProblem(ad.Robot.from_urdf_string(CART), q_start=[0.0], q_goal=[way])
    start = np.zeros(2)
    with pytest.raises(ProblemError, match=r"joint 'joint2'.*no motion is needed"):
        ad.MinimumTimeProblem(paper_arm("rr"), q_start=start, q_goal=[0.0, -way])
    ad.MinimumTimeProblem(paper_arm("rr"), q_start=start, q_goal=[0.0, -way], v_goal=[0.0, 0.1])  # in flight it is one


@pytest.mark.slow
def test_short_motions_take_the_time_of_constant_torques():
    """Inertia and gravity's torque are constant along it: t = sqrt(2 d (1/a + 1/b)) with a, b the rates."""
    arm, ways = paper_arm("r"), np.array([1e-6, 1e-5, 1e-4])
    inertia = pin.crba(arm.model, arm.model.createData(), np.zeros(1))[0, 0]
    weight, most = arm.holding_torque(np.zeros(1))[0], arm.limits.effort_upper[0]
    rates = (most - weight) / inertia, (most + weight) / inertia
    taken = [ad.solve_minimum_time(ad.MinimumTimeProblem(arm, q_start=[0.0], q_goal=[way])).duration for way in ways]
    # The way of 1e-4 rad changes gravity's torque by less than 1e-4 of itself.
    assert taken == pytest.approx(np.sqrt(2 * ways * (1 / rates[0] + 1 / rates[1])), rel=1e-4)


def test_arrays_of_a_problem_are_read_only():
    ball = ad.Sphere((5.0, 5.0, 5.0), 0.1)
    for problem in (paper_problem("rr"), paper_problem("rr", obstacles=[ball], reserve=0.1, acceleration_limit=100.0)):
        for name in ("q_start", "q_goal", "v_start", "v_goal", "poses", "reserve", "velocity_reserve"):
            assert not getattr(problem, name).flags.writeable, name
