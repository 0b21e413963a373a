"""From arcs of a mesh to structures: short stretches off all limits are bang arcs, long ones may be singular arcs."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.arcs.arc import Arc, Mode, stretches
from armdyn.optimal.switching.extremal.rollout import ShootingProblem
from armdyn.optimal.switching.extremal.structure import Change, Segment, SwitchingStructure, banged, shares_of
from armdyn.optimal.switching.singular import control_near, leaping_within
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_LONG = 0.05
"""Of the duration: a stretch off all limits that is shorter is read as stays alone."""
_FIRST = 1e-3
"""Of the duration: a bang arc at the start, before the first singular control."""
_SAMPLES = 100
"""Of the torques along a stretch."""


def structures_of(shooting: ShootingProblem, arcs: Sequence[Arc], motion: Trajectory) -> Iterator[SwitchingStructure]:
    """Initial structures: all torques full, then long stretches off all limits as singular arcs, if any.

    Args:
        shooting: the shooting problem.
        arcs: of a mesh.
        motion: its states and torques.
    """
    shares = shares_of(shooting.problem, arcs, motion)
    yield SwitchingStructure.of(banged(arcs, shares), motion)
    left = _long_stretches(arcs)
    if np.any(left):
        yield _with_controls(shooting, SwitchingStructure.of(banged(arcs, shares, left), motion), motion)


def _long_stretches(arcs: Sequence[Arc]) -> NDArray[np.bool_]:
    """Which joints are in which arcs on a long stretch off all limits, shape (arcs, nv)."""
    free = np.array([[mode is Mode.FREE for mode in arc.modes] for arc in arcs])
    lengths = np.array([arc.duration for arc in arcs])
    for i in range(free.shape[1]):
        for run in stretches(np.flatnonzero(free[:, i])):
            free[run, i] = lengths[run].sum() > _LONG * lengths.sum()
    return free


def _with_controls(shooting: ShootingProblem, structure: SwitchingStructure, motion: Trajectory) -> SwitchingStructure:
    """The structure with singular controls for its free torques, each begun by a change."""
    starting = [i for i, mode in enumerate(structure.first) if mode is Mode.FREE]
    if starting:
        begin = _FIRST * structure.duration
        at = motion(np.array([begin * motion.duration / structure.duration]))
        first = [_nearest(shooting, i, at.tau[0]) if i in starting else mode for i, mode in enumerate(structure.first)]
        state = np.concatenate([at.q[0], at.v[0]])
        structure = replace(structure, first=tuple(first))
        structure = structure.with_changes((begin, Change(i, Mode.FREE), state) for i in starting)
    changes = list(structure.changes)
    for k, change in enumerate(changes):
        if change.mode is not Mode.FREE:
            continue
        begin, end = structure.span(Segment(k, structure.end_of(k)))
        t = np.linspace(begin, end, _SAMPLES + 2)[1:-1] * (motion.duration / structure.duration)
        leaping = leaping_within(structure, change.joint, begin, end)
        changes[k] = replace(change, control=control_near(shooting, change.joint, motion(t).tau, leaping))
    return replace(structure, changes=tuple(changes))


def _nearest(shooting: ShootingProblem, joint: int, tau: Array) -> Mode:
    """The limit that a joint's torque is nearer to."""
    limits = shooting.problem.limits
    return Mode.UPPER if tau[joint] > limits.actuators.center[joint] else Mode.LOWER
