"""Rows of an exported motion, at a rate at which ros2_control's spline stays near it and within the arm's limits."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

import armdyn as ad
from armdyn.arguments import shown
from armdyn.cli.console import escape
from armdyn.cli.reports.saved import Saved, read_saved
from armdyn.cli.reports.subject import SubjectSpec, bare_subject, subject_of
from armdyn.errors import ArmdynWarning, TrajectoryError
from armdyn.models.presets.check import ALONG, ConditionCheck, check_table
from armdyn.models.robots.loads import is_motion_of, robots_of
from armdyn.parsing.numbers import number
from armdyn.trajectory.formats import CsvTable, OutputFormat, Ros2
from armdyn.trajectory.formats.streams import Stream
from armdyn.trajectory.samples import LAST_STEP, MOST_RATE, MOST_SAMPLES

if TYPE_CHECKING:
    from armdyn.cli.options.path_constraints import PresetOptions
    from armdyn.show.page.motions import Subject

_OVER = 5e-4
"""Part of a limit by which the spline may exceed it where the motion does not: half of what checks tolerate, `KEPT`.
They meet a peak between rows to 2.5e-4 of it, see `PARTS`. For 1e-4 an arm at its limit after .3 ms needed 100 kHz."""


@dataclass(frozen=True)
class Rows:
    """Rows of a motion.

    Attributes:
        samples: the rows.
        rate: per second [Hz]; None: the motion's own samples.
        deviation: of ros2_control's spline from the motion [rad or m]; None: the format is not for it.
        check: of the rows by the preset ros2-jtc; None: the format is not for it.
        fault: which limit ros2_control's spline would exceed between the rows, or how far off the motion it would be,
            in words; empty: none.
        raised: the same at the requested rate, for which the rate was raised; empty: it was not.
        enough: rate at which nothing would be broken [Hz]; None: not looked for, or there is none.
    """

    samples: ad.Samples
    rate: float | None
    deviation: float | None = None
    check: ad.ControllerCheck | None = None
    fault: str = ""
    raised: str = ""
    enough: float | None = None

    @property
    def broken(self) -> str:
        """What ros2_control's spline would break, and at which rate it would not, in words; empty: nothing."""
        more = f"; {f'--rate {self.enough:g}' if self.enough else 'none of its doubles, to 100 kHz,'} would do"
        return self.fault and self.fault + more

    def facts(self) -> dict[str, object]:
        """The rows for JSON."""
        found: dict[str, object] = {"rate": self.rate, "deviation": self.deviation}
        if self.check is not None:
            found["ros2_control"] = self.check.facts() | {"raised": self.raised or None, "enough": self.enough}
        return found

    def said(self) -> list[str]:
        """The check by ros2-jtc for the terminal."""
        if self.check is None:
            return []
        lines = [f"[yellow]rate raised[/]: {escape(self.raised)}"] if self.raised else []
        known = any(row.condition in ALONG for row in self.check.rows)
        limits = ", and within the arm's limits" if known else "; the arm's limits are not known"
        off = f"at most {self.deviation:.2g} rad or m off the motion"
        lines.append(f"ros2_control's spline between the points is {off}{limits}")
        need = "ros2_control takes it with allow_nonzero_velocity_at_trajectory_end: true"
        first = {row.condition: row for row in reversed(self.check.offences)}
        if row := first.get("end_velocity"):
            lines.append(f"[yellow]ends in motion[/], {escape(row.joint)} at {row.value:.3g} {row.unit}: {need}")
        if row := next((row for row in self.check.offences if row.condition in ALONG), None):
            lines.append(f"[yellow]the motion itself exceeds a limit[/]: {escape(str(row))}")
        return lines


def sampled(
    output_format: OutputFormat,
    motion: ad.Trajectory,
    rate: str | None,
    default_rate: float,
    arm: Subject | None,
    strict: bool,
) -> Rows:
    """Rows at a rate, which is doubled until ros2_control's spline between them breaks nothing.

    Args:
        output_format: the format: the rate of `Ros2` is raised; of a table it is found and said; others have no spline.
        motion: the motion.
        rate: value of --rate.
        default_rate: rate without --rate [Hz].
        arm: whose limits hold, for `Ros2` and tables.
        strict: whether --rate must not be raised.
    """
    wish = default_rate if rate is None else number(rate, "--rate") if rate.strip() != "own" else None
    message = output_format if isinstance(output_format, Ros2) else None
    least = message.least if message else LAST_STEP
    if arm is None or not isinstance(output_format, Ros2 | CsvTable):
        return Rows(motion.resample(wish, least), wish)
    apart = np.append(True, ~motion.jumps)
    own = check_table(arm.limits, arm.joints, motion.t[apart], [motion.q[apart], motion.v[apart]])
    most = {(row.condition, row.joint): max(row.share, 1.0) + _OVER for row in own}

    def judged(rate: float | None) -> Rows:
        samples, deviation = motion.resample(rate, least), None
        rows = check_table(arm.limits, arm.joints, samples.t, [samples.q, samples.v, samples.a])
        over = [row for row in rows if row.share > most[row.condition, row.joint]]
        fault = _said(max(over, key=attrgetter("share"))) if over else ""
        try:
            deviation = message.deviation(samples, motion) if message else None
        except TrajectoryError as error:
            fault = fault or str(error).replace("`rate`", "--rate").replace("`tolerance`", "--tolerance")
        return Rows(samples, rate, deviation, fault=fault)

    first = better = judged(wish)
    ticks = default_rate / 2 if wish is None else wish
    while better.fault and 2 * ticks <= MOST_RATE and 2 * ticks * motion.duration < MOST_SAMPLES:
        ticks *= 2
        better = judged(ticks)
    enough = None if better.fault else better.rate
    fixed = message is None or wish is None or (strict and rate is not None)
    kept = first.fault and (fixed or not enough)
    made = replace(first, enough=enough) if kept else replace(better, raised=first.fault)
    if message is None:
        return made
    jtc = ad.ControllerPreset.named("ros2-jtc").fitted(arm.limits, arm.joints)
    few = replace(jtc.chosen, rate=min(jtc.chosen.rate, MOST_SAMPLES / motion.duration))  # of ticks
    return replace(made, check=replace(jtc, interfaces=(few,)).check(made.samples, arm.joints))


def _said(row: ConditionCheck) -> str:
    return (
        f"between these points ros2_control's spline would take {row.joint} to {row.value:.4g} {row.unit} at t = "
        f"{row.time:.4g} s, {100 * (row.share - 1):.2g} % beyond its {row.condition} limit of {row.limit:.4g}"
    )


DEFAULT_RATE = 1000.0
"""Rows per second of a table or message [Hz]."""


def usual_rate(kind: type[OutputFormat]) -> float:
    """Default rows per second of a format [Hz]."""
    return float(getattr(kind, "rate", DEFAULT_RATE))


def check_rows(preset: ad.ControllerPreset, samples: ad.Samples, kind: type[OutputFormat]) -> ad.ControllerCheck:
    """Check rows of a format: of a program, which sends one per tick, nothing is between them."""
    if not issubclass(kind, Stream):
        return preset.check(samples)
    t, q, v, tau = samples.t, samples.q, samples.v, samples.tau
    return preset.check(ad.Trajectory(t, q, v, tau, samples.joint_names, hold="zero-order"))


def subject_in(saved: Saved, kind: type[OutputFormat]) -> Subject | None:
    """The arm of a motion, as far as a result next to it says it; None for formats without a spline between rows."""
    beside = saved.path.with_name("result.json")
    if saved.path.name == "reference.npz" and beside.is_file():
        saved = replace(read_saved(beside), motion=saved.motion)
    if kind is CsvTable:
        return bare_subject(saved)
    if kind is not Ros2:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of an arm that is not drawn
        return subject_of(saved, SubjectSpec())


def preset_of(saved: Saved, given: PresetOptions) -> ad.ControllerPreset | None:
    """The preset of the options, or else the built-in one under which a motion was planned."""
    if (chosen := given.read()) is not None:
        return chosen
    planned = saved.facts.part("controller")
    name, known = planned.text("preset"), ad.ControllerPreset.names()
    if name and name not in known:
        note = f"the motion was planned under a preset of your own, {shown(name)}: not checked; give --preset its file"
        warnings.warn(note, ArmdynWarning, stacklevel=2)
    return ad.ControllerPreset.named(name, planned.text("interface")) if name in known else None


def with_holding_torque(samples: ad.Samples, arm: ad.Robot | None, motion: ad.Trajectory) -> tuple[ad.Samples, bool]:
    """Samples whose last torques hold the arm where the motion ends, and whether they do: the arm must be known.

    Args:
        samples: of the motion; ros2_control repeats their last row for good.
        arm: that moved; None: unknown.
        motion: the motion.
    """
    if arm is None or not arm.has_dynamics or not is_motion_of(arm, motion):
        return samples, False
    torque = robots_of(arm, motion)[-1].holding_torque(samples.q[-1])
    return replace(samples, tau=np.vstack([samples.tau[:-1], torque])), True
