"""Programs for the controllers of Universal Robots, in URScript."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from armdyn.arguments import number
from armdyn.errors import TrajectoryError
from armdyn.trajectory.formats.streams import EVENT_REMARK, PieceStart, Stream, python_head, start_tolerance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from armdyn.trajectory.samples import Samples

UR_RATES = (500.0, 125.0)
"""Ticks per second of a UR controller [Hz]: e-Series and later, CB3."""


_RANGES = {"lookahead": (0.03, 0.2), "gain": (100.0, 2000.0)}
"""Ranges of servoj's lookahead_time [s] and gain, Script manual."""

_ON_EVENT = """\
  def armdyn_event(kind, name):
    # Write here what the gripper does, without waiting, such as:
    # set_standard_digital_out(0, True)
    textmsg(kind, name)
  end
"""

_LOAD = """\
  global armdyn_m = get_target_payload()
  global armdyn_c = get_target_payload_cog()
  global armdyn_i = get_target_payload_inertia()
  def armdyn_load(m, c, i):
    # The robot's own payload and the load as one body: mass, centre of mass, inertia about it.
    local t = armdyn_m + m
    if t <= 0:
      set_target_payload(0, [0, 0, 0])
    else:
      local w = armdyn_m * m / t
      local x = armdyn_c[0] - c[0]
      local y = armdyn_c[1] - c[1]
      local z = armdyn_c[2] - c[2]
      local cx = (armdyn_m * armdyn_c[0] + m * c[0]) / t
      local cy = (armdyn_m * armdyn_c[1] + m * c[1]) / t
      local cz = (armdyn_m * armdyn_c[2] + m * c[2]) / t
      local xx = armdyn_i[0] + i[0] + w * (y * y + z * z)
      local yy = armdyn_i[1] + i[1] + w * (x * x + z * z)
      local zz = armdyn_i[2] + i[2] + w * (x * x + y * y)
      local xy = armdyn_i[3] + i[3] - w * x * y
      local xz = armdyn_i[4] + i[4] - w * x * z
      local yz = armdyn_i[5] + i[5] - w * y * z
      set_target_payload(t, [cx, cy, cz], [xx, yy, zz, xy, xz, yz]TRANSITION)
    end
  end
"""

_PLAIN = re.compile("[^A-Za-z0-9 _.-]")
"""Characters that a name in a program does not have."""

_LATE = 3
"""Lookahead times for which the last target is kept: a first-order lag is then within 5 % of its last step."""

APPROACH = {"a": 0.5, "v": 0.25}
"""Acceleration [rad/s²] and velocity [rad/s] of the way to the start; URScript's defaults are 1.4 and 1.05."""


@dataclass(frozen=True)
class UrScript(Stream):
    """One servoj per tick, after a slow movej to the start: https://www.universal-robots.com/manuals, Script manual.

    servoj(q, a, v, t, lookahead_time, gain) ignores a and v. The arm is behind the targets by about the lookahead time,
    so that the last target is kept until the arm is there, and events are so much later than the targets.

    Loads of pieces are added to the robot's payload by set_target_payload(m, cog, inertia, transition_time) at their
    events, in the axes of the flange; armdyn_event(kind, name) is there for the gripper's commands.

    Attributes:
        lookahead: `lookahead_time` of servoj [s], 0.03 to 0.2: longer is smoother, and later.
        gain: of servoj, 100 to 2000.
        transition: `transition_time` [s] over which the controller applies a load that changes; 0: at once, and the
            argument, which older controllers do not have, is left out.
    """

    name: ClassVar[str] = "urscript"
    suffix: ClassVar[str] = ".script"
    summary: ClassVar[str] = "a URScript program of servoj, 500 or 125 Hz"
    rate: ClassVar[float] = UR_RATES[0]
    flange: ClassVar[str] = "tool0"
    joints: ClassVar[int] = 6

    lookahead: float = 0.1
    gain: float = 300.0
    transition: float = 0.0

    def settling(self, rate: float) -> int:
        """Ticks for which the last target is kept.

        Raises:
            TrajectoryError: lookahead or gain is out of URScript's range.
        """
        for name, (low, high) in _RANGES.items():
            if not low <= number(getattr(self, name), name, error=TrajectoryError) <= high:
                raise TrajectoryError(f"{name} is {getattr(self, name):g}; URScript takes {low:g} to {high:g}")
        return round(_LATE * self.lookahead * rate)

    def late_events(self, samples: Samples, rate: float) -> list[PieceStart]:
        """Events in ticks from the start of the motion, later by the arm's lag where it moves before.

        Raises:
            TrajectoryError: see `Stream.events`.
        """
        late = round(self.lookahead * rate)
        return [one._replace(row=one.row + late) if one.row > 0 else one for one in self.events(samples)]

    def _event_lines(self, event: PieceStart) -> list[str]:
        """Script of an event; names have plain letters only, for URScript has no escapes."""
        kind, name = (_PLAIN.sub("_", text[:80]) for text in (event.kind, event.name))
        lines = [f'  armdyn_event("{kind}", "{name}")'] if event.kind else []
        if event.load is not None:
            mass, com, inertia = event.load
            lines.append(f"  armdyn_load({_number(mass)}, {_vector(com)}, {_vector(inertia)})")
        return lines

    def _functions(self, events: Sequence[PieceStart]) -> list[str]:
        """Script of the functions that events call."""
        over = number(self.transition, "transition", unit="s", sign="not negative", error=TrajectoryError)
        told = _ON_EVENT if any(event.kind for event in events) else ""
        if any(event.load is not None for event in events):
            told += _LOAD.replace("TRANSITION", f", {_number(over)}" if over else "")
        return told.splitlines()

    def text(self, samples: Samples) -> str:
        """The program: payload, way to the start, stream, stop.

        Raises:
            TrajectoryError: the motion has not six joints, is not sampled at 500 or 125 Hz, or a field is out of
                URScript's range.
        """
        rate, load = self.rate_of(samples, UR_RATES), self.load()
        rows = [_vector(row) for row in samples.q.tolist()]
        kept = rows[-1:] * self.settling(rate)
        late, events = self.late_events(samples, rate), dict[int, list[str]]()
        for event in late:
            events.setdefault(event.row, []).extend(self._event_lines(event))
        tail = f"0, 0, {1 / rate:g}, {self.lookahead:g}, {self.gain:g})"
        lines = [
            f"# Motion of {samples.t[-1]:.6f} s at {rate:g} Hz for a UR arm, written by armdyn.",
            f"# Name: {json.dumps(samples.name[:80])}. Joints, base to wrist: {json.dumps(samples.joint_names)}.",
            "# It was planned on a model. Try it in URSim or at reduced speed first, an emergency stop at hand.",
            "# Send it to port 30002, or load it in a Script node and call armdyn_motion().",
            f"# First the arm moves slowly to {rows[0]}: that way is not planned, look at it.",
            "def armdyn_motion():",
        ]
        if load is not None:
            lines.append(f"  set_target_payload({_number(load[0])}, {_vector(load[1])})")
        lines += [*self._functions(late), *events.get(-1, [])]
        lines.append(f"  movej({rows[0]}, a={APPROACH['a']}, v={APPROACH['v']})")
        for tick, row in enumerate((*rows[1:], *kept)):
            lines += [*events.get(tick, []), f"  servoj({row}, {tail}"]
        return "\n".join([*lines, "  stopj(2)", "end", ""])


def _number(value: float) -> str:
    """Decimals without an exponent, to 1e-9."""
    return f"{value:.9f}"


def _vector(values: list[float]) -> str:
    return f"[{', '.join(map(_number, values))}]"


_UR_RTDE = '''

def refuse_unless_ready(control, receive):
    """The arm is not stopped, and all targets are within the limits that the controller's safety settings have."""
    if receive.isProtectiveStopped() or receive.isEmergencyStopped():
        raise SystemExit("refused: the arm is stopped; clear that on the pendant first")
    for k, q in enumerate(Q):
        if not control.isJointsWithinSafetyLimits(q):
            raise SystemExit(f"refused: the target at {k / RATE:.3f} s is outside the controller's safety limits")


def payload_of(receive):
    """The payload that is set on the robot: mass, centre of mass, inertia."""
    if PAYLOAD is not None:
        return *PAYLOAD, [0.0] * 6
    return receive.getPayload(), receive.getPayloadCog(), receive.getPayloadInertia()


def occur(control, tick, base):
    """Tell of the event of a piece that starts at a tick, and add its load to the robot's own payload."""
    for row, kind, name, load in EVENTS:
        if row == tick and kind:
            on_event(kind, name)
        if row == tick and load is not None:
            control.setTargetPayload(*joined(base, load))


def run(control, base):
    """Send one target per tick; the last one until the arm has caught up."""
    try:
        for tick, q in enumerate(Q[1:] + [Q[-1]] * SETTLING):
            begin = control.initPeriod()
            occur(control, tick, base)
            if not control.servoJ(q, 0.5, 0.5, 1 / RATE, LOOKAHEAD, GAIN):  # 0.5, 0.5: not used by the controller
                raise SystemExit("stopped: the controller takes no more targets")
            control.waitPeriod(begin)
    finally:
        control.servoStop()


def main():
    asked = options("a UR arm")
    from rtde_control import RTDEControlInterface
    from rtde_receive import RTDEReceiveInterface

    receive = RTDEReceiveInterface(asked.host)
    control = RTDEControlInterface(asked.host, RATE)
    try:
        if PAYLOAD is not None:
            control.setPayload(*PAYLOAD)
        base = payload_of(receive) if any(load for *_, load in EVENTS) else None
        occur(control, -1, base)
        refuse_unless_ready(control, receive)
        approach = lambda q: control.moveJ(q, APPROACH_VELOCITY, APPROACH_ACCELERATION)
        go_to_start(receive.getActualQ, approach, asked.to_start)
        run(control, base)
        print(f"done; a joint is {distance(receive.getActualQ(), Q[-1]):.4f} rad from the goal at most")
    finally:
        control.stopScript()


if __name__ == "__main__":
    main()
'''


@dataclass(frozen=True)
class UrRtde(UrScript):
    """A Python program that sends a motion by ur_rtde: https://sdurobotics.gitlab.io/ur_rtde.

    It refuses an arm that is stopped or not at the start, and targets outside the controller's safety limits.

    Attributes:
        tolerance: largest distance of a joint from the start [rad].
    """

    name: ClassVar[str] = "ur-rtde"
    suffix: ClassVar[str] = ".py"
    summary: ClassVar[str] = "a Python program for ur_rtde"

    tolerance: float = 0.01

    def text(self, samples: Samples) -> str:
        """Text of the program.

        Raises:
            TrajectoryError: see `UrScript.text`.
        """
        rate = self.rate_of(samples, UR_RATES)
        if self.transition:
            raise TrajectoryError("transition is of urscript: setTargetPayload of ur_rtde changes a load at once")
        constants = {
            "RATE": (rate, "[Hz]"),
            "TOLERANCE": (start_tolerance(self.tolerance), "[rad]"),
            "APPROACH_VELOCITY": (APPROACH["v"], "[rad/s]"),
            "APPROACH_ACCELERATION": (APPROACH["a"], "[rad/s^2]"),
            "SETTLING": (self.settling(rate), "ticks"),
            "LOOKAHEAD": (float(self.lookahead), "[s]: the arm is about so late"),
            "GAIN": (float(self.gain), "of servoJ"),
            "PAYLOAD": (self.load(), "mass [kg], centre of mass from the flange [m]"),
            "EVENTS": ([tuple(one) for one in self.late_events(samples, rate)], EVENT_REMARK),
        }
        return python_head("a UR arm", "ur_rtde", samples, constants) + _UR_RTDE
