"""Violations of Pontryagin's conditions: torques on the wrong limit, missed limits, contacts of the wrong sign."""

from dataclasses import dataclass

import numpy as np

from armdyn.optimal.arcs.arc import BANG, OPPOSITE, POSITION, VELOCITY, Mode, outward, stretches
from armdyn.optimal.switching.extremal.change import Change
from armdyn.optimal.switching.extremal.descent import Extremal
from armdyn.optimal.switching.extremal.state_limits import edited
from armdyn.optimal.switching.extremal.structure import SwitchingStructure


@dataclass(frozen=True)
class WrongSign:
    """A stretch on which a joint's torque is on the wrong limit.

    Attributes:
        value: by how much H would fall at worst, against the 1 that time costs.
        joint: its number.
        mode: the limit that it is on.
        begin: of the stretch [s].
        end: of it [s].
        worst: when it is worst [s].
        carried: the joint is on a limit of position that another joint's torque holds it on.
    """

    value: float
    joint: int
    mode: Mode
    begin: float
    end: float
    worst: float
    carried: bool = False


def wrong_signs(extremal: Extremal, least: float) -> list[WrongSign]:
    """Stretches on which the switching function's sign asks for the other limit, the worst first.

    Args:
        extremal: its costates and switching functions.
        least: by how much H must fall for that.
    """
    rollout, limits = extremal.rollout, extremal.shooting.problem.limits
    modes, t = _torque_modes(extremal.structure), np.repeat(rollout.times, 2)[1:-1]
    found, carriers = list[WrongSign](), extremal.structure.carriers()
    shortest = extremal.shooting.policy.descent.vanished * extremal.structure.duration
    lasting = np.bincount(rollout.arc, weights=rollout.h)[rollout.arc] > shortest  # else between changes at one time
    for i in range(len(extremal.structure.first)):
        own = [modes[a][i] for a in rollout.arc]
        sign = np.array([0.0 if mode not in BANG else 1.0 if mode is Mode.UPPER else -1.0 for mode in own])
        range_ = limits.actuators.width[i]
        fall = np.column_stack(np.split(extremal.switching[:, i], 2)) * sign[:, None] * range_
        fall = (fall * lasting[:, None]).ravel()
        for run in stretches(np.flatnonzero(fall > 0.05 * least)):
            if np.max(fall[run]) > least:
                worst = int(run[np.argmax(fall[run])])
                begin, end = t[max(run[0] - 1, 0)], t[min(run[-1] + 1, t.size - 1)]
                carried = i in carriers[rollout.arc[worst // 2]]
                mode = own[worst // 2]
                found.append(WrongSign(float(fall[worst]), i, mode, float(begin), float(end), float(t[worst]), carried))
    return sorted(found, key=lambda wrong: -wrong.value)


def worst_stretch(wrong: list[WrongSign], apart: float) -> tuple[float, float]:
    """Begin and end [s] of the worst stretch, with those of its joint that are no farther from it than a time [s]."""
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
    """Structure with a short bang arc on the other limit where the switching function asks for it.

    Args:
        extremal: what lacks it.
        wrong: the worst first.
        structure: the extremal's with other things mended; None: its own.
    """
    more: list[tuple[float, Change]] = []
    for one in wrong:
        if one.value < extremal.shooting.policy.switching.worse * wrong[0].value:
            break
        if one.carried:  # it is on its limit of position, and another joint's torque answers for it
            continue
        half = (one.end - one.begin) / 8
        middle = min(max(one.worst, one.begin + half), one.end - half)
        for time, mode in ((middle - half, OPPOSITE[one.mode]), (middle + half, one.mode)):
            more.append((time, Change(one.joint, mode)))
    return edited(extremal.rollout, structure or extremal.structure, [], more)


def without_unwanted(extremal: Extremal) -> SwitchingStructure | None:
    """Structure without touches whose multiplier has the wrong sign; None if all are right.

    A limit of velocity that is met for no time at all is touched, too.
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
    short = extremal.shooting.policy.rollout.met * structure.duration
    gone = []
    for segment in structure.segments():
        begin, end = structure.span(segment)
        if segment.begin in state_multipliers and end - begin <= short and state_multipliers[segment.begin] <= 0:
            gone.append(segment)
    return structure.without(gone) if gone else None
