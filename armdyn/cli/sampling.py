"""Rows of an exported motion, at a rate at which ros2_control's spline stays near it and within the arm's limits."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

import armdyn as ad
from armdyn.cli.console import escape
from armdyn.errors import TrajectoryError
from armdyn.parsing.numbers import number
from armdyn.trajectory.formats import OutputFormat, Ros2
from armdyn.trajectory.formats.streams import Stream
from armdyn.trajectory.planned import Planned
from armdyn.trajectory.samples import LAST_STEP, MOST_RATE, MOST_SAMPLES

if TYPE_CHECKING:
    from pathlib import Path

    from armdyn.models.presets.check import ConditionCheck
    from armdyn.show.page.motions import Subject

LIMITS = ("position", "velocity")
"""Conditions that depend on the rate of the rows."""

_OVER = 1e-4
"""Part of a limit by which the spline may exceed it where the motion does not: a tenth of what checks tolerate."""


@dataclass(frozen=True)
class Rows:
    """Rows of a motion.

    Attributes:
        samples: the rows.
        rate: per second [Hz]; None: the motion's own samples.
        deviation: of ros2_control's spline from the motion [rad or m]; None: the format is not for it.
        check: of the rows by the preset ros2-jtc; None: the format is not for it.
        over: which limit ros2_control's spline would exceed between the rows, in words; empty: none.
        off: how far off the motion it would be, in words; empty: within the tolerance.
        raised: the same at the requested rate, for which the rate was raised; empty: it was not.
        enough: rate at which nothing would be broken [Hz]; None: not looked for, or there is none.
    """

    samples: ad.Samples
    rate: float | None
    deviation: float | None = None
    check: ad.ControllerCheck | None = None
    over: str = ""
    off: str = ""
    raised: str = ""
    enough: float | None = None

    @property
    def broken(self) -> str:
        """What ros2_control's spline would break, in words; empty: nothing."""
        return self.over or self.off

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
        kept = {row.condition for row in self.check.rows if row.condition in LIMITS}
        limits = ", and within the arm's limits" if kept else "; the arm's limits are not known"
        off = f"at most {self.deviation:.2g} rad or m off the motion"
        lines.append(f"ros2_control's spline between the points is {off}{limits}")
        for row in self.check.offences:
            if row.condition == "end_velocity":
                need = "ros2_control takes it with allow_nonzero_velocity_at_trajectory_end: true"
                lines.append(f"[yellow]ends in motion[/], {escape(row.joint)} at {row.value:.3g} {row.unit}: {need}")
                break
        beyond = [row for row in self.check.offences if row.condition in LIMITS]
        lines += [f"[yellow]the motion itself exceeds a limit[/]: {escape(str(beyond[0]))}"] if beyond else []
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
        output_format: the format; only of `Ros2` there is a spline.
        motion: the motion.
        rate: value of --rate.
        default_rate: rate without --rate [Hz].
        arm: whose limits hold, for `Ros2`.
        strict: whether --rate must not be raised.

    Raises:
        TrajectoryError: the spline is too far off the motion, and the rate must not be raised.
    """
    wish = default_rate if rate is None else number(rate, "--rate") if rate.strip() != "own" else None
    least = output_format.least if isinstance(output_format, Ros2) else LAST_STEP
    made = Rows(motion.resample(wish, least), wish)
    if not isinstance(output_format, Ros2) or arm is None:
        return made
    jtc = ad.ControllerPreset.named("ros2-jtc").fitted(arm.limits, arm.joints)
    few = replace(jtc.chosen, rate=min(jtc.chosen.rate, MOST_SAMPLES / motion.duration))  # of ticks
    jtc = replace(jtc, interfaces=(few,))
    apart = np.append(True, ~motion.jumps)
    own = jtc.check(Planned(motion.t[apart], motion.q[apart], motion.v[apart]), arm.joints)
    most = {(row.condition, row.joint): max(row.share, 1.0) + _OVER for row in own.rows}

    def judged(rows: Rows) -> Rows:
        check = jtc.check(rows.samples, arm.joints)
        over = [row for row in check.rows if row.condition in LIMITS and row.share > most[row.condition, row.joint]]
        rows = replace(rows, check=check, over=_said(max(over, key=attrgetter("share"))) if over else "")
        try:
            return replace(rows, deviation=output_format.deviation(rows.samples, motion))
        except TrajectoryError as error:
            return replace(rows, off=str(error))

    first = better = judged(made)
    ticks = default_rate / 2 if wish is None else wish
    while better.broken and 2 * ticks <= MOST_RATE and 2 * ticks * motion.duration < MOST_SAMPLES:
        ticks *= 2
        better = judged(Rows(motion.resample(ticks, least), ticks))
    enough = None if better.broken else better.rate
    if not first.broken or (enough and wish is not None and not (strict and rate is not None)):
        return replace(better, raised=first.broken)
    if not first.over:
        raise TrajectoryError(first.off + (f"; a rate of {enough:g} Hz would do" if enough else ""))
    return replace(first, enough=enough)


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


def subject_of_file(file: Path) -> Subject:
    """The arm of a motion's file, as far as a result next to it says it: limits are infinite where unknown."""
    from armdyn.cli.reports.saved import read_saved
    from armdyn.cli.reports.subject import SubjectSpec, subject_of

    beside = file.with_name("result.json")
    saved = read_saved(file.parent if file.name == "reference.npz" and beside.is_file() else file)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of an arm that is not drawn
        return subject_of(saved, SubjectSpec())
