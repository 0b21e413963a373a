"""Python programs for Franka's arms, by panda-python."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from armdyn.errors import TrajectoryError
from armdyn.trajectory.formats.streams import EVENT_REMARK, Stream, python_head, start_tolerance

if TYPE_CHECKING:
    from armdyn.trajectory.samples import Samples

_PROGRAM = '''

def refuse_unless_ready(panda):
    """The arm has no error, and all targets are within the connected arm's own joint limits."""
    panda.raise_error()
    lower, upper = panda.get_joint_limits_lower(), panda.get_joint_limits_upper()
    for k, q in enumerate(Q):
        if not all(low <= x <= high for low, x, high in zip(lower, q, upper)):
            raise SystemExit(f"refused: the target at {k / RATE:.3f} s is outside the arm's joint limits")


def run(panda, controller, first, last):
    """Show the controller the target of each moment; panda-py raises the arm's errors, and the arm stops by itself."""
    panda.start_controller(controller)
    try:
        sent = first
        with panda.create_context(frequency=RATE) as context:
            while context.ok() and sent <= last + SETTLING:
                due = first + int(context.time * RATE + 0.5)  # this computer may be late: the motion is not
                if due > sent + MOST_LATE:
                    raise SystemExit(f"stopped: this computer was {(due - sent) / RATE:.3f} s late")
                sent = max(sent, due)
                row = min(sent, last)
                controller.set_control(Q[row], V[row] if row < last else [0.0] * len(Q[row]))
                if distance(panda.q, Q[row]) > MOST_OFF:
                    raise SystemExit(f"stopped: a joint is more than {MOST_OFF} rad off the motion")
                sent += 1
    finally:
        panda.stop_controller()


def occur(panda, kind, name, load):
    """Tell of an event, and set the load of its piece, which the robot takes at rest without a controller only."""
    if kind:
        on_event(kind, name)
    if load is not None:
        mass, com, (xx, yy, zz, xy, xz, yz) = joined((*PAYLOAD, [0.0] * 6), load) if PAYLOAD is not None else load
        panda.get_robot().set_load(mass, com, [xx, xy, xz, xy, yy, yz, xz, yz, zz])


def main():
    asked = options("a Franka arm")
    import panda_py
    from panda_py import controllers

    panda = panda_py.Panda(asked.host)
    if PAYLOAD is not None:
        panda.get_robot().set_load(*PAYLOAD, [0.0] * 9)
    events = EVENTS[:]
    if events and events[0][0] < 0:
        occur(panda, *events.pop(0)[1:])
    refuse_unless_ready(panda)
    approach = lambda q: panda.move_to_joint_position(q, speed_factor=APPROACH_SPEED)
    go_to_start(lambda: panda.q, approach, asked.to_start)
    for (first, *event), last in zip([(0, "", "", None)] + events, [event[0] for event in events] + [len(Q) - 1]):
        occur(panda, *event)
        if last > first:
            run(panda, controllers.JointPosition(), first, last)
    print(f"done; a joint is {distance(panda.q, Q[-1]):.4f} rad from the goal at most")


if __name__ == "__main__":
    main()
'''

_REST = 0.01
"""Speed of a joint at which an arm counts as at rest [rad/s]: a sample may be a tick off a stop."""


@dataclass(frozen=True)
class PandaPython(Stream):
    """A Python program that follows a motion by panda-python: https://jeanelsner.github.io/panda-py.

    Positions and velocities go to its `JointPosition` controller, a PD controller at 1 kHz over the arm's gravity
    compensation. It refuses an arm with an error or not at the start, and targets outside the arm's joint limits.

    The robot takes a new load without a controller only: of a motion of several pieces the arm settles and pauses at
    each event and each change of the load, where it must be at rest. Loads are added to the end effector that Franka's
    Desk knows.

    Attributes:
        tolerance: largest distance of a joint from the start [rad].
    """

    name: ClassVar[str] = "panda-python"
    suffix: ClassVar[str] = ".py"
    summary: ClassVar[str] = "a Python program for panda-python, 1 kHz"
    rate: ClassVar[float] = 1000.0
    flange: ClassVar[str] = "link8"
    joints: ClassVar[int] = 7

    tolerance: float = 0.01

    def text(self, samples: Samples) -> str:
        """Text of the program.

        Raises:
            TrajectoryError: the motion has not seven joints, is not sampled at 1 kHz, or a field is none; or an event
                occurs in motion.
        """
        events = self.events(samples)
        for event in events:
            near = samples.v[max(event.row - 1, 0) : max(event.row, 0) + 1]  # a rest may be between two rows
            if (speed := abs(near).max(axis=1).min()) > _REST:
                raise TrajectoryError(
                    f"{event.kind or 'a new load'} occurs at {samples.t[event.row]:.4g} s, where a joint moves by "
                    f"{speed:.3g} rad/s; a Franka arm takes a new load at rest only"
                )
        constants = {
            "RATE": (self.rate_of(samples, (self.rate,)), "[Hz]"),
            "TOLERANCE": (start_tolerance(self.tolerance), "[rad]"),
            "APPROACH_SPEED": (0.1, "part of the arm's velocity limits"),
            "MOST_LATE": (20, "ticks"),
            "MOST_OFF": (0.1, "[rad]"),
            "SETTLING": (500, "ticks"),
            "EVENTS": ([tuple(one) for one in events], EVENT_REMARK),
            "PAYLOAD": (self.load(), "mass [kg], centre of mass from the flange [m]"),
            "V": (samples.v.tolist(), "joint velocities [rad/s], one row per tick"),
        }
        return python_head("a Franka arm", "panda-python", samples, constants) + _PROGRAM
