"""Chattering as the singular arc that it stands for."""

from itertools import pairwise

from armdyn.optimal.arcs.arc import BANG, Arc, Event, Mode, arcs_between
from armdyn.optimal.switching.schedule import Schedule

_SHORT = 0.06
"""Of the duration: stays on one limit that are shorter, one after the other, chatter."""
_MANY = 3
"""Such stays make a singular arc."""


def singular_arcs(schedule: Schedule) -> list[Arc]:
    """The structure with a free torque where one chatters between its limits; none: none does.

    Args:
        schedule: what chattering has been put into, see `signs.with_signs`.
    """
    events: list[Event] = []
    found = False
    for joint in range(len(schedule.first)):
        own = [k for k, change in enumerate(schedule.changes) if change.joint == joint]
        stays = [(own[a], own[b]) for a, b in pairwise(range(len(own)))]
        short = [
            schedule.changes[a].mode in BANG
            and schedule.changes[b].mode in BANG
            and schedule.times[b] - schedule.times[a] < _SHORT * schedule.duration
            for a, b in stays
        ]
        skipped: set[int] = set()
        k = 0
        while k < len(short):
            last = k
            while last < len(short) and short[last]:
                last += 1
            if last - k >= _MANY:
                found = True
                first, end = stays[k][0], stays[last - 1][1]
                events.append(Event(float(schedule.times[first]), joint, Mode.FREE))
                events.append(Event(float(schedule.times[end]), joint, schedule.changes[end].mode))
                skipped.update(own[k : last + 1])
            k = max(last, k + 1)
        for k in own:
            change = schedule.changes[k]
            if k not in skipped:
                events.append(Event(float(schedule.times[k]), joint, change.mode, change.touch))
    return arcs_between(schedule.first, events, schedule.duration) if found else []
