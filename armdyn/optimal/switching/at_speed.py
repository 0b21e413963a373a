"""Contacts with velocity limits that another joint's torque maintains, detected on a mesh.

The joint's own torque is saturated during the contact. The other torque looks like a singular arc, but is determined by
the velocity limit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armdyn.optimal.arcs.arc import BANG, Arc, Mode, stretches
from armdyn.optimal.switching.extremal.change import Change
from armdyn.optimal.switching.extremal.rollout import ShootingProblem
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.trajectory import Trajectory


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
        for run in stretches(np.flatnonzero(fast)) if mode in BANG else []:
            first, last = run[0] + 1, run[-1] + 1
            limit = Mode.VELOCITY_UPPER if at.v[first, i] > 0 else Mode.VELOCITY_LOWER
            full = np.abs(level[[first, last]]) > policy.singular.on_limit
            begin = whole[0] if first == 1 else float(t[first])
            end = whole[1] if last == t.size - 2 else float(t[last])
            found.append(SpeedContact(0, i, limit, mode, other, begin, end, (bool(full[0]), bool(full[1]))))
    return max(found, key=lambda contact: contact.end - contact.begin, default=None)
