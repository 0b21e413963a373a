"""Corrections of contacts with position and velocity limits: by torque limits and by the sign of the multiplier."""

from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.optimal.arcs.arc import BANG, OPPOSITE, POSITION, TOWARDS, VELOCITY, Mode, outward, runs_of
from armdyn.optimal.switching.costates import NODES, SampledExtremal
from armdyn.optimal.switching.extremal.change import Carrier, Change, Segment
from armdyn.optimal.switching.extremal.quadratic_model import LinearRollout
from armdyn.optimal.switching.extremal.state_limits import edited
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.signs import WrongSign, worst_interval
from armdyn.optimal.task.policy.switching import ContactPolicy


def with_contacts(extremal: LinearRollout, is_extremal: bool = True) -> list[SwitchingStructure]:
    """Structures without the infeasible or suboptimal parts of a contact, likeliest first.

    Where a contact needs more torque than the joint has, the joint's torque is saturated, and a position limit is only
    touched. A contact whose multiplier has the wrong sign is released: inward torque moves the joint off, outward
    torque brings it back, a bounce. On a velocity limit the joint is decelerated and accelerated again.

    Args:
        extremal: extremal with contacts, which are checked one by one.
        is_extremal: whether the costates are an extremal's, so that their signs count.

    Returns:
        Structures; empty if all contacts are correct.
    """
    structure = extremal.structure
    held = [s for s in structure.segments() if s.begin >= 0 and structure.changes[s.begin].mode in TOWARDS]
    whole = SampledExtremal.of(extremal) if held else None
    contacts = [(s, Contact.of(extremal, whole, s)) for s in held if whole is not None]
    for segment, contact in contacts:
        if contact is None:
            continue
        if (weak := contact.weak) is not None:
            return [_let_go(extremal, segment, weak[0], [(0.0, weak[1])])]
        joint, mode = structure.changes[segment.begin].joint, structure.changes[segment.begin].mode
        alike = [
            other.largest
            for own, other in contacts
            if other and structure.changes[own.begin].joint == joint and structure.changes[own.begin].mode in VELOCITY
        ]
        largest = max(alike) if mode in VELOCITY else contact.largest
        if is_extremal and (part := contact.unwilling(largest)) is not None:
            towards, away = TOWARDS[mode], OPPOSITE[TOWARDS[mode]]
            bounce = [(0.0, away), (0.25, towards), (0.75, away)]
            steps = [(0.0, away), (0.5, towards)] if mode in VELOCITY else bounce
            return [_let_go(extremal, segment, part, steps)]
    return []


@dataclass(frozen=True, eq=False)
class Contact:
    """Torques and multipliers of a contact at the stages of its intervals.

    Attributes:
        s: places of the stages in the contact, from 0 to 1, shape (m,).
        torque: torque from −1 at the lower to 1 at the upper limit, shape (m,).
        multiplier: outward density of the limit's multiplier over the contact [s/rad], shape (m,).
        impulses: impulses of the multiplier at the knots, including both ends, shape (knots,).
        numbers: tuned numbers of contacts.
    """

    s: Array
    torque: Array
    multiplier: Array
    impulses: Array
    numbers: ContactPolicy

    @classmethod
    def of(cls, extremal: LinearRollout, whole: SampledExtremal, segment: Segment) -> "Contact | None":
        """Contact of a segment; None: the segment has no length."""
        structure, limits = extremal.structure, extremal.shooting.problem.limits
        change = structure.changes[segment.begin]
        begin, end = structure.span(segment)
        middle = (whole.t[:-1] + whole.t[1:]) / 2
        held = whole.velocity if change.mode in VELOCITY else whole.position
        own = np.flatnonzero((middle > begin) & (middle < end) & held[:, change.joint])
        if not own.size:
            return None
        i, sign, lengths = change.joint, outward(change.mode), np.diff(whole.t)
        holder = change.carrier.joint if change.carrier else i
        t = whole.t[own][:, None] + lengths[own][:, None] * NODES
        upper, lower = limits.actuators.upper[holder], limits.actuators.lower[holder]
        torque = (2 * whole.tau[own, :, holder] - upper - lower) / (upper - lower)
        costate, K = whole.costate[:, :, i], lengths.size
        knots = range(int(own[0]), int(own[-1]) + 2)
        impulses = [costate[k - 1, -1] - costate[k, 0] if 0 < k < K else 0.0 for k in knots]
        place = i
        if change.mode in VELOCITY:  # no impulse at the ends of a contact with a velocity limit
            place, impulses = len(structure.first) + i, [0.0] * len(knots)
        return cls(
            ((t - begin) / (end - begin)).ravel(),
            torque.ravel(),
            -sign * whole.state_multipliers[own, :, place].ravel() * (end - begin),
            sign * np.array(impulses),
            extremal.shooting.policy.contacts,
        )

    @property
    def weak(self) -> tuple[tuple[float, float], Mode] | None:
        """First part, from 0 to 1, that needs a torque beyond its limit, and that limit; None without any."""
        beyond = np.flatnonzero(np.abs(self.torque) > 1 + 2 * self.numbers.excess)
        if not beyond.size:
            return None
        run = runs_of(beyond)[0]
        mode = Mode.UPPER if self.torque[run[0]] > 0 else Mode.LOWER
        return self._part(run), mode

    @property
    def largest(self) -> float:
        """Largest multiplier of the limit during the contact, by density or impulse."""
        return max(float(np.max(np.abs(self.multiplier))), float(np.max(np.abs(self.impulses))))

    def unwilling(self, largest: float) -> tuple[float, float] | None:
        """First part in which the limit's multiplier has the wrong sign; None without such a part.

        Args:
            largest: largest multiplier of the contact, for a velocity limit of all the joint's contacts, as in the
                certificate.
        """
        least = -self.numbers.inward * largest
        inward = self.multiplier < least
        for k in np.flatnonzero(self.impulses[1:-1] < least) + 1:  # also impulses by another joint's touch
            inward[k * NODES.size - 1 : k * NODES.size + 1] = True
        if np.any(inward):
            begin, end = self._part(runs_of(np.flatnonzero(inward))[0])
            lacking = max(0.0, self.numbers.least - (end - begin)) / 2
            return max(0.0, begin - lacking), min(1.0, end + lacking)
        if self.impulses[0] < least:
            return 0.0, self.numbers.end
        return (1 - self.numbers.end, 1.0) if self.impulses[-1] < least else None

    def _part(self, run: Index) -> tuple[float, float]:
        before, after = self.s[max(run[0] - 1, 0)], self.s[min(run[-1] + 1, self.s.size - 1)]
        whole = self.numbers.whole
        begin, end = (self.s[run[0]] + before) / 2, (self.s[run[-1]] + after) / 2
        return (0.0 if begin < whole else float(begin)), (1.0 if end > 1 - whole else float(end))


def _let_go(
    extremal: LinearRollout, segment: Segment, part: tuple[float, float], steps: list[tuple[float, Mode]]
) -> SwitchingStructure:
    """Structure with a part of a contact released.

    Args:
        extremal: extremal of the structure.
        segment: the contact.
        part: part of the contact, from 0 to 1.
        steps: torque modes instead, with their start times in that part.
    """
    structure = extremal.structure
    contact = structure.changes[segment.begin]
    begin, end = structure.span(segment)
    a, b = (begin + each * (end - begin) for each in part)
    touch = Change(contact.joint, contact.mode, touch=True)
    touches = contact.mode in POSITION
    more = [(a + s * (b - a), Change(contact.joint, mode)) for s, mode in steps]
    gone = []
    if part[0] == 0:
        gone.append(segment.begin)
        more = [(a, touch), *more] if touches else more
    if part[1] < 1:
        more.append((b, Change(contact.joint, contact.mode)))
    elif touches and (part[0] > 0 or len(steps) > 1):
        more.append((b, touch))
    return edited(extremal.rollout, structure, gone, more).without(())


def with_carried_touches(
    extremal: LinearRollout, wrong: list[WrongSign], refused: set[object]
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
    extremal: LinearRollout, wrong: list[WrongSign], refused: set[object]
) -> tuple[SwitchingStructure, tuple[int, int]] | None:
    """Contacts of stretches of one joint."""
    structure, j = extremal.structure, wrong[0].joint
    near = extremal.shooting.policy.contacts.near * structure.duration
    begin, end = worst_interval(wrong, near)
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
    extremal: LinearRollout, touch: Change, ends: tuple[float, float], carrier: int, press: Mode
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
