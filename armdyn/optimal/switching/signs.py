"""Violations of Pontryagin's conditions: torques on the wrong limit, missed limits, contacts of the wrong sign."""

from dataclasses import dataclass

import numpy as np

from armdyn.optimal.arcs.arc import BANG, OPPOSITE, POSITION, VELOCITY, Mode, outward, runs_of
from armdyn.optimal.switching.extremal.change import Change
from armdyn.optimal.switching.extremal.descent import Extremal
from armdyn.optimal.switching.extremal.state_limits import edited
from armdyn.optimal.switching.extremal.structure import SwitchingStructure


@dataclass(frozen=True)
class WrongSign:
    """Stretch with a joint's torque on the wrong limit.

    Attributes:
        value: largest decrease of H on the other limit, relative to time's 1.
        joint: index of the joint.
        mode: the present limit.
        begin: start of the stretch [s].
        end: end of the stretch [s].
        worst: time of the largest decrease [s].
        carried: whether another joint's torque holds the joint on a position limit.
    """

    value: float
    joint: int
    mode: Mode
    begin: float
    end: float
    worst: float
    carried: bool = False


def wrong_signs(extremal: Extremal, least: float) -> list[WrongSign]:
    """Stretches on which the switching function has the sign of the other limit, worst first.

    Args:
        extremal: extremal with costates and switching functions.
        least: least decrease of H.
    """
    rollout, limits = extremal.rollout, extremal.shooting.problem.limits
    modes, t = _torque_modes(extremal.structure), np.repeat(rollout.times, 2)[1:-1]
    found, carriers = list[WrongSign](), extremal.structure.carriers()
    shortest = extremal.shooting.policy.descent.vanished * extremal.structure.duration
    lasting = np.bincount(rollout.arc, weights=rollout.h)[rollout.arc] > shortest  # not between simultaneous changes
    for i in range(len(extremal.structure.first)):
        own = [modes[a][i] for a in rollout.arc]
        sign = np.array([0.0 if mode not in BANG else 1.0 if mode is Mode.UPPER else -1.0 for mode in own])
        range_ = limits.actuators.width[i]
        fall = np.column_stack(np.split(extremal.switching[:, i], 2)) * sign[:, None] * range_
        fall = (fall * lasting[:, None]).ravel()
        for run in runs_of(np.flatnonzero(fall > 0.05 * least)):
            if np.max(fall[run]) > least:
                worst = int(run[np.argmax(fall[run])])
                begin, end = t[max(run[0] - 1, 0)], t[min(run[-1] + 1, t.size - 1)]
                carried = i in carriers[rollout.arc[worst // 2]]
                mode = own[worst // 2]
                found.append(WrongSign(float(fall[worst]), i, mode, float(begin), float(end), float(t[worst]), carried))
    return sorted(found, key=lambda wrong: -wrong.value)


def worst_interval(wrong: list[WrongSign], apart: float) -> tuple[float, float]:
    """Start and end [s] of the worst interval, merged with its joint's intervals within a time [s] of it."""
    own, begin, end = [one for one in wrong if one.joint == wrong[0].joint], wrong[0].begin, wrong[0].end
    for _ in own:
        near = [one for one in own if one.begin <= end + apart and one.end >= begin - apart]
        begin, end = min(begin, *(one.begin for one in near)), max(end, *(one.end for one in near))
    return begin, end


def _torque_modes(structure: SwitchingStructure) -> list[list[Mode]]:
    """Modes of the torques on each arc: the torque of a held joint is on a limit, that of its carrier is free."""
    out = [list(modes) for modes in structure.modes()]
    for modes, carriers in zip(out, structure.carriers(), strict=True):
        for joint, carrier in carriers.items():
            modes[joint], modes[carrier.joint] = carrier.press, Mode.FREE
    return out


def with_signs(
    extremal: Extremal, wrong: list[WrongSign], structure: SwitchingStructure | None = None
) -> SwitchingStructure:
    """Structure with a short bang arc on the other limit where the switching function has the wrong sign.

    Args:
        extremal: extremal with the wrong signs.
        wrong: stretches on the wrong limit, worst first.
        structure: the extremal's structure with other corrections; None: without.
    """
    more: list[tuple[float, Change]] = []
    for one in wrong:
        if one.value < extremal.shooting.policy.switching.worse * wrong[0].value:
            break
        if one.carried:  # on its position limit, carried by another joint's torque
            continue
        half = (one.end - one.begin) / 8
        middle = min(max(one.worst, one.begin + half), one.end - half)
        for time, mode in ((middle - half, OPPOSITE[one.mode]), (middle + half, one.mode)):
            more.append((time, Change(one.joint, mode)))
    return edited(extremal.rollout, structure or extremal.structure, [], more)


def without_wrong_touches(extremal: Extremal) -> SwitchingStructure | None:
    """Structure without touches whose multiplier has the wrong sign; None if all are right.

    A velocity limit that is active for zero time counts as a touch.
    """
    if (slow := _without_idle_speeds(extremal)) is not None:
        return slow
    size = extremal.rollout.start.shape[1]
    gone: set[int] = set()
    for (k, j, _), multiplier in zip(extremal.rollout.held_states, extremal.multipliers[size:], strict=False):
        change = extremal.structure.changes[k]
        if change.touch and change.mode in POSITION and j < size // 2 and outward(change.mode) * multiplier < 0:
            gone.add(k)
    return extremal.structure.without_changes(gone) if gone else None


def _without_idle_speeds(extremal: Extremal) -> SwitchingStructure | None:
    """Structure without empty segments on velocity limits whose multiplier is wrong; None if none are."""
    structure, size = extremal.structure, extremal.rollout.start.shape[1]
    state_multipliers = {
        k: outward(structure.changes[k].mode) * multiplier
        for (k, _, _), multiplier in zip(extremal.rollout.held_states, extremal.multipliers[size:], strict=False)
        if structure.changes[k].mode in VELOCITY
    }
    short = extremal.shooting.policy.rollout.touch * structure.duration
    gone = []
    for segment in structure.segments():
        begin, end = structure.span(segment)
        if segment.begin in state_multipliers and end - begin <= short and state_multipliers[segment.begin] <= 0:
            gone.append(segment)
    return structure.without(gone) if gone else None
