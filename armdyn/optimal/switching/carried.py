"""Contacts with position limits that another joint's torque maintains, while the joint's own torque is saturated."""

from dataclasses import replace

import numpy as np

from armdyn.optimal.arcs.arc import BANG, POSITION, Mode
from armdyn.optimal.switching.extremal.change import Carrier, Change
from armdyn.optimal.switching.extremal.descent import Extremal
from armdyn.optimal.switching.extremal.state_limits import edited
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.signs import WrongSign, worst_stretch


def with_carried_touches(
    extremal: Extremal, wrong: list[WrongSign], refused: set[object]
) -> tuple[SwitchingStructure, tuple[int, int]] | None:
    """The structure with touches merged into a contact, maintained by a joint with a wrong torque limit around them.

    A touch deflects the switching functions of the other joints: if one of them requires the opposite limit at the
    touch, and the present one around it, its torque should maintain the contact.

    Args:
        extremal: extremal with the touches.
        wrong: stretches on the wrong limit, worst first.
        refused: pairs of joints, the touching one and the other, that failed before.

    Returns:
        The structure and its pair; None without such a contact.
    """
    for j in dict.fromkeys(one.joint for one in wrong):
        found = _carried_touches(extremal, [one for one in wrong if one.joint == j], refused)
        if found is not None:
            return found
    return None


def _carried_touches(
    extremal: Extremal, wrong: list[WrongSign], refused: set[object]
) -> tuple[SwitchingStructure, tuple[int, int]] | None:
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
    return _held(extremal, touch, ends, j, press), (touch.joint, j)


def _held(
    extremal: Extremal, touch: Change, ends: tuple[float, float], carrier: int, press: Mode
) -> SwitchingStructure:
    """The structure with a contact in place of touches.

    Args:
        extremal: extremal of the structure.
        touch: one of the touches.
        ends: start and end of the contact [s].
        carrier: joint whose torque maintains the contact.
        press: active torque limit of the joint in contact.
    """
    structure, (begin, end) = extremal.structure, ends
    near = extremal.shooting.policy.contacts.near * structure.duration
    gone, after = [], structure.modes()[int(np.searchsorted(structure.times, begin - near))][carrier]
    for k in structure.within(begin - near, end + near):
        change = structure.changes[k]
        if change.is_of(carrier):
            gone.append(k)
            after = change.mode
        elif change.joint == touch.joint and (change.mode if change.touch else structure.modes()[k][change.joint]) is (
            touch.mode
        ):
            gone.append(k)  # a touch, or the end of a contact that continues as this one
    contact = replace(touch, touch=False, carrier=Carrier(carrier, press, after))
    more = [(begin, contact), (end, Change(touch.joint, press))]
    return edited(extremal.rollout, structure, gone, more).without(())


def _within(structure: SwitchingStructure, begin: float, end: float, near: float) -> list[Change]:
    return [structure.changes[k] for k in structure.within(begin - near, end + near)]


def _on_limits(structure: SwitchingStructure, joint: int, begin: float, end: float, near: float) -> bool:
    """Whether a joint's torque is saturated between two times [s], so that it may carry another joint instead."""
    first = int(np.searchsorted(structure.times, begin - near))
    modes = [structure.modes()[first][joint]]
    modes += [change.mode for change in _within(structure, begin, end, near) if change.is_of(joint)]
    carrying = any(carrier.joint == joint for each in structure.carriers()[first:] for carrier in each.values())
    return all(mode in BANG for mode in modes) and not carrying
