"""Fastest switching times: closed forms, the arcs' collocation, the model against neighbouring motions."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.arcs.arc import Arc, Mode
from armdyn.optimal.problem.status import Budget, Stop
from armdyn.optimal.switching.extremal.descent import fastest, landed
from armdyn.optimal.switching.extremal.quadratic_model import LinearRollout
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.refinement import shooting_problem
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.task import Task
from problems import cart, random_solution, solved

U, L = Mode.UPPER, Mode.LOWER


def shooting(problem, motion):
    return shooting_problem(Task.of(problem, MinimumTimeOptions(compile=False)), motion)


def beside(phases, part=0.02, seed=0):
    """The structure of an optimum whose times and states are all a little off."""
    given, random = SwitchingStructure.of(phases.arcs, phases.torques), np.random.default_rng(seed)
    times = np.sort(given.times * (1 + part * random.uniform(-1, 1, given.size)))
    states = given.states * (1 + part * random.uniform(-1, 1, given.states.shape))
    return given.moved(np.append(times - given.times, part * given.duration), states)


def test_the_double_integrator_turns_round_half_way():
    # 2 m on a level rail, 1 kg, 1 N: t_f = 2 sqrt(2) s, and half of it full speed ahead (Kirk, section 5.4).
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0])
    t = np.linspace(0, 2.5, 21)
    guess = ad.Trajectory(t, 0.8 * t[:, None], np.full((21, 1), 0.8), np.zeros((21, 1)))
    found, why = fastest(shooting(problem, guess), SwitchingStructure.of([Arc(1.5, (U,)), Arc(1.0, (L,))], guess))
    assert not why
    assert found.structure.duration == pytest.approx(2 * np.sqrt(2), rel=1e-10)
    assert found.structure.times == pytest.approx([np.sqrt(2)], rel=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("arm", ["rr", "rrr"])
def test_an_optimum_is_found_again_from_a_neighbour(arm):
    solution = solved(arm)
    found, why = fastest(shooting(solution.problem, solution.trajectory), beside(solution.phases))
    assert not why
    # Eighth order in 96 steps, against ninth in 24 to 100 intervals.
    assert found.structure.duration == pytest.approx(solution.phases.duration, rel=1e-8)
    times = np.cumsum([arc.duration for arc in solution.phases.arcs])[:-1]
    np.testing.assert_allclose(found.structure.times, times, rtol=1e-4)
    # Its costates at the start are those of the collocation's multipliers.
    start = found.costates[0][0]
    np.testing.assert_allclose(start, solution.phases.costate[0], rtol=1e-3, atol=1e-3 * np.max(np.abs(start)))


@pytest.mark.slow
def test_the_model_is_that_of_neighbouring_motions():
    solution = random_solution(15)  # of nine arcs, so that its times are not all determined by the goal
    own = shooting(solution.problem, solution.trajectory)
    linear = landed(own, beside(solution.phases, 0.005), 16)
    assert isinstance(linear, LinearRollout)
    m = linear.structure.size
    gradient_norm = linear.tangents[:, m]
    assert len(gradient_norm) >= 1
    for by, down, hessian in zip(linear.tangents, gradient_norm, np.diag(linear.quadratic.hessian), strict=True):
        sizes = np.array([-2e-5, 2e-5])
        durations = []
        for size in sizes:
            states = linear.structure.states + linear.reach[:-1] @ (size * by)
            there = landed(own, linear.structure.moved(size * by, states), 6)
            assert isinstance(there, LinearRollout)
            durations.append(there.rollout.structure.duration)
        here = linear.structure.duration
        assert (durations[1] - durations[0]) / (2 * sizes[1]) == pytest.approx(down, rel=1e-3, abs=1e-5)
        # The second difference of durations that are known to 1e-12 s or so.
        second = (durations[1] - 2 * here + durations[0]) / sizes[1] ** 2
        assert second == pytest.approx(hessian, rel=0.05, abs=0.05 * np.max(np.abs(linear.quadratic.hessian)))


def test_a_schedule_with_too_few_changes_has_no_motion_near():
    solution = solved("rr")
    arcs = solution.phases.arcs[:2]
    found, why = fastest(
        shooting(solution.problem, solution.trajectory), SwitchingStructure.of(arcs, solution.phases.torques)
    )
    assert found is None
    assert "goal" in why


def test_it_can_be_stopped():
    solution = solved("rr")
    own = replace(shooting(solution.problem, solution.trajectory), budget=Budget(Stop(interrupted=True)))
    _, why = fastest(own, beside(solution.phases))
    assert why == "interrupted"
