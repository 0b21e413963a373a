"""Singular arcs: where they come in, what splits them, and what is read of them from a mesh."""

from itertools import pairwise

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.arcs.arc import Arc, Mode
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.switching.extremal.descent import Extremal, fastest, landed
from armdyn.optimal.switching.reading import schedules_of
from armdyn.optimal.switching.settle import setting_of, settled
from armdyn.optimal.switching.singular import course_near, idle_fall, with_longer_course, with_stays
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.task import Task
from problems import paper_problem, random_problem, solved

U, L, F = Mode.UPPER, Mode.LOWER, Mode.FREE


def setting(problem, duration):
    return setting_of(Task.of(problem, MinimumTimeOptions(compile=False)), duration)


def freed(solution, begin=0.3, end=0.5):
    """The arcs of RR's optimum, and its first joint's torque said to be free from one part of it to another."""
    given = solution.phases.arcs
    ends = np.cumsum([arc.duration for arc in given])
    cuts, out = np.unique(np.concatenate([[0.0], ends, np.array([begin, end]) * ends[-1]])), []
    for a, b in pairwise(cuts):
        modes = list(given[int(np.searchsorted(ends, (a + b) / 2))].modes)
        if begin * ends[-1] < (a + b) / 2 < end * ends[-1]:
            modes[0] = F
        out.append(Arc(b - a, tuple(modes)))
    return out


def test_a_free_torque_that_time_wants_on_its_limit_gets_a_stay_there():
    # RR's optimum is bang-bang: what is called free goes to the limit that it was on, and the stay is put back.
    solution = solved("rr")
    own = setting(solution.problem, solution.duration)
    full, free = schedules_of(own, freed(solution), solution.phases.torques)
    assert not full.courses
    assert len(free.courses) == 1
    found = fastest(own, free, Stop())
    assert isinstance(found, Extremal)
    (k,) = found.schedule.courses
    assert with_stays(found, 5e-5) is not None or idle_fall(found, k) <= 5e-5
    end = settled(own, free, Stop())
    assert end.why == ""
    assert end.extremal.schedule.duration == pytest.approx(solution.duration, rel=1e-7)


def test_short_stretches_off_all_limits_are_full_torques():
    solution = solved("rr")
    own = setting(solution.problem, solution.duration)
    (only,) = schedules_of(own, freed(solution, 0.3, 0.33), solution.phases.torques)
    assert not only.courses


def test_a_course_at_the_start_begins_after_a_stay():
    solution = solved("rr")
    own = setting(solution.problem, solution.duration)
    _, free = schedules_of(own, freed(solution, 0.0, 0.3), solution.phases.torques)
    assert F not in free.first
    (k,) = free.courses
    assert free.times[k] == pytest.approx(1e-3 * free.duration)


def test_a_course_knows_the_jump_of_another_torque():
    own = setting(paper_problem("rr"), 0.2)
    s = np.linspace(0, 1, 102)[1:-1]
    tau = np.column_stack([np.where(s < 0.4, 3.0, -3.0), 1 + s**2 - 0.5 * np.sign(s - 0.4)])
    course = course_near(own, 1, tau, frozenset({0}))
    assert [joint for joint, _ in course.leaps] == [0]
    signs = np.column_stack([np.sign(tau[:, 0]), np.zeros(s.size)])
    np.testing.assert_allclose(own.course[1] * course.terms(s, signs) @ course.values, tau[:, 1], atol=1e-9)


def test_a_course_keeps_within_its_limits():
    own = setting(paper_problem("rr"), 0.2)
    tau = np.column_stack([np.zeros(50), np.full(50, 3.0)])
    course = course_near(own, 1, tau, frozenset())
    np.testing.assert_allclose(own.course[1] * course.values, [0.95 * 3.0, 0, 0], atol=1e-9)


def test_a_course_grows_while_its_switching_function_is_not_zero():
    solution = solved("rr")
    own = setting(solution.problem, solution.duration)
    _, free = schedules_of(own, freed(solution), solution.phases.torques)
    found = Extremal(landed(own, free))  # any motion has costates, if none that are wanted
    (k,) = found.schedule.courses
    fall = idle_fall(found, k)
    assert fall > 1e-4
    longer = with_longer_course(found, 0.5 * fall)
    assert len(longer.courses[k].smooth) == len(found.schedule.courses[k].smooth) + 2
    assert with_longer_course(found, 2 * fall) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pair", "duration", "singular"),
    [
        (0, 0.270189425, True),  # a course meets a limit: planes that were only ever added stopped the descent
        (5, 0.269573462, False),  # read from the mesh, where full torques do not land; in the end all are stays
    ],
)
def test_singular_structures_settle(pair, duration, singular):
    problem = random_problem(pair, position_limit=(-np.inf, np.inf))
    solution = ad.solve_minimum_time(problem)
    assert solution.certified
    assert any(arc.singular for arc in solution.phases.arcs) is singular
    # What the descent, the replay and the certificate agree on to 1e-8; no oracle of the best.
    assert solution.duration == pytest.approx(duration, rel=1e-6)


@pytest.mark.slow
def test_a_singular_torque_jumps_where_another_joint_switches():
    solution = ad.solve_minimum_time(random_problem(27))
    assert solution.certified
    modes = [arc.modes for arc in solution.phases.arcs]
    k = next(k for k, (a, b) in enumerate(pairwise(modes)) if a[1] is F and b[1] is F)
    assert modes[k][0] is not modes[k + 1][0]
    knot = np.flatnonzero(np.diff(solution.phases.arc_of))[k]
    before, after = solution.phases.tau[knot, -1, 1], solution.phases.tau[knot + 1, 0, 1]
    assert abs(after - before) > 0.1  # of a range of 6 N m
