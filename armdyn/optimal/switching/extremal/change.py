"""Events of a switching structure: a mode changes, a limit is touched, another joint's torque holds a joint."""

from dataclasses import dataclass

from armdyn.optimal.arcs.arc import Mode
from armdyn.optimal.switching.extremal.singular_control import SingularControl


@dataclass(frozen=True)
class Carrier:
    """Joint whose torque keeps another joint on its position limit, while that joint's own torque is saturated.

    Attributes:
        joint: index of the carrying joint.
        press: active torque limit of the held joint.
        after: mode of the carrying joint after the contact.
    """

    joint: int
    press: Mode
    after: Mode


@dataclass(frozen=True)
class Change:
    """Change of one joint's mode at one time.

    Attributes:
        joint: index of the joint.
        mode: mode from then on; for a touch, the touched limit.
        touch: whether the change is a touch: the joint keeps its mode.
        control: singular control of a free torque; else None.
        carrier: joint that holds this one on a position limit; None: its own torque does.
        keeps: joint that this one's torque keeps on its velocity limit, and that joint's active torque limit; else
            None.
        tangent: a joint and a torque limit: with this torque, and the others' on their limits, that joint's
            acceleration is zero; else None.
        tied: whether the change is simultaneous with the one before.
    """

    joint: int
    mode: Mode
    touch: bool = False
    control: SingularControl | None = None
    carrier: Carrier | None = None
    keeps: tuple[int, Mode] | None = None
    tangent: tuple[int, Mode] | None = None
    tied: bool = False

    def is_of(self, joint: int) -> bool:
        """Whether this is a change of a joint's mode."""
        return self.joint == joint and not self.touch


@dataclass(frozen=True)
class Segment:
    """Time of a joint in one mode.

    Attributes:
        begin: index of the change at its beginning; -1: the start.
        end: index of the change at its end; the number of changes: the goal.
    """

    begin: int
    end: int
