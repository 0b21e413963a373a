"""Singular arcs: where they are inserted, how they are split, and how they are read from a mesh."""

from itertools import pairwise

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.arcs.arc import Arc, Mode
from armdyn.optimal.switching.extremal.descent import fastest, landed
from armdyn.optimal.switching.from_arcs import structures_of
from armdyn.optimal.switching.refinement import refine_extremal, shooting_problem
from armdyn.optimal.switching.signs import control_near, idle_fall, with_bang_arcs, with_longer_control
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.task import Task
from problems import both_sides, paper_problem, random_problem, solved

U, L, F = Mode.UPPER, Mode.LOWER, Mode.FREE


def shooting(problem, motion):
    return shooting_problem(Task.of(problem, MinimumTimeOptions(compile=False)), motion)


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


def test_a_free_torque_that_saturates_gets_a_bang_arc():
    # RR's optimum is bang-bang: a torque called free goes to its former limit, and the arc is restored.
    solution = solved("rr")
    own = shooting(solution.problem, solution.trajectory)
    full, free = structures_of(own, freed(solution), solution.phases.torques)
    assert not full.controls
    assert len(free.controls) == 1
    found, why = fastest(own, free)
    assert not why
    (k,) = found.structure.controls
    assert with_bang_arcs(found, 5e-5) is not None or idle_fall(found, k) <= 5e-5
    end = refine_extremal(own, free)
    assert end.why == ""
    assert end.extremal.structure.duration == pytest.approx(solution.duration, rel=1e-7)


def test_short_stretches_off_all_limits_are_full_torques():
    solution = solved("rr")
    own = shooting(solution.problem, solution.trajectory)
    (only,) = structures_of(own, freed(solution, 0.3, 0.33), solution.phases.torques)
    assert not only.controls


def test_a_singular_control_at_the_start_begins_after_a_stay():
    solution = solved("rr")
    own = shooting(solution.problem, solution.trajectory)
    _, free = structures_of(own, freed(solution, 0.0, 0.3), solution.phases.torques)
    assert F not in free.first
    (k,) = free.controls
    assert free.times[k] == pytest.approx(1e-3 * free.duration)


def test_a_singular_control_contains_the_jump_of_another_torque():
    own = shooting(paper_problem("rr"), ad.Trajectory.at_rest(np.zeros(2), np.zeros(2), 0.2))
    s = np.linspace(0, 1, 102)[1:-1]
    tau = np.column_stack([np.where(s < 0.4, 3.0, -3.0), 1 + s**2 - 0.5 * np.sign(s - 0.4)])
    control = control_near(own, 1, tau, frozenset({0}), 3)
    assert [joint for joint, _ in control.jumps] == [0]
    signs = np.column_stack([np.sign(tau[:, 0]), np.zeros(s.size)])
    np.testing.assert_allclose(own.torque_unit[1] * control.terms(s, signs)[0] @ control.values, tau[:, 1], atol=1e-9)


def test_a_singular_control_keeps_within_its_limits():
    own = shooting(paper_problem("rr"), ad.Trajectory.at_rest(np.zeros(2), np.zeros(2), 0.2))
    tau = np.column_stack([np.zeros(50), np.full(50, 3.0)])
    control = control_near(own, 1, tau, frozenset(), 3)
    np.testing.assert_allclose(own.torque_unit[1] * control.values, [0.95 * 3.0, 0, 0], atol=1e-9)


def test_a_singular_control_grows_while_its_switching_function_is_not_zero():
    solution = solved("rr")
    own = shooting(solution.problem, solution.trajectory)
    _, free = structures_of(own, freed(solution), solution.phases.torques)
    found = landed(own, free)  # any motion has costates, if none that are wanted
    (k,) = found.structure.controls
    fall = idle_fall(found, k)
    assert fall > 1e-4
    longer = with_longer_control(found, 0.5 * fall)
    assert len(longer.controls[k].smooth) == len(found.structure.controls[k].smooth) + 2
    assert with_longer_control(found, 2 * fall) is None


MODES = {"+": U, "-": L, "0": F}
LEVELS = {"+": 1.0, "-": -1.0, "0": 0.0}


def key(problem, text):
    """Arcs such as "+0-:5.1", with durations [ms], and their motion when free torques are zero."""
    pieces = [piece.split(":") for piece in text.split()]
    arcs = [Arc(float(length) / 1e3, tuple(MODES[sign] for sign in signs)) for signs, length in pieces]
    ends = np.cumsum([0.0, *(arc.duration for arc in arcs)])
    level = np.repeat([[LEVELS[sign] for sign in signs] for signs, _ in pieces], 2, axis=0)
    rest = np.zeros_like(level)
    torques = problem.limits.effort_upper * level
    given = ad.Trajectory(both_sides(ends), rest + problem.q_start, rest, torques, problem.robot.joint_names, "given")
    return arcs, ad.replay_torques(problem.robot, given)


def settled_from(problem, text):
    """Result of arcs with free torques, as `key` reads them."""
    arcs, motion = key(problem, text)
    own = shooting(problem, motion)
    *_, free = structures_of(own, arcs, motion)
    return refine_extremal(own, free)


@pytest.mark.slow
def test_a_singular_control_that_meets_a_limit_on_its_way_settles():
    # Planes that were only ever added stopped the descent where the singular control came to its upper limit.
    problem = random_problem(0, position_limit=(-np.inf, np.inf))
    end = settled_from(
        problem,
        "--+:3.34 +-+:0.74 --+:37.51 ---:0.59 --+:27.11 ---:5.68 -+-:37.72 ++-:30.0 +--:17.09 +-+:35.41 +++:15.59 "
        "+0+:56.12 +++:3.3",
    )
    assert end.why == ""
    assert [change.mode for change in end.extremal.structure.changes].count(F) == 1
    # Descent, replay and certificate agree to 1e-8; no oracle of the best.
    assert end.extremal.structure.duration == pytest.approx(0.270189425, rel=1e-7)


@pytest.mark.slow
def test_a_singular_torque_jumps_where_another_joint_switches():
    problem = random_problem(27)
    end = settled_from(
        problem,
        "+-+:27.47 +--:37.31 ++-:31.31 -+-:7.58 ---:13.04 -+-:12.5 ---:32.01 +--:12.8 ---:6.16 +--:41.91 +0-:8.77 "
        "-0-:15.81 -+-:10.76",
    )
    assert end.why == ""
    assert end.extremal.structure.duration == pytest.approx(0.257435630, rel=1e-7)
    rollout = end.extremal.rollout
    modes = rollout.structure.modes()
    k = next(k for k, (a, b) in enumerate(pairwise(modes)) if a[1] is F and b[1] is F)
    assert modes[k][0] is not modes[k + 1][0]
    before, after = rollout.torques.tau[1][rollout.last[k], 1], rollout.torques.tau[0][rollout.last[k] + 1, 1]
    assert abs(after - before) > 0.1  # of a range of 6 N m
