"""Corrections of contacts with position and velocity limits: by torque limits and by the sign of the multiplier."""

from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.optimal.arcs.arc import OPPOSITE, POSITION, TOWARDS, VELOCITY, Mode, outward, runs_of
from armdyn.optimal.switching.costates import NODES, SampledExtremal
from armdyn.optimal.switching.extremal.change import Change, Segment
from armdyn.optimal.switching.extremal.quadratic_model import LinearRollout
from armdyn.optimal.switching.extremal.state_limits import edited
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
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
        t = whole.t[own][:, None] + lengths[own][:, None] * NODES
        upper, lower = limits.actuators.upper[i], limits.actuators.lower[i]
        torque = (2 * whole.tau[own, :, i] - upper - lower) / (upper - lower)
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
