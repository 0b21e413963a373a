"""Programs for robots' controllers: Python with panda-py, and URScript."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from armdyn.arguments import checked, number
from armdyn.errors import TrajectoryError
from armdyn.trajectory.formats.streams import EVENT_REMARK, PieceStart, Stream, program, python_program

if TYPE_CHECKING:
    from collections.abc import Sequence

    from armdyn.trajectory.samples import Samples


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
    arm: ClassVar[str] = "a Franka arm"
    joints: ClassVar[int] = 7
    own: ClassVar[tuple[str, ...]] = tuple(f"(panda|fr3|fer|franka).*joint{i}" for i in range(1, 8))
    fastest: ClassVar[float] = 5.26  # FR3's last three joints

    tolerance: float = checked(number, 0.01, unit="rad", sign="positive", error=TrajectoryError)

    def text(self, samples: Samples) -> str:
        """Text of the program.

        Raises:
            TrajectoryError: the motion has not seven joints, is not sampled at 1 kHz, or an event occurs in motion.
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
            "TOLERANCE": (self.tolerance, "[rad]"),
            "APPROACH_SPEED": (0.1, "part of the arm's velocity limits"),
            "MOST_LATE": (20, "ticks"),
            "MOST_OFF": (0.1, "[rad]"),
            "SETTLING": (500, "ticks"),
            "EVENTS": ([tuple(one) for one in events], EVENT_REMARK),
            "PAYLOAD": (self.load(), "mass [kg], centre of mass from the flange [m]"),
            "V": (samples.v.tolist(), "joint velocities [rad/s], one row per tick"),
        }
        return python_program("panda_python", self.arm, "panda-python", samples, constants)


UR_RATES = (500.0, 125.0)
"""Ticks per second of a UR controller [Hz]: e-Series and later, CB3."""


_RANGES = {"lookahead": (0.03, 0.2), "gain": (100.0, 2000.0)}
"""Ranges of servoj's lookahead_time [s] and gain, Script manual."""

_PLAIN = re.compile("[^A-Za-z0-9 _.-]")
"""Characters that a name in a program does not have."""


def _servoj(value: object, name: str) -> float:
    """An argument of servoj, within `_RANGES`."""
    low, high = _RANGES[name]
    if not low <= (given := number(value, name, error=TrajectoryError)) <= high:
        raise TrajectoryError(f"{name} is {given:g}; URScript takes {low:g} to {high:g}")
    return given


_LATE = 3
"""Lookahead times for which the last target is kept: a first-order lag is then within 5 % of its last step."""

APPROACH = {"a": 0.5, "v": 0.25}
"""Acceleration [rad/s²] and velocity [rad/s] of the way to the start; URScript's defaults are 1.4 and 1.05."""


@dataclass(frozen=True)
class UrScript(Stream):
    """One servoj per tick, after a slow movej to the start: https://www.universal-robots.com/manuals, Script manual.

    servoj(q, a, v, t, lookahead_time, gain) ignores a and v. The arm is behind the targets by about the lookahead time,
    so that the last target is kept until the arm is there, and events are delayed by the same time.

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
    arm: ClassVar[str] = "a UR arm"
    joints: ClassVar[int] = 6
    own: ClassVar[tuple[str, ...]] = (
        "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", *(f"wrist_{i}_joint" for i in (1, 2, 3)),
    )  # fmt: skip
    fastest: ClassVar[float] = 6.29  # 360 °/s, of a UR3's wrist

    lookahead: float = checked(_servoj, 0.1)
    gain: float = checked(_servoj, 300.0)
    transition: float = checked(number, 0.0, unit="s", sign="not negative", error=TrajectoryError)

    def settling(self, rate: float) -> int:
        """Ticks for which the last target is kept."""
        return round(_LATE * self.lookahead * rate)

    def late_events(self, samples: Samples, rate: float) -> list[PieceStart]:
        """Ticks of the events, delayed by the arm's lag where the arm moves before.

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
        text = program("urscript_event") if any(event.kind for event in events) else ""
        if any(event.load is not None for event in events):
            text += program("urscript_load").replace(
                "TRANSITION", f", {_number(self.transition)}" if self.transition else ""
            )
        return text.splitlines()

    def text(self, samples: Samples) -> str:
        """The program: payload, way to the start, stream, stop.

        Raises:
            TrajectoryError: the motion has not six joints, or is not sampled at 500 or 125 Hz.
        """
        rate, load = self.rate_of(samples, UR_RATES), self.load()
        rows = [_vector(row) for row in samples.q.tolist()]
        kept = rows[-1:] * self.settling(rate)
        late, events = self.late_events(samples, rate), dict[int, list[str]]()
        for event in late:
            events.setdefault(event.row, []).extend(self._event_lines(event))
        tail = f"0, 0, {1 / rate:g}, {self.lookahead:g}, {self.gain:g})"
        name, joints = json.dumps(samples.name[:80]), json.dumps(samples.joint_names)
        head = program("urscript_head").format(
            duration=samples.t[-1], rate=rate, name=name, joints=joints, start=rows[0]
        )
        lines = [head.rstrip()]
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

    tolerance: float = checked(number, 0.01, unit="rad", sign="positive", error=TrajectoryError)

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
            "TOLERANCE": (self.tolerance, "[rad]"),
            "APPROACH_VELOCITY": (APPROACH["v"], "[rad/s]"),
            "APPROACH_ACCELERATION": (APPROACH["a"], "[rad/s^2]"),
            "SETTLING": (self.settling(rate), "ticks"),
            "LOOKAHEAD": (self.lookahead, "[s]: the arm is about so late"),
            "GAIN": (self.gain, "of servoJ"),
            "PAYLOAD": (self.load(), "mass [kg], centre of mass from the flange [m]"),
            "EVENTS": ([tuple(one) for one in self.late_events(samples, rate)], EVENT_REMARK),
        }
        return python_program("ur_rtde", self.arm, "ur_rtde", samples, constants)
