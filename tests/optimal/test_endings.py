"""How a solve ends that finds nothing, or not in time, or is not let finish."""

import os
import signal
import time
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.codegen.deadline import NoTimeError, until
from armdyn.optimal.answer.assembly import assembled
from armdyn.optimal.answer.solution import minimum_time_summary
from armdyn.optimal.answer.words import solution_words, title_words
from armdyn.optimal.curves.layout import CurveLayout
from armdyn.optimal.curves.program import build
from armdyn.optimal.problem.status import Stop
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import certify
from oracles import joint, link, urdf
from problems import paper_problem


@pytest.mark.slow
def test_unreachable_goal_is_reported_not_pretended():
    # A torque that cannot even lift the arm's own weight leaves no motion to the goal.
    with pytest.warns(ad.ArmdynWarning, match="hold the goal"):
        problem = paper_problem("r", 1.0, effort_limit=0.05, position_limit=(-1.6, 0.2))
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(starts=2))
    assert not solution.success
    assert solution.status in (ad.Status.INFEASIBLE, ad.Status.ITERATION_LIMIT, ad.Status.FAILED)
    assert solution.worst_violation is not None
    assert "joint1" in solution.message


def test_time_limit_returns_the_best_so_far():
    solution = ad.solve_minimum_time(paper_problem("rrr"), ad.MinimumTimeOptions(time_limit=1e-3))
    assert not solution.success
    assert solution.status is ad.Status.TIME_LIMIT
    assert solution.trajectory.duration > 0


@pytest.mark.parametrize("more", [{}, {"effort_weight": 1.0}, {"acceleration_limit": 50.0}])
def test_nothing_is_built_when_the_time_is_up(more, monkeypatch):
    """A hundredth of a second is gone when the search begins: then it ends without a program, or a fork."""
    monkeypatch.setattr("armdyn.optimal.problem.task.Task.in_time", lambda *_: pytest.fail("a program is built"))
    solution = ad.solve_minimum_time(paper_problem("rrr", **more), ad.MinimumTimeOptions(time_limit=1e-9))
    assert solution.status is ad.Status.TIME_LIMIT and not solution.moves
    assert solution.message == "no motion was found: the time limit of 1e-09 s ended the search"


@pytest.mark.slow
def test_equations_that_take_longer_than_is_left_are_not_begun(read):
    """80 joints took 41 CPU s of a limit of 3 s: their equations alone 13 s."""
    text = urdf(link("l0"), *(link(f"l{i}") + joint(f"j{i}", f"l{i - 1}", f"l{i}") for i in range(1, 61)))
    robot = read(text, effort_limit=np.full(60, 1e4), velocity_limit=3.0)
    began, still = time.process_time(), np.zeros(robot.nv)
    problem = ad.MinimumTimeProblem(robot, q_start=still, q_goal=still + 0.1)
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(time_limit=0.1, bound=False))
    # Without a step the answer is the straight path itself, replayed: it is a motion of this strong arm.
    assert solution.status is ad.Status.TIME_LIMIT and (solution.usable or not solution.moves)
    assert "the time limit of 0.1 s ended the search" in solution.message
    assert time.process_time() - began < 10.0  # the dynamics take 2, the equations would 6 more, the solver 20
    with (
        until(time.perf_counter() + 3.0),
        pytest.raises(NoTimeError, match=r"equations of 60 joints takes some 5\.4 s"),
    ):
        build(Task.of(problem).dynamics, CurveLayout(60, (8,)), (), False)


def timed_out(problem, when, monkeypatch, **options):
    """The solution of a problem whose time is up when a line of progress says so, for any load of the machine."""
    lines = []
    monkeypatch.setattr(Stop, "late", property(lambda self: any(when in line for line in lines)))
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(**options), lines.append)
    assert any(when in line for line in lines)
    return solution


UR5 = {"q_start": [0, -1.2, 1.0, -1.4, -1.57, 0], "q_goal": [1.2, -0.8, 1.3, -1.8, -1.2, 0.5]}
ENDED = "the time limit of 300 s ended the search; "


def ur5_pose():
    robot = ad.Robot.from_library("ur5")
    model, data, wrist = robot.model, robot.model.createData(), robot.frame("tool0")
    pin.forwardKinematics(model, data, np.array(UR5["q_goal"]))
    pose = ad.GoalPose("tool0", data.oMi[wrist.parentJoint] * wrist.placement)
    return ad.MinimumTimeProblem(robot, q_start=UR5["q_start"], goal_pose=pose)


def behind_a_post():
    post = ad.Box((0.12, 0.12, 0.6), (0.55, 0, 0.3), name="post")
    near = [0.3, 0, -1.9, 0, 2.2, 0.785]
    return ad.MinimumTimeProblem(
        ad.Robot.from_library("panda"), q_start=[-0.8, *near], q_goal=[0.8, *near], obstacles=[post]
    )


@pytest.mark.parametrize(
    ("posed", "when"),
    [
        (lambda: ad.MinimumTimeProblem(ad.Robot.from_library("ur5"), **UR5), "round 1"),
        (lambda: paper_problem("rrr", velocity_limit=6.0), "round 1"),
        (ur5_pose, "goal 2 of the 2 best"),
        (behind_a_post, "replaying"),
    ],
    ids=["curve", "bounded", "several goals", "ways"],
)
def test_a_motion_whose_search_the_time_limit_ended_is_usable_and_not_called_solved(posed, when, monkeypatch):
    solution = timed_out(posed(), when, monkeypatch)
    assert solution.status is ad.Status.TIME_LIMIT and solution.message.startswith(ENDED)
    assert solution.success and solution.usable and not solution.certified
    summary = minimum_time_summary(solution)
    assert summary["status"] == "time_limit" and "The time limit ended the search" in summary["assessment"]
    assert solution_words(solution)["status"] == "time limit"
    assert title_words(solution).startswith("best so far ")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("posed", "when"),
    [
        (lambda: paper_problem("rrr"), "guess 1 of"),
        (lambda: paper_problem("rr", obstacles=[ad.Sphere((0.3, 0, -0.1), 0.06)]), "paths round the obstacles"),
        (ur5_pose, "goal 2 of"),
    ],
    ids=["search in processes", "planner", "screening"],
)
def test_a_search_that_the_time_limit_ended_is_reported(posed, when, monkeypatch):
    solution = timed_out(posed(), when, monkeypatch, workers=2)
    assert solution.status is ad.Status.TIME_LIMIT and "the time limit of 300 s ended the search" in solution.message
    assert not solution.certified


def test_a_certified_motion_is_solved_for_any_clock_afterwards(monkeypatch):
    def cut(task, *found):
        task.stop.cut()
        return assembled(task, *found)

    monkeypatch.setattr("armdyn.optimal.minimum_time.assembled", cut)
    solution = ad.solve_minimum_time(paper_problem("rr"))
    assert solution.status is ad.Status.SOLVED and solution.certified


def test_interrupt_returns_the_best_so_far():
    messages = []

    def press(text):
        if not messages:
            os.kill(os.getpid(), signal.SIGINT)
        messages.append(text)

    problem = paper_problem("rrr", position_limit=(-np.inf, np.inf))
    before = signal.getsignal(signal.SIGINT)
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(starts=400), press)
    assert solution.status is ad.Status.INTERRUPTED, solution.message
    assert not solution.success
    assert len(messages) < 100  # of 400 guesses
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize("mass", [0.1, 1.5])
def test_an_interrupt_of_the_quick_search_of_a_start_that_cannot_be_held_ends_the_solve(mass):
    """With 0.1 kg there is a motion, whose normal search began after Ctrl-C; with 1.5 kg none, as of a whole search."""
    messages = []

    def press(text):
        if not messages:
            os.kill(os.getpid(), signal.SIGINT)
        messages.append(text)

    arm = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), ad.Payload(mass=mass))
    weak = arm.with_limits(0.9 * np.abs(arm.holding_torque([0.0, 0.0])), None)
    problem = ad.MinimumTimeProblem(weak, q_start=[0.0, 0.0], q_goal=[-np.pi / 2, 0.0])
    solution = ad.solve_minimum_time(problem, progress=press)
    assert "quick search comes first" in messages[0]
    assert solution.status is ad.Status.INTERRUPTED and "a quick search was made" not in solution.message


def test_an_interrupt_between_a_planned_path_and_its_first_curve():
    def press(text):
        if text == "the motion without obstacles":
            os.kill(os.getpid(), signal.SIGINT)

    far = ad.Box((0.1, 0.1, 0.1), (2.0, 0, 0), name="far")
    robot = ad.Robot.from_library("ur5")
    problem = ad.MinimumTimeProblem(robot, q_start=np.zeros(6), q_goal=np.full(6, 0.5), obstacles=[far])
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(bound=False), press)
    assert solution.status is ad.Status.INTERRUPTED, solution.message
    assert not solution.success and solution.trajectory.duration > 0


BALL = ad.Sphere((0.3, 0, -0.1), 0.06, name="ball")


@pytest.mark.slow
def test_a_crowded_problem_without_a_way_says_so_though_a_motion_that_touches_was_found(monkeypatch):
    monkeypatch.setattr("armdyn.optimal.curves.planned_paths.plan_paths", lambda *_, **__: iter(()))
    solution = ad.solve_minimum_time(paper_problem("rr", obstacles=[BALL]))
    assert solution.status is ad.Status.INFEASIBLE and not solution.success
    said = "no collision-free path was found in 200000 collision checks, the planner's budget; without obstacles "
    assert solution.message.startswith(said) and "inside 'ball'" in solution.message


@pytest.mark.slow
def test_walled_in_between_balls():
    solution = ad.solve_minimum_time(paper_problem("rr", obstacles=[BALL]))
    assert solution.status is ad.Status.INFEASIBLE and solution.message.startswith("no collision-free path was found")
    near = replace(BALL, radius=0.03)
    assert ad.solve_minimum_time(paper_problem("rr", obstacles=[near])).usable


@pytest.mark.slow
def test_an_interrupt_after_the_first_of_several_goals_ends_all():
    """The first goal's solution is the answer, and says that it was interrupted."""
    messages: list[str] = []

    def press(text):
        if messages and messages[-1].startswith("goal 2 of the"):
            os.kill(os.getpid(), signal.SIGINT)
        messages.append(text)

    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    problem = ad.MinimumTimeProblem(robot, q_start=[0.1, 0.2], goal_pose=ad.GoalPose(robot.tip, (0.3, 0.0, -0.1)))
    found = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(search="quick", workers=1), press)
    assert found.status is ad.Status.INTERRUPTED and found.usable and not found.success
    assert found.message.startswith("interrupted; ")


@pytest.mark.slow
def test_an_arm_that_stays_where_it_is_does_not_land_on_a_goal_nearby():
    robot, way, jerk = ad.Robot.from_spec(ad.ArmSpec.paper("r")), 2e-6, 100.0
    problem = ad.MinimumTimeProblem(robot, q_start=[0.3], q_goal=[0.3 + way], jerk_limit=jerk)
    found = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(search="quick", starts=3, workers=1))
    assert not found.usable or found.duration >= 0.99 * (32 * way / jerk) ** (1 / 3)  # rest to rest, by its jerk alone


@pytest.mark.parametrize(("way", "landing"), [(1.0, 1e-3), (1e-3, 1e-5), (2e-6, 2e-8)])
def test_the_goal_error_that_lands_is_at_most_a_hundredth_of_the_way(way, landing):
    problem = ad.MinimumTimeProblem(ad.Robot.from_spec(ad.ArmSpec.paper("r")), q_start=[0.0], q_goal=[way])
    assert problem.landing == pytest.approx(landing)
    flying = ad.MinimumTimeProblem(problem.robot, q_start=[0.0], q_goal=[way], v_goal=[0.1])
    assert flying.landing == 1e-3  # its way says nothing: it may go back first


def test_each_of_several_goals_has_a_landing_of_its_own_way():
    far = ad.MinimumTimeProblem(ad.Robot.from_spec(ad.ArmSpec.paper("rr")), q_start=[0.3, 0.4], q_goal=[1.3, 0.4])
    near = Task.of(far).for_problem(far.variant(q_goal=[0.3 + 2e-6, 0.4])).problem
    still = ad.Trajectory.at_rest(near.q_start, np.zeros(2), 1.0, near.robot.joint_names)
    stayed = certify(near, still, None)
    assert stayed.landing == near.landing == pytest.approx(2e-8) and not stayed.lands
