"""Contacts with a limit of position that another joint's torque holds, while the joint's own torque is full."""

from dataclasses import dataclass, replace

import numpy as np

from armdyn.optimal.arcs.arc import BANG, OPPOSITE, POSITION, Mode
from armdyn.optimal.switching.costates import SampledExtremal
from armdyn.optimal.switching.extremal.change import Carrier, Change, Segment
from armdyn.optimal.switching.extremal.descent import Extremal
from armdyn.optimal.switching.extremal.state_limits import edited
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.signs import WrongSign, worst_stretch


def with_carrier(
    extremal: Extremal, whole: SampledExtremal, segment: Segment, press: Mode
) -> SwitchingStructure | None:
    """Structure in which another joint holds a contact; None if none can, or one does already.

    Of the joints that can, the one whose torque H feels least.

    Args:
        extremal: whose structure it is.
        whole: its costates and torques.
        segment: the contact, of more torque than there is.
        press: the limit that the torque is beyond.
    """
    structure, limits = extremal.structure, extremal.shooting.problem.limits
    near = extremal.shooting.policy.contacts.near * structure.duration
    contact, (begin, end) = structure.changes[segment.begin], structure.span(segment)
    if contact.carrier or contact.mode not in POSITION:
        return None
    i, middle = contact.joint, (whole.t[:-1] + whole.t[1:]) / 2
    own = np.flatnonzero((middle > begin) & (middle < end))
    less = whole.tau[own, :, i] - (limits.actuators.upper if press is Mode.UPPER else limits.actuators.lower)[i]
    inverse = np.linalg.inv(whole.inertia[own])
    found: list[tuple[float, int]] = []
    for j in range(len(structure.first)):
        if j == i or not _on_limits(structure, j, begin, end, near):
            continue
        more = less * inverse[..., i, i] / inverse[..., i, j]
        if limits.actuators.lower[j] <= np.median(whole.tau[own, :, j] + more) <= limits.actuators.upper[j]:
            found.append((float(np.median(np.abs(whole.switching[own, :, j] * more))), j))
    if not found:
        return None
    left = structure.without_changes([segment.begin])
    return _held(extremal, left, contact, (begin, end), Carrier(min(found)[1], press, Mode.FREE))


@dataclass(frozen=True, eq=False)
class CarriedTouches:
    """A structure with a contact in place of touches.

    Attributes:
        structure: with the contact.
        pair: the joint that touches, and the one whose torque holds it.
    """

    structure: SwitchingStructure
    pair: tuple[int, int]


def with_carried_touches(extremal: Extremal, wrong: list[WrongSign], refused: set[object]) -> CarriedTouches | None:
    """The structure with touches that become a contact, held by a joint whose torque is on the wrong limit about them.

    A touch bends the switching functions of the other joints: where one of them asks for the other limit just then, and
    for the first one beside, its torque is to hold the joint that touches.

    Args:
        extremal: whose touches they are.
        wrong: stretches on the wrong limit, the worst first.
        refused: pairs of joints, the one that touches and the other, of which nothing came.
    """
    for j in dict.fromkeys(one.joint for one in wrong):
        found = _carried_touches(extremal, [one for one in wrong if one.joint == j], refused)
        if found is not None:
            return found
    return None


def _carried_touches(extremal: Extremal, wrong: list[WrongSign], refused: set[object]) -> CarriedTouches | None:
    """Contacts of stretches of one joint."""
    structure, j = extremal.structure, wrong[0].joint
    near = extremal.shooting.policy.contacts.near * structure.duration
    begin, end = worst_stretch(wrong, near)
    touches = [
        k
        for k in structure.within(begin, end)
        if (change := structure.changes[k]).touch
        and change.mode in POSITION
        and change.joint != j
        and (change.joint, j) not in refused
    ]
    if not touches:
        return None
    nearest = min(touches, key=lambda k: abs(structure.times[k] - wrong[0].worst))
    touch = structure.changes[nearest]
    times = [float(structure.times[k]) for k in touches if structure.changes[k] == touch]
    half = (end - begin) / 8 if max(times) - min(times) < near else 0.0
    ends = max(begin, min(times) - half), min(end, max(times) + half)
    press = structure.modes()[nearest][touch.joint]
    switched = any(change.is_of(touch.joint) and change.mode is not press for change in _within(structure, *ends, near))
    if press not in BANG or switched or not _on_limits(structure, j, *ends, near):
        return None
    contact = _held(extremal, structure, replace(touch, touch=False), ends, Carrier(j, press, Mode.FREE), press)
    return CarriedTouches(contact, (touch.joint, j))


def with_other_press(structure: SwitchingStructure, wrong: list[WrongSign]) -> SwitchingStructure | None:
    """Put joints in contact on their other torque limit where signs are wrong; None if no contact changes.

    Args:
        structure: an extremal's.
        wrong: its stretches on the wrong limit.
    """
    changes = list(structure.changes)
    for one in wrong:
        for k, change in enumerate(structure.changes):
            if not one.carried or change.carrier is None or change.joint != one.joint:
                continue
            begin, end = structure.span(Segment(k, structure.end_of(k)))
            if begin < (one.begin + one.end) / 2 < end:
                changes[k] = replace(change, carrier=replace(change.carrier, press=OPPOSITE[one.mode]))
    return replace(structure, changes=tuple(changes)) if tuple(changes) != structure.changes else None


def _held(
    extremal: Extremal,
    structure: SwitchingStructure,
    contact: Change,
    ends: tuple[float, float],
    carrier: Carrier,
    leaving: Mode | None = None,
) -> SwitchingStructure:
    """The structure with a contact that a carrier holds.

    Args:
        extremal: which the contact's states come from.
        structure: without it.
        contact: the change that begins it.
        ends: when it begins and ends [s].
        carrier: of what it does afterwards the structure decides.
        leaving: the torque that the joint has afterwards; None: the structure says it.
    """
    near = extremal.shooting.policy.contacts.near * structure.duration
    begin, end = ends
    gone, after = [], structure.modes()[int(np.searchsorted(structure.times, begin - near))][carrier.joint]
    for k in structure.within(begin - near, end + near):
        change = structure.changes[k]
        if change.is_of(carrier.joint):
            gone.append(k)
            after = change.mode
        elif change.joint == contact.joint and (
            change.mode if change.touch else structure.modes()[k][change.joint]
        ) is (contact.mode):
            gone.append(k)  # a touch, or the end of a contact that goes on as this one
    more = [(begin, replace(contact, carrier=replace(carrier, after=after)))]
    if leaving is not None:
        more.append((end, Change(contact.joint, leaving)))
    return edited(extremal.rollout, structure, gone, more).without(())


def _within(structure: SwitchingStructure, begin: float, end: float, near: float) -> list[Change]:
    return [structure.changes[k] for k in structure.within(begin - near, end + near)]


def _on_limits(structure: SwitchingStructure, joint: int, begin: float, end: float, near: float) -> bool:
    """Whether a joint's torque is saturated between two times [s], so that it may hold another joint instead."""
    first = int(np.searchsorted(structure.times, begin - near))
    modes = [structure.modes()[first][joint]]
    modes += [change.mode for change in _within(structure, begin, end, near) if change.is_of(joint)]
    carrying = any(carrier.joint == joint for each in structure.carriers()[first:] for carrier in each.values())
    return all(mode in BANG for mode in modes) and not carrying
