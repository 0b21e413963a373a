"""Times that are fastest: closed forms, what the arcs' collocation says, the model against motions beside it."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.arcs.arc import Arc, Mode
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.switching.extremal.descent import Extremal, Resisted, fastest
from armdyn.optimal.switching.extremal.landing import landed
from armdyn.optimal.switching.extremal.model import Linear, Model
from armdyn.optimal.switching.extremal.schedule import Schedule
from armdyn.optimal.switching.settle import setting_of
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.task import Task
from problems import cart, random_solution, solved

U, L = Mode.UPPER, Mode.LOWER


def setting(problem, duration):
    return setting_of(Task.of(problem, MinimumTimeOptions(compile=False)), duration)


def beside(phases, part=0.02, seed=0):
    """The schedule of an optimum whose times and states are all a little off."""
    given, random = Schedule.of(phases.arcs, phases.torques), np.random.default_rng(seed)
    times = np.sort(given.times * (1 + part * random.uniform(-1, 1, given.size)))
    states = given.states * (1 + part * random.uniform(-1, 1, given.states.shape))
    return given.moved(np.append(times - given.times, part * given.duration), states)


def test_the_double_integrator_turns_round_half_way():
    # 2 m on a level rail, 1 kg, 1 N: t_f = 2 sqrt(2) s, and half of it full speed ahead (Kirk, section 5.4).
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0])
    t = np.linspace(0, 2.5, 21)
    guess = ad.Trajectory(t, 0.8 * t[:, None], np.full((21, 1), 0.8), np.zeros((21, 1)))
    found = fastest(setting(problem, 2.5), Schedule.of([Arc(1.5, (U,)), Arc(1.0, (L,))], guess), Stop())
    assert isinstance(found, Extremal)
    assert found.schedule.duration == pytest.approx(2 * np.sqrt(2), rel=1e-10)
    assert found.schedule.times == pytest.approx([np.sqrt(2)], rel=1e-10)


@pytest.mark.parametrize("arm", ["rr", "rrr"])
def test_an_optimum_is_found_again_from_beside_it(arm):
    solution = solved(arm)
    found = fastest(setting(solution.problem, solution.duration), beside(solution.phases), Stop())
    assert isinstance(found, Extremal)
    # Eighth order in 96 steps, against ninth in 24 to 100 intervals.
    assert found.schedule.duration == pytest.approx(solution.phases.duration, rel=1e-8)
    times = np.cumsum([arc.duration for arc in solution.phases.arcs])[:-1]
    np.testing.assert_allclose(found.schedule.times, times, rtol=1e-4)
    # Its costates at the start are those of the collocation's multipliers.
    start = found.costates[0][0]
    np.testing.assert_allclose(start, solution.phases.costate[0], rtol=1e-3, atol=1e-3 * np.max(np.abs(start)))


def test_the_model_is_what_motions_beside_it_do():
    solution = random_solution(15)  # of nine arcs, so that its times are not all determined by the goal
    own = setting(solution.problem, solution.duration)
    linear = landed(own, beside(solution.phases, 0.005), 16)
    assert isinstance(linear, Linear)
    model = Model.of(linear)
    m = linear.march.schedule.size
    slope = linear.tangents[:, m]
    assert len(slope) >= 1
    for by, down, bend in zip(linear.tangents, slope, np.diag(model.parabola.bend), strict=True):
        sizes = np.array([-2e-5, 2e-5])
        durations = []
        for size in sizes:
            states = linear.march.schedule.states + linear.reach[:-1] @ (size * by)
            there = landed(own, linear.march.schedule.moved(size * by, states), 6)
            assert isinstance(there, Linear)
            durations.append(there.march.schedule.duration)
        here = linear.march.schedule.duration
        assert (durations[1] - durations[0]) / (2 * sizes[1]) == pytest.approx(down, rel=1e-3, abs=1e-5)
        # The second difference of durations that are known to 1e-12 s or so.
        second = (durations[1] - 2 * here + durations[0]) / sizes[1] ** 2
        assert second == pytest.approx(bend, rel=0.05, abs=0.05 * np.max(np.abs(model.parabola.bend)))


def test_a_schedule_with_too_few_changes_has_no_motion_near():
    solution = solved("rr")
    arcs = solution.phases.arcs[:2]
    found = fastest(setting(solution.problem, 0.3), Schedule.of(arcs, solution.phases.torques), Stop())
    assert isinstance(found, Resisted)
    assert "goal" in found.why


def test_it_can_be_stopped():
    solution = solved("rr")
    stop = Stop(interrupted=True)
    found = fastest(setting(solution.problem, solution.duration), beside(solution.phases), stop)
    assert isinstance(found, Resisted)
