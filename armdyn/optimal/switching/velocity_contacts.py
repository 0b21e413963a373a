"""Velocity limits that another joint's torque maintains, while the joint's own torque is saturated."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armdyn.optimal.arcs.arc import BANG, VELOCITY, Arc, Mode, runs_of
from armdyn.optimal.switching.extremal.change import Change, Segment
from armdyn.optimal.switching.extremal.quadratic_model import LinearRollout
from armdyn.optimal.switching.extremal.rollout import ShootingProblem
from armdyn.optimal.switching.extremal.state_limits import edited
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.trajectory import Trajectory


def kept_at_speed(
    extremal: LinearRollout, segment: Segment, part: tuple[float, float], press: Mode
) -> SwitchingStructure | None:
    """Structure in which another joint's torque keeps a joint at its velocity limit while its own torque is saturated.

    Without a jump of torques at the start or the end, the joint's acceleration is zero there with the other torque on
    its limit: stationarity of the duration alone would lead away, as the duration is largest there.

    Args:
        extremal: extremal of the structure.
        segment: the joint on its velocity limit.
        part: part of the segment that needs more torque than the joint has, from 0 to 1.
        press: the joint's active torque limit in that part.

    Returns:
        The structure; None on a position limit, or without another joint's torque on a limit.
    """
    structure = extremal.structure
    joint, (start, stop) = structure.changes[segment.begin].joint, structure.span(segment)
    if structure.changes[segment.begin].mode not in VELOCITY:
        return None
    begin, end = (start + each * (stop - start) for each in part)
    near, modes = extremal.shooting.policy.contacts.at * structure.duration, structure.modes()
    jumps = [
        k
        for k in structure.within(begin - near, end + near)
        if (change := structure.changes[k]).joint != joint
        and not change.touch
        and {modes[k][change.joint], change.mode} <= set(BANG)
    ]
    first = next((k for k in jumps if structure.times[k] <= begin + near), None)
    later = [k for k in jumps if structure.times[k] > begin + near]
    after = int(np.searchsorted(structure.times, begin + near))
    if first is not None or later:
        other = structure.changes[first if first is not None else later[0]].joint
    else:
        free = [i for i, mode in enumerate(modes[after]) if i != joint and mode in BANG]
        if not free:
            return None
        other = free[0]
    mode_changes = [k for k in structure.within(begin + near, end + near) if structure.changes[k].is_of(other)]
    last = next((k for k in mode_changes if structure.times[k] > begin + near), None)
    end = min(end, stop - near) if last is None else min(end, float(structure.times[last]))
    if modes[after][other] not in BANG or end <= begin:
        return None
    limit = (joint, press)
    own = Change(other, Mode.FREE, keeps=limit, tangent=None if first is not None or begin <= start else limit)
    more = [(max(begin, start + near), own)]
    if last is None:
        tangent = None if part[1] == 1 else limit
        more.append((end, Change(other, modes[after][other], tangent=tangent)))
    return edited(extremal.rollout, structure, [] if first is None else [first], more)


def left_at_speed(
    extremal: LinearRollout, structure: SwitchingStructure, segment: Segment, part: tuple[float, float] | None = None
) -> SwitchingStructure | None:
    """Structure in which a joint leaves its velocity limit, where another joint's torque maintains it.

    Args:
        extremal: extremal with the states.
        structure: the extremal's structure, or one with another joint's torque.
        segment: the extremal's segment of the joint on its velocity limit.
        part: part of the segment to release, from 0 to 1; None: the part maintained by another joint's torque.

    Returns:
        The structure; None if no other joint's torque maintains the limit in that part.
    """
    contact = extremal.structure.changes[segment.begin]
    start, stop = extremal.structure.span(segment)
    begin, end = (start + each * (stop - start) for each in part or (0.0, 1.0))
    for k, change in enumerate(structure.changes):
        after = structure.end_of(k) if change.keeps and change.keeps[0] == contact.joint else structure.size
        if after == structure.size or structure.times[after] < begin or structure.times[k] > end:
            continue
        assert change.keeps is not None  # noqa: S101 - guaranteed by the end found
        last, first, final = structure.changes[after], float(structure.times[k]), float(structure.times[after])
        a, b = (min(begin, first), max(end, final)) if part else (first, final)
        off = replace(contact, mode=change.keeps[1], tangent=change.tangent, tied=False)
        on = replace(contact, tangent=last.tangent, tied=False)
        more, gone = [(a, off)], {k, after}
        if change.tangent is None:
            more.append((first, replace(last, tangent=None, tied=False)))
        elif last.tangent is None:
            more.append((final, last))
        if part and first < end < final and change.tangent is None:  # only the first part
            gone, b, on = {k}, end, replace(on, tangent=None)
            more.append((b, on))
            more.append((b, replace(change, tied=True)))
        elif part and first < begin < final and last.tangent is None:  # only the last
            before = structure.modes()[k][change.joint]
            gone = {after}
            more = [(begin, replace(last, mode=before)), (begin, replace(off, tangent=None, tied=True)), (final, last)]
            more += [(b, on)] if b < stop else []
        elif b < stop:
            more.append((b, on))
        if a <= start + 2 * extremal.shooting.policy.contacts.at * structure.duration:
            gone |= {j for j, one in enumerate(structure.changes) if one is contact}
        return edited(extremal.rollout, structure, gone, more).without(())
    return None


@dataclass(frozen=True)
class SpeedContact:
    """Contact with a velocity limit that another joint's torque maintains.

    Attributes:
        arc: index of the contact's arc.
        joint: index of the joint on its limit.
        limit: the velocity limit.
        press: active limit of the joint's own torque.
        other: index of the joint whose torque maintains the contact.
        begin: start of the contact [s].
        end: end of the contact [s].
        tangent: whether the other torque is continuous at the start, and at the end of the contact.
    """

    arc: int
    joint: int
    limit: Mode
    press: Mode
    other: int
    begin: float
    end: float
    tangent: tuple[bool, bool]

    def bound_in(self, structure: SwitchingStructure, motion: Trajectory, near: float) -> SwitchingStructure:
        """Bind the other joint's torque to the contact, so that the torque maintains the velocity limit.

        Both joints change their modes at the same time. Where no torque jumps, the velocity is stationary there, too.

        Args:
            structure: structure with the contact maintained by the joint's own torque, and the other torque free.
            motion: motion with the states.
            near: distance within which two changes are simultaneous [s].
        """
        keeps = self.joint, self.press
        first, last = (keeps if tangent else None for tangent in self.tangent)
        after = structure.modes()[int(np.searchsorted(structure.times, self.end + near))]
        off, then = Change(self.joint, after[self.joint]), Change(self.other, after[self.other], tangent=last)
        changes = [
            (self.begin, Change(self.joint, self.limit)),
            (self.begin, Change(self.other, Mode.FREE, keeps=keeps, tangent=first, tied=True)),
        ]
        ends = (then, replace(off, tied=True)) if last else (off, replace(then, tied=True))
        changes += [(self.end, change) for change in ends]
        gone = [
            k
            for time in (self.begin, self.end)
            for k in structure.within(time - near, time + near)
            if structure.changes[k].joint in (self.joint, self.other)
        ]
        at = motion(np.array([time for time, _ in changes]))
        states = np.hstack([at.q, at.v])
        more = [(time, change, state) for (time, change), state in zip(changes, states, strict=True)]
        return structure.without_changes(gone).with_changes(more)


def speed_contacts(
    shooting: ShootingProblem, arcs: Sequence[Arc], motion: Trajectory
) -> tuple[list[Arc], list[SpeedContact]]:
    """Contacts with velocity limits maintained by another joint's torque, and the arcs, split at their ends.

    The joint's own torque is saturated during the contact. The other torque looks like a singular arc, but is
    determined by the velocity limit.

    Args:
        shooting: the shooting problem.
        arcs: arcs of a mesh refined at its switches, where a saturated torque precedes a velocity limit.
        motion: motion with states and torques.
    """
    out, found, begin = list[Arc](), list[SpeedContact](), 0.0
    duration = sum(arc.duration for arc in arcs)
    for arc in arcs:
        whole = begin, begin + arc.duration
        contact = _contact(shooting, arc, motion, whole)
        if contact is None or contact.end - contact.begin <= shooting.policy.singular.long * duration:
            out.append(arc)
        else:
            if contact.begin > whole[0]:
                out.append(Arc(contact.begin - whole[0], arc.modes))
            found.append(replace(contact, arc=len(out)))
            modes = tuple(contact.limit if i == contact.joint else mode for i, mode in enumerate(arc.modes))
            out.append(Arc(contact.end - contact.begin, modes))
            if contact.end < whole[1]:
                out.append(Arc(whole[1] - contact.end, arc.modes))
            out[-1] = replace(out[-1], touches=arc.touches)
        begin = whole[1]
    return out, found


def _contact(
    shooting: ShootingProblem, arc: Arc, motion: Trajectory, whole: tuple[float, float]
) -> SpeedContact | None:
    """The longest contact in which a joint's own torque is saturated on an arc where another torque is free."""
    limits, policy = shooting.problem.limits, shooting.policy
    other = next((j for j, mode in enumerate(arc.modes) if mode is Mode.FREE), None)
    if other is None:
        return None
    t = np.linspace(*whole, policy.singular.in_arc)
    at = motion(np.minimum(t, motion.duration))
    level = (at.tau[:, other] - limits.actuators.center[other]) / limits.actuators.scale[other]
    found: list[SpeedContact] = []
    for i, mode in enumerate(arc.modes):
        fast = np.abs(at.v[1:-1, i]) >= (1 - policy.arcs.near_speed) * limits.velocity[i]
        for run in runs_of(np.flatnonzero(fast)) if mode in BANG else []:
            first, last = run[0] + 1, run[-1] + 1
            limit = Mode.VELOCITY_UPPER if at.v[first, i] > 0 else Mode.VELOCITY_LOWER
            full = np.abs(level[[first, last]]) > policy.singular.on_limit
            begin = whole[0] if first == 1 else float(t[first])
            end = whole[1] if last == t.size - 2 else float(t[last])
            found.append(SpeedContact(0, i, limit, mode, other, begin, end, (bool(full[0]), bool(full[1]))))
    return max(found, key=lambda contact: contact.end - contact.begin, default=None)
