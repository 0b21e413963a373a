"""What an extremal lacks to be Pontryagin's: torques on the wrong limit, limits overlooked, touches not wanted."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.arcs.arc import BANG, OPPOSITE, POSITION, VELOCITY, Mode, outward, stretches
from armdyn.optimal.switching.extremal.change import Change
from armdyn.optimal.switching.extremal.descent import Extremal
from armdyn.optimal.switching.extremal.limits import state_at
from armdyn.optimal.switching.extremal.schedule import Schedule

Array = NDArray[np.float64]

_MET = 1e-7
"""Of the duration: a joint that is on a limit of velocity for less touches it."""
_WORSE = 0.05
"""Of the worst: stretches that fall short of that wait for another round."""


@dataclass(frozen=True)
class Wrong:
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


def wrong_signs(extremal: Extremal, least: float) -> list[Wrong]:
    """Stretches on which the switching functions ask for the other limit, the worst first.

    Args:
        extremal: its costates and switching functions.
        least: by how much H must fall for that.
    """
    march, limits = extremal.march, extremal.march.setting.problem.limits
    modes, t = _torque_modes(extremal.schedule), np.repeat(march.times, 2)[1:-1]
    found, carriers = list[Wrong](), extremal.schedule.carriers()
    for i in range(len(extremal.schedule.first)):
        own = [modes[a][i] for a in march.arc]
        sign = np.array([0.0 if mode not in BANG else 1.0 if mode is Mode.UPPER else -1.0 for mode in own])
        range_ = limits.actuators.width[i]
        fall = np.column_stack(np.split(extremal.switching[:, i], 2)) * sign[:, None] * range_
        fall = fall.ravel()
        for run in stretches(np.flatnonzero(fall > 0.05 * least)):
            if np.max(fall[run]) > least:
                worst = int(run[np.argmax(fall[run])])
                begin, end = t[max(run[0] - 1, 0)], t[min(run[-1] + 1, t.size - 1)]
                carried = i in carriers[march.arc[worst // 2]]
                mode = own[worst // 2]
                found.append(Wrong(float(fall[worst]), i, mode, float(begin), float(end), float(t[worst]), carried))
    return sorted(found, key=lambda wrong: -wrong.value)


def _torque_modes(schedule: Schedule) -> list[list[Mode]]:
    """Modes between the changes; of a joint that another one holds, the torque limit that it is on."""
    out = [list(modes) for modes in schedule.modes()]
    for modes, carriers in zip(out, schedule.carriers(), strict=True):
        for joint, carrier in carriers.items():
            modes[joint], modes[carrier.joint] = carrier.press, Mode.FREE
    return out


def with_signs(extremal: Extremal, wrong: list[Wrong], schedule: Schedule | None = None) -> Schedule:
    """A schedule with a short stay on the other limit where it is asked for.

    Args:
        extremal: what lacks it.
        wrong: the worst first.
        schedule: the extremal's with other things mended; None: its own.
    """
    more: list[tuple[float, Change, Array]] = []
    for one in wrong:
        if one.value < _WORSE * wrong[0].value:
            break
        if one.carried:  # it is on its limit of position, and another joint's torque answers for it
            continue
        half = (one.end - one.begin) / 8
        middle = min(max(one.worst, one.begin + half), one.end - half)
        for time, mode in ((middle - half, OPPOSITE[one.mode]), (middle + half, one.mode)):
            more.append((time, Change(one.joint, mode), state_at(extremal.march, time)))
    return (schedule or extremal.schedule).with_changes(more)


def without_unwanted(extremal: Extremal) -> Schedule | None:
    """The schedule without touches that the motion would rather not make; None: it wants them all.

    A limit of velocity that is met for no time at all is touched, too.
    """
    if (slow := _without_idle_speeds(extremal)) is not None:
        return slow
    size = extremal.march.start.shape[1]
    gone: set[int] = set()
    for (k, j, _), multiplier in zip(extremal.march.held_states, extremal.multipliers[size:], strict=False):
        change = extremal.schedule.changes[k]
        if change.touch and change.mode in POSITION and j < size // 2 and outward(change.mode) * multiplier < 0:
            gone.add(k)
    return extremal.schedule.without_changes(gone) if gone else None


def _without_idle_speeds(extremal: Extremal) -> Schedule | None:
    """The schedule without stays of no length on limits of velocity that do not hold the motion back; None: all do."""
    schedule, size = extremal.schedule, extremal.march.start.shape[1]
    pulls = {
        k: outward(schedule.changes[k].mode) * multiplier
        for (k, _, _), multiplier in zip(extremal.march.held_states, extremal.multipliers[size:], strict=False)
        if schedule.changes[k].mode in VELOCITY
    }
    short = _MET * schedule.duration
    gone = []
    for segment in schedule.segments():
        begin, end = schedule.span(segment)
        if segment.begin in pulls and end - begin <= short and pulls[segment.begin] <= 0:
            gone.append(segment)
    return schedule.without(gone) if gone else None
