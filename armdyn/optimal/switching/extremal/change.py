"""Events of a switching structure: a joint's mode changes, a limit is touched, another joint's torque holds a joint."""

from dataclasses import dataclass

from armdyn.optimal.arcs.arc import Mode
from armdyn.optimal.switching.extremal.singular_control import SingularControl


@dataclass(frozen=True)
class Carrier:
    """Another joint whose torque keeps a joint on its limit of position, while that joint's own torque is full.

    Attributes:
        joint: number of the other joint.
        press: torque limit that the held joint is on meanwhile.
        after: mode of the other joint when the contact ends.
    """

    joint: int
    press: Mode
    after: Mode


@dataclass(frozen=True)
class Change:
    """A change of one joint's mode at one time.

    Attributes:
        joint: its number.
        mode: what it is in from then on; of a touch, the limit that it meets and leaves at once.
        touch: it keeps the mode that it was in.
        control: of a free torque; else none.
        carrier: the joint that holds this one on a limit of position; None: its own torque does.
        keeps: of a torque that keeps another joint on its velocity limit: that joint, and the torque limit it is on.
        tangent: a joint and a torque limit: with this torque, and the others' on their limits, the joint's velocity
            stays as it is; else none.
        tied: it comes at the time of the change before.
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
    """A joint's time in one mode.

    Attributes:
        begin: number of the change that begins it; -1: the start.
        end: of the one that ends it; as many as there are changes: the goal.
    """

    begin: int
    end: int
