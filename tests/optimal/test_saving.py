"""Time saved by more of the first deciding limit, against closed forms and independent solves."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.answer.words import solution_words
from armdyn.optimal.saving import with_saving
from problems import cart, paper_problem, solve, solved

OPTIONS = ad.MinimumTimeOptions(time_limit=30.0)
START, GOAL = [0, -1.5, 1, 0, 0, 0], [1, -0.5, 2, 0, 0, 0]


def ur5(**options):
    return ad.MinimumTimeProblem(ad.Robot.from_library("ur5"), q_start=START, q_goal=GOAL, **options)


def panda(**options):
    goal = [1, 0.2, 0.5, -1.5, 0.3, 2, -0.5]
    return ad.MinimumTimeProblem(ad.Robot.from_library("panda"), q_start="ready", q_goal=goal, **options)


def test_on_a_rail_the_saving_is_the_closed_form():
    # t = d/v + v/a of 2 m, 0.8 m/s, 1 m/s², of which speed decides most.
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], velocity_limit=0.8)
    first = with_saving(solve(problem), OPTIONS).decides[0]
    faster = 2 / 0.808 + 0.808
    # Of the saving of 17 ms; torques that are linear between samples keep durations to 1e-5.
    assert first.saved == pytest.approx(3.3 - faster, rel=5e-3) and first.ties == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    "problem",
    [
        lambda **own: paper_problem("rr").variant(**own),
        lambda **own: paper_problem("rr", 0.3).variant(**own),
        lambda **own: ur5(reserve=0.2, velocity_reserve=0.1, **own),
        ur5,
        panda,
        lambda **own: panda(**{"acceleration_limit": 10.0, "jerk_limit": 5e3} | own),
    ],
)
def test_it_is_what_an_independent_solve_saves(problem):
    """Solved from scratch, by other starts than the solution's own motion."""
    plain, fastest = problem(), ad.MinimumTimeOptions(calm=0.0, bound=False, seed=1)
    found = with_saving(ad.solve_minimum_time(plain, ad.MinimumTimeOptions(bound=False)), OPTIONS)
    first, robot = found.decides[0], plain.robot
    limits = {"torque limit": robot.limits.effort_upper, "velocity limit": robot.limits.velocity}
    limit = limits.get(first.limit, np.full(robot.nv, 10.0)) * np.where(
        np.array(robot.joint_names) == first.joint, 1.01, 1
    )
    name = first.limit.replace(" ", "_").replace("torque", "effort")
    base, more = (ad.solve_minimum_time(one, fastest) for one in (plain, problem(**{name: limit})))
    # Curves' durations agree to 2e-5, a fiftieth of a saving of 0.1 %; arcs' to 1e-9.
    assert first.saved == pytest.approx(base.duration - more.duration, rel=0.01, abs=2e-5 * base.duration)
    assert 0 < first.saved <= 0.01 * first.part * found.duration + 2e-5 * base.duration and first.ties == ()


@pytest.mark.slow
@pytest.mark.parametrize("own", [{}, {"kinematic": True}, {"reserve": 0.1, "velocity_reserve": 0.1}])
def test_joints_that_tie_are_named_and_are_not_idle(own):
    """Three joints turn by 1 rad within the same limits: t = d/v + v/a, so 1 % more of one alone saves nothing."""
    found = ad.solve_minimum_time(ur5(velocity_limit=2.0, acceleration_limit=5.0, **own), replace(OPTIONS, bound=False))
    again = with_saving(found, OPTIONS)
    first = again.decides[0]
    joints = {"shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"}
    assert {first.joint, *(name.partition("'")[0] for name in first.ties)} == joints
    assert first.saved < 1e-5 * found.duration  # the accuracy of a solve
    assert not joints & set(again.certificate.idle) and joints & set(found.certificate.idle)
    words = solution_words(again)["time decided by"]
    assert "1 % more of the first alone saves " in words and " tie with it, 1 % more of all limits " in words


def test_a_limit_that_cannot_be_raised_keeps_its_promise_at_most():
    solution = solved("rr")
    curves = {"joint1": [[0, 3], [4, 3], [16, 1]], "joint2": [[0, 3], [4, 3], [16, 1]]}
    by_speed = solution.problem.variant(robot=solution.problem.robot.with_torque_speed(curves))
    for other in (replace(solution, problem=by_speed), replace(solution, decides=())):
        assert with_saving(other, OPTIONS) is other
    assert with_saving(solution, replace(OPTIONS, time_limit=1e-6)) is solution
    assert "saves at most" in str(solution) and "saves at most" not in str(with_saving(solution, OPTIONS))
