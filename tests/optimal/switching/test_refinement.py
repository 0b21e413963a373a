"""Refined structures: missing switches are inserted, chattering torques become singular, limits are met."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.arcs.arc import Mode
from armdyn.optimal.problem.status import Budget, Stop
from armdyn.optimal.switching.costates import phases_of
from armdyn.optimal.switching.extremal.change import Segment
from armdyn.optimal.switching.extremal.descent import in_one_piece
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.refinement import refine_extremal, shooting_problem
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.task import Task
from problems import random_problem, random_solution, solved


@pytest.mark.slow
def test_changes_that_are_missing_are_put_in():
    solution = random_solution(15)
    given = SwitchingStructure.of(solution.phases.arcs, solution.phases.torques)
    own = shooting_problem(Task.of(solution.problem, MinimumTimeOptions(compile=False)), solution.trajectory)
    # The short bang arc of the third joint on its upper limit near the end: 2.5 ms of 240 ms.
    edges = np.append(given.times, given.duration)
    lengths = {(s.begin, s.end): edges[s.end] - edges[s.begin] for s in given.segments() if s.begin >= 0}
    begin, end = min((pair for pair in lengths if pair[1] < given.size), key=lambda pair: lengths[pair])
    lacking = given.without([Segment(begin, end)])
    assert lacking.size == given.size - 2
    found = refine_extremal(own, lacking)
    assert found.why == ""
    assert [arc.modes for arc in found.extremal.structure.arcs(1e-7)] == [arc.modes for arc in solution.phases.arcs]
    assert found.extremal.structure.duration == pytest.approx(solution.phases.duration, rel=1e-7)


@pytest.mark.slow
def test_a_singular_arc_is_found_and_certified():
    # Without it the structure did not settle: changes were put in and went to nothing, on and on.
    problem = random_problem(35, position_limit=(-np.inf, np.inf))
    solution = ad.solve_minimum_time(problem)
    assert solution.certified
    assert any(arc.singular for arc in solution.phases.arcs)
    # The best that any search has found, which descent, replay and certificate agree on; no oracle of the best.
    assert solution.duration == pytest.approx(0.26497054, rel=1e-6)
    # On the singular arc the switching function is zero, on all others its sign is that of the limit.
    for k, a in enumerate(solution.phases.arc_of):
        for i, mode in enumerate(solution.phases.arcs[a].modes):
            if mode is Mode.FREE and k > 0 and solution.phases.arc_of[k - 1] == a:
                assert abs(solution.certificate.switching[k, i]) * 6.0 <= 1e-4


def test_a_motion_has_the_states_of_its_steps():
    solution = solved("rr")
    given = SwitchingStructure.of(solution.phases.arcs, solution.phases.torques)
    own = shooting_problem(Task.of(solution.problem, MinimumTimeOptions(compile=False)), solution.trajectory)
    found = refine_extremal(own, given)
    assert found.why == ""
    assert found.wrong <= 1e-4
    motion = phases_of(in_one_piece(found.extremal)).torques
    replay = ad.replay_torques(solution.problem.robot, motion)
    # Steps of eighth order against the replay's integrator, whose tolerance is 1e-10.
    np.testing.assert_allclose(replay.q[-1], solution.problem.q_goal, atol=1e-8)
    np.testing.assert_allclose(motion.q[-1], solution.problem.q_goal, atol=1e-8)


def test_refinement_stops_when_its_budget_is_spent():
    solution = solved("rrr")
    task = Task.of(solution.problem, MinimumTimeOptions(compile=False))
    budget = Budget(Stop(), 50)
    own = replace(shooting_problem(task, solution.trajectory), budget=budget)
    given = SwitchingStructure.of(solution.phases.arcs, solution.phases.torques)
    apart = replace(given, times=given.times * 0.98)  # it lands off the optimum, and has to descend
    found = refine_extremal(own, apart)
    assert found.why == "the budget of integrator steps is spent"
    assert -50 * own.steps < budget.left <= 0  # the landing that was begun has ended
    assert refine_extremal(replace(own, budget=Budget(Stop())), apart).why == ""
