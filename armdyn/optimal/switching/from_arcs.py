"""Switching structures from a mesh's arcs: short stretches off all limits are bang arcs, long ones may be singular."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.optimal.arcs.arc import BANG, OPPOSITE, Arc, Mode, merged, runs_of
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.switching.extremal.change import Change, Segment
from armdyn.optimal.switching.extremal.rollout import ShootingProblem
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.signs import control_near, jumping_within
from armdyn.trajectory import Trajectory


def structures_of(
    shooting: ShootingProblem, arcs: Sequence[Arc], motion: Trajectory, sure: bool = False
) -> Iterator[SwitchingStructure]:
    """Initial structures: all arcs bang arcs; then, if any, long stretches off all limits as singular arcs.

    Args:
        shooting: the shooting problem.
        arcs: arcs of a mesh.
        motion: motion with states and torques.
        sure: whether all stretches off all limits are surely singular arcs: only that structure is tried.
    """
    numbers = shooting.policy.singular
    shares = shares_of(shooting.problem, arcs, motion, numbers.in_arc)
    left = _long_stretches(arcs, numbers.long)
    if not (sure and np.any(left)):
        yield SwitchingStructure.of(banged(arcs, shares), motion)
    if np.any(left):
        yield _with_controls(shooting, SwitchingStructure.of(banged(arcs, shares, left), motion), motion)


def _long_stretches(arcs: Sequence[Arc], long: float) -> Flags:
    """Whether each joint is, in each arc, in a stretch off all limits of at least a part of all, shape (arcs, nv)."""
    free = np.array([[mode is Mode.FREE for mode in arc.modes] for arc in arcs])
    lengths = np.array([arc.duration for arc in arcs])
    for i in range(free.shape[1]):
        for run in runs_of(np.flatnonzero(free[:, i])):
            free[run, i] = lengths[run].sum() > long * lengths.sum()
    return free


def _with_controls(shooting: ShootingProblem, structure: SwitchingStructure, motion: Trajectory) -> SwitchingStructure:
    """The structure with singular controls for its free torques, each starting at a change."""
    numbers = shooting.policy.singular
    starting = [i for i, mode in enumerate(structure.first) if mode is Mode.FREE]
    if starting:
        begin = numbers.first * structure.duration
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
        t = np.linspace(begin, end, numbers.along + 2)[1:-1] * (motion.duration / structure.duration)
        jumping = jumping_within(structure, change.joint, begin, end)
        control = control_near(shooting, change.joint, motion(t).tau, jumping, numbers.few)
        changes[k] = replace(change, control=control)
    return replace(structure, changes=tuple(changes))


def _nearest(shooting: ShootingProblem, joint: int, tau: Array) -> Mode:
    """The torque limit nearest to a joint's torque."""
    limits = shooting.problem.limits
    return Mode.UPPER if 2 * tau[joint] > limits.actuators.upper[joint] + limits.actuators.lower[joint] else Mode.LOWER


def banged(arcs: Sequence[Arc], shares: Array, left: Flags | None = None) -> list[Arc]:
    """Replace free torques by bang arcs of the same mean.

    Args:
        arcs: arcs, possibly with joints on no limit.
        shares: mean height of a joint's torque above its lower limit in an arc, over its range, shape (arcs, nv).
        left: whether a torque stays free, likewise; None: no torque.
    """
    out: list[Arc] = []
    for k, arc in enumerate(arcs):
        cuts: list[tuple[float, int, Mode]] = []
        modes = list(arc.modes)
        for i, mode in enumerate(arc.modes):
            if mode is not Mode.FREE or (left is not None and left[k, i]):
                continue
            before = out[-1].modes[i] if out else None
            after = arcs[k + 1].modes[i] if k + 1 < len(arcs) else None
            modes[i], more = _pieces(before, after, float(shares[k, i]))
            cuts += [(part, i, piece) for part, piece in more]
        cuts.sort(key=lambda cut: cut[0])
        ends = [part for part, _, _ in cuts] + [1.0]
        begin = 0.0
        for end, cut in zip(ends, [*cuts, None], strict=True):
            if end > begin:
                out.append(Arc((end - begin) * arc.duration, tuple(modes)))
            if cut is not None:
                modes[cut[1]] = cut[2]
            begin = end
        out[-1] = replace(out[-1], touches=arc.touches)
    return merged(out)


def shares_of(problem: MinimumTimeProblem, arcs: Sequence[Arc], motion: Trajectory, samples: int) -> Array:
    """Mean torque of each arc as a fraction of its range above the lower limit, shape (arcs, nv)."""
    limits = problem.limits
    edges = np.cumsum([0.0, *(arc.duration for arc in arcs)])
    edges *= motion.duration / edges[-1]
    means = np.array([np.mean(motion(np.linspace(a, b, samples)).tau, axis=0) for a, b in pairwise(edges)])
    ranges = limits.actuators.width
    return np.asarray((means - limits.actuators.lower) / np.where(ranges > 0, ranges, 1.0))


def _pieces(before: Mode | None, after: Mode | None, share: float) -> tuple[Mode, list[tuple[float, Mode]]]:
    """Bang arcs in place of a free stretch: the first mode, and the later ones with their relative times."""
    share = min(max(share, 0.02), 0.98)
    first = before if before in BANG else OPPOSITE.get(after, Mode.UPPER) if after is not None else Mode.UPPER
    own = share if first is Mode.UPPER else 1 - share
    other = OPPOSITE[first]
    if after is first:  # to the other limit and back
        return first, [(own / 2, other), (1 - own / 2, first)]
    return first, [(own, other)]
