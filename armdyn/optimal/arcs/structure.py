"""Corrections of a structure by the multipliers of its solution: missing contacts, idle touches, vanished arcs."""

from dataclasses import replace

import numpy as np

from armdyn.optimal.arcs.arc import (
    POSITION,
    VELOCITY,
    Arc,
    Event,
    Mode,
    arcs_between,
    merged,
    outward,
    runs_of,
    without_short,
)
from armdyn.optimal.arcs.phases import TABLEAU, Phases
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.policy.refinement import ArcsPolicy


def with_overlooked(problem: MinimumTimeProblem, phases: Phases, numbers: ArcsPolicy) -> list[Arc]:
    """Structure with arcs for missing active limits of velocity and position; empty if none is missing."""
    limits, K = problem.limits, phases.arc_of.size
    modes = np.array([phases.arcs[a].modes for a in phases.arc_of], dtype=object)
    named = np.isin(modes, (*VELOCITY, *POSITION))
    ends = np.concatenate([phases.knot_multiplier, np.zeros((1, *phases.knot_multiplier.shape[1:]))])
    ends[:-1] *= ~(named[:-1] | named[1:])[:, None]
    touches = np.flatnonzero(np.diff(phases.arc_of))  # last intervals of arcs
    met = np.zeros(named.shape, dtype=bool)
    for k, arc in zip(touches, phases.arcs, strict=False):
        for i, _ in arc.touches:
            ends[k, :, i] = 0.0
            met[k : k + 2, i] = True
    multipliers = np.concatenate([phases.state_multiplier, ends[:, None]], axis=1)  # (K, stages, 2, nv)
    times = phases.t[:-1, None] + np.diff(phases.t)[:, None] * TABLEAU.c
    touched: list[Event] = []
    found = False
    for row, size, upper, lower in (
        (0, np.ones(modes.shape[1]), Mode.POSITION_UPPER, Mode.POSITION_LOWER),
        (1, np.where(np.isinf(limits.velocity), 0.0, limits.velocity), Mode.VELOCITY_UPPER, Mode.VELOCITY_LOWER),
    ):
        for sign, mode in ((-1, upper), (1, lower)):
            held = (np.max(sign * multipliers[:, :, row], axis=1) * size > numbers.held * phases.duration) & ~named
            found = found or bool(np.any(held))
            for i in range(held.shape[1]):
                for run in runs_of(np.flatnonzero(held[:, i])):
                    if row == 0 and run.size <= numbers.touch and not np.any(met[run, i]):
                        weight = np.maximum(sign * multipliers[run, :, row, i], 0)
                        touched.append(Event(float(np.average(times[run], weights=weight)), i, mode, touch=True))
                    else:
                        modes[run, i] = mode
    if not found:
        return []
    events = [
        Event(float(phases.t[k]), i, modes[k, i])
        for i in range(modes.shape[1])
        for k in range(1, K)
        if modes[k, i] is not modes[k - 1, i]
    ]
    return arcs_between(list(modes[0]), [*events, *touched, *_touches(phases)], phases.duration)


def without_vanished(phases: Phases, numbers: ArcsPolicy) -> list[Arc]:
    """Structure without an arc whose duration has become zero; empty if there is no such arc."""
    shortest = numbers.shortest * phases.duration
    if len(phases.arcs) == 1 or min(arc.duration for arc in phases.arcs) >= shortest:
        return []
    return without_short(phases.arcs, shortest)


def without_idle_touches(phases: Phases) -> list[Arc]:
    """Structure without touches whose multiplier has the wrong sign; empty if there are no such touches."""
    arcs, last = list(phases.arcs), np.flatnonzero(np.diff(phases.arc_of))
    for a, k in enumerate(last):
        required = tuple(
            (i, mode)
            for i, mode in arcs[a].touches
            if outward(mode) * phases.knot_multiplier[k, int(mode in VELOCITY), i] < 0
        )
        arcs[a] = replace(arcs[a], touches=required)
    return [] if tuple(arcs) == phases.arcs else merged(arcs)


def _touches(phases: Phases) -> list[Event]:
    ends = np.cumsum([arc.duration for arc in phases.arcs])
    return [
        Event(float(t), i, mode, touch=True)
        for t, arc in zip(ends, phases.arcs, strict=True)
        for i, mode in arc.touches
    ]
