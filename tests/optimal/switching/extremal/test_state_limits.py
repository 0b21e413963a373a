"""Limits of position and velocity in the descent: a state that exceeds them touches them, or is held on them."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.arcs.arc import Arc, Mode
from armdyn.optimal.switching.extremal.change import Change
from armdyn.optimal.switching.extremal.descent import fastest
from armdyn.optimal.switching.extremal.rollout import Rollout
from armdyn.optimal.switching.extremal.state_limits import excess, state_at, with_limits, within_limits
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.refinement import shooting_problem
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.task import Task
from problems import cart, paper_arm, random_problem

U, L = Mode.UPPER, Mode.LOWER


def test_a_motion_that_goes_too_far_is_reported_with_its_place():
    # 1 kg, 1 N, from rest at 0: accelerates for 1 s, brakes for 2 s, and turns round at 1 m, after 2 s.
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[0.5], position_limit=(-1.0, 0.9))
    t = np.linspace(0, 3, 31)
    q = np.where(t < 1, t**2 / 2, 0.5 + (t - 1) - (t - 1) ** 2 / 2)
    v = np.where(t < 1, t, 2 - t)
    tau = np.where(t < 1, 1.0, -1.0)
    guess = ad.Trajectory(t, q[:, None], v[:, None], tau[:, None])
    shooting = shooting_problem(Task.of(problem, MinimumTimeOptions(compile=False)), guess)
    rollout = Rollout.of(shooting, SwitchingStructure.of([Arc(1.0, (U,)), Arc(2.0, (L,))], guess))
    assert excess(rollout) == pytest.approx(0.1, abs=1e-3)  # at the ends of steps, of which there are 96
    touching = with_limits(rollout)
    assert touching is not None
    touch = next(k for k, change in enumerate(touching.changes) if change.touch)
    assert touching.changes[touch].mode is Mode.POSITION_UPPER
    assert touching.times[touch] == pytest.approx(2.0, abs=0.04)
    np.testing.assert_allclose(touching.states[touch], [0.9, 0.0])
    # Between steps the state is that of the closed form.
    np.testing.assert_allclose(state_at(rollout, 1.77), [0.5 + 0.77 - 0.77**2 / 2, 0.23], atol=1e-9)


def test_steps_too_short_for_the_clock_are_no_part_of_the_motion():
    # Two changes an ulp apart: half of that is no later time, so that the step between is left out.
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[0.5])
    t = np.linspace(0, 3, 31)
    guess = ad.Trajectory(t, 0.1 * t[:, None], np.full((31, 1), 0.1), np.zeros((31, 1)))
    shooting = shooting_problem(Task.of(problem, MinimumTimeOptions(compile=False)), guess)
    times = np.array([1.0, np.nextafter(1.0, 2.0)])
    changes = Change(0, L), Change(0, U)
    rollout = Rollout.of(shooting, SwitchingStructure((U,), changes, times, np.zeros((2, 2)), 3.0))
    assert np.sum(rollout.h > 0) > np.sum(np.diff(rollout.times) > 0)
    assert np.all(np.diff(rollout.motion.t) > 0)


@pytest.mark.slow
def test_touches_are_found_on_the_way():
    # Two touches, of the first and the second joint: a descent that forgets limits ends 0.4 rad beyond them, from where
    # no motion with touches is near.
    problem = random_problem(5)
    solution = ad.solve_minimum_time(problem)
    assert solution.certified
    shooting = shooting_problem(Task.of(problem, MinimumTimeOptions(compile=False)), solution.trajectory)
    given = SwitchingStructure.of(solution.phases.arcs, solution.phases.torques)
    touches = [k for k, change in enumerate(given.changes) if change.touch]
    assert len(touches) == 2
    found, why = fastest(shooting, given.without_changes(touches))
    assert not why
    assert within_limits(found.rollout)
    assert sum(change.touch for change in found.structure.changes) == 2
    assert found.structure.duration == pytest.approx(solution.duration, rel=1e-7)


def test_a_velocity_limit_that_is_overlooked_is_kept():
    # Up to 0.8 m/s at 1 m/s², cruise, down: t = d/v + v/a. The bang-bang motion, of 2 √2 s, reaches √2 m/s.
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], velocity_limit=0.8)
    t = np.linspace(0, 2 * np.sqrt(2), 41)
    v = np.minimum(t, t[-1] - t)
    q = np.where(t < np.sqrt(2), t**2 / 2, 2 - (t[-1] - t) ** 2 / 2)
    guess = ad.Trajectory(t, q[:, None], v[:, None], np.sign(np.sqrt(2) - t)[:, None])
    shooting = shooting_problem(Task.of(problem, MinimumTimeOptions(compile=False)), guess)
    bang = SwitchingStructure.of([Arc(np.sqrt(2), (U,)), Arc(np.sqrt(2), (L,))], guess)
    assert excess(Rollout.of(shooting, bang)) == pytest.approx(np.sqrt(2) / 0.8 - 1, rel=1e-9)
    found, why = fastest(shooting, bang)
    assert not why
    assert [arc.modes[0] for arc in found.structure.arcs(1e-7)] == [U, Mode.VELOCITY_UPPER, L]
    assert found.structure.duration == pytest.approx(2 / 0.8 + 0.8, rel=1e-9)
    assert within_limits(found.rollout)


@pytest.mark.slow
def test_torque_that_presses_beyond_a_limit_next_to_a_contact_goes():
    ends = {"q_start": [-0.5136696604371498, 2.8241964993549318], "q_goal": [1.0571266663392307, 2.8241964993546724]}
    problem = ad.MinimumTimeProblem(paper_arm("rr", 0.1), **ends)
    solution = ad.solve_minimum_time(problem, MinimumTimeOptions(search="quick", bound=False))
    assert solution.certified
    assert solution.arcs  # the motion of a mesh, which has none, is 4e-7 slower
