"""Report of an identification: one HTML file of torques, identified parameters, and undetermined ones."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from armdyn.arguments import expect
from armdyn.arrays import Array
from armdyn.files import write_whole
from armdyn.identification.estimate import Estimate, Estimated, Judged
from armdyn.reprs import joint_unit
from armdyn.show.markup import Html, asset, element, fill, join
from armdyn.show.page.facts import Facts
from armdyn.show.page.report import Report, page_fields
from armdyn.show.page.sections import Section, listed, making_section, stacked, td
from armdyn.show.page.verdict import Tile, Verdict

_WIDTH, _HEIGHT = 600.0, 150.0
"""Width and height of a curve's drawing; the page scales it."""
_POINTS = 600
"""Samples of a drawn curve."""
_CURVES = ("measured", "prior", "fitted")


def write_identification(estimate: Estimate, path: str | os.PathLike[str], command: Facts | None = None) -> Path:
    """Write the report of an identification as one HTML page, without scripts and links.

    Args:
        estimate: of `identify`.
        path: the file.
        command: the command that made it, as of `result.json`; None: none.

    Returns:
        The path written, as given.

    Raises:
        ProblemError: no Estimate.
        FileError: the file cannot be written.
    """
    judged = expect(estimate, Estimate, "estimate").judged
    measured = [one for one in estimate.parameters if one.measured]
    sections = [
        None if judged is None else _torque_section(estimate, judged),
        None if judged is None else _error_section(estimate, judged),
        _unseen_section(estimate),
        Section("numbers", "Measured numbers", _numbers(measured, bars=True), wide=True),
        None if command is None else making_section(command),
    ]
    verdict = _verdict(estimate)
    report = Report(
        title=f"{estimate.robot.name}: identified",
        lead=f"{estimate.robot.nv} joints · {len(measured)} of {len(estimate.parameters)} numbers measured",
        headline=verdict.headline,
        verdict=verdict,
        tiles=tuple(_tiles(estimate)),
        sections=tuple(one for one in sections if one is not None),
    )
    style = asset("report.css") + asset("identification.css")
    return write_whole(path, fill(asset("identification.html"), page_fields(report) | {"style": style}).encode())


def _verdict(estimate: Estimate) -> Verdict:
    """Verdict on an identification."""
    if why := estimate.unfit:
        return Verdict("bad", "Not to be used", f"{why[:1].upper()}{why[1:]}.")
    if estimate.warnings:
        text = ". ".join(f"{one[:1].upper()}{one[1:]}" for one in estimate.warnings)
        return Verdict("fair", "The model differs from the arm of the logs", f"{text}.")
    judged, worse = estimate.judged, []
    if judged is not None:
        joints = zip(estimate.robot.joint_names, judged.before, judged.after, strict=True)
        worse = [joint for joint, before, after in joints if after > before]
    if judged is None:
        return Verdict("fair", "Identified, not judged", "No part of the logs was held out.")
    if worse:
        return Verdict(
            "fair", "Not better in all joints", f"On data held out the fit predicts {', '.join(worse)} worse."
        )
    if estimate.unmoved:
        return Verdict("fair", "A joint did not move", f"The logs determine little of {', '.join(estimate.unmoved)}.")
    better = _total(judged.before) / max(_total(judged.after), 1e-300)
    return Verdict(
        "good", "Identified", f"On data held out the torque errors are {better:.3g} times smaller than before."
    )


def _total(errors: Array) -> float:
    return float(np.sqrt(np.sum(errors**2)))


def _tiles(estimate: Estimate) -> list[Tile]:
    combinations = f"{estimate.measured_combinations} of {estimate.combinations}"
    tiles = [
        Tile("combinations measured", combinations, "that a motion can identify"),
        Tile("condition number", f"{estimate.condition:.3g}", "of the regressor"),
    ]
    if estimate.judged is not None and np.any(estimate.judged.measured):
        whole = _total(estimate.judged.measured)
        before, after = (100 * _total(one) / whole for one in (estimate.judged.before, estimate.judged.after))
        tiles.insert(0, Tile("torque error", f"{after:.3g} %", f"{before:.3g} % before"))
    payload = next((one for one in estimate.parameters if one.name == "mass of payload"), None)
    if payload is not None:
        margin = payload.interval[1] - payload.value
        tiles.insert(0, Tile("payload", f"{payload.value:.4g} kg", f"± {margin:.2g} kg (95 %)"))
    return tiles


def _torque_section(estimate: Estimate, judged: Judged) -> Section:
    """Torques of each joint over the held-out time."""
    keys = [
        element("span", element("i", class_=name), label)
        for name, label in zip(_CURVES, ("measured", "predicted before", "predicted after"), strict=True)
    ]
    every = max(1, len(judged.t) // _POINTS)
    curves = np.stack([judged.torque, judged.prior, judged.fitted])[:, ::every]
    figures = [
        _figure(f"{joint} [{'N' if estimate.robot.slides[j] else 'N m'}]", judged.t[::every], curves[:, :, j])
        for j, joint in enumerate(estimate.robot.joint_names)
    ]
    about = f"The last {judged.t[-1]:.3g} s of the logs, which the fit behind these curves did not see."
    body = [element("p", about, class_="note"), element("p", *keys, class_="legend")]
    body.append(element("div", *figures, class_="torques"))
    return Section("torques", "Torques on data held out", join(body), wide=True)


def _figure(title: str, t: Array, curves: Array) -> Html:
    """Curves of one joint, shape (3, n), as a drawing that scales with the page."""
    low, high = float(np.min(curves)), float(np.max(curves))
    span = max(high - low, 1e-9)
    x = _WIDTH * (t - t[0]) / max(float(t[-1] - t[0]), 1e-9)
    lines = []
    for name, values in zip(_CURVES, curves, strict=True):
        y = _HEIGHT * (0.04 + 0.92 * (high - values) / span)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        lines.append(element("polyline", points=points, class_=name))
    drawing = element(
        "svg", *lines, viewBox=f"0 0 {_WIDTH:g} {_HEIGHT:g}", preserveAspectRatio="none", role="img",
        aria_label=f"torque of {title} over time",
    )  # fmt: skip
    scale = element("span", f"{_signed(low)} to {_signed(high)}")
    ends = element("small", element("span", f"{t[0]:.3g} s"), element("span", f"{t[-1]:.3g} s"))
    return element("figure", element("figcaption", element("b", title), scale), drawing, ends)


def _signed(value: float) -> str:
    return f"{value:.3g}".replace("-", "−")


def _error_section(estimate: Estimate, judged: Judged) -> Section:
    """Root mean square of the torque errors."""
    heads = ("joint", "torque", "error before", "after", "of the torque")
    rows = []
    for j, joint in enumerate(estimate.robot.joint_names):
        torque, before, after = (one[j] for one in (judged.measured, judged.before, judged.after))
        share = td(f"{100 * after / torque:.3g} %" if torque else "–", over=after > before)
        rows.append([joint, *(f"{one:.3g}" for one in (torque, before, after)), share])
    unit = joint_unit(estimate.robot.slides, "N m", "N")
    note = element("p", f"Root mean square on data held out [{unit}].", class_="note")
    return Section("errors", "Torque errors", join([note, stacked(heads, rows)]))


def _numbers(numbers: Sequence[Estimated], *, bars: bool) -> Html:
    """Table of parameters with their confidence, next to the robot's own."""
    if not numbers:
        return element("p", "None: the logs determine no number better than the robot's file.")
    heads = ["number", "file", "identified", "± (95 %)", "unit", *(["<file ◇ and 95 % interval"] if bars else [])]
    rows = []
    for one in numbers:
        margin = f"{one.interval[1] - one.value:.2g}"
        drawn = [element("td", _bar(one), class_="words")] if bars else []
        rows.append([one.name, f"{one.prior:.4g}", f"{one.value:.4g}", margin, one.unit, *drawn])
    return stacked(heads, rows)


def _bar(one: Estimated) -> Html:
    """The 95 % interval, the value and the robot's value on one line."""
    low, high = one.interval
    ends = min(low, one.prior), max(high, one.prior)
    margin = 0.06 * (ends[1] - ends[0]) + 1e-300
    start, span = ends[0] - margin, ends[1] - ends[0] + 2 * margin

    def at(value: float) -> float:
        return 100 * (value - start) / span

    return element(
        "span",
        element("i", style=f"left:{at(low):.1f}%;width:{max(at(high) - at(low), 1.0):.1f}%"),
        element("b", style=f"left:{at(one.value):.1f}%"),
        element("u", "◇", style=f"left:{at(one.prior):.1f}%"),
        class_="interval",
    )


def _unseen_section(estimate: Estimate) -> Section:
    """Section of the parameters that the logs do not determine."""
    unseen = [one for one in estimate.parameters if not one.measured]
    facts = [
        ("joints not moved", ", ".join(estimate.unmoved) or "none"),
        ("combinations", f"{estimate.measured_combinations} of {estimate.combinations} that a motion can identify are "
         "measured; any others stay as in the robot's file"),
        ("noise", ", ".join(f"{one:.2g}" for one in estimate.noise) + " N m (standard deviation, joint by joint)"),
        ("sensor offset", ", ".join(_signed(one) for one in estimate.offset) + " N m: no part of the robot"),
    ]  # fmt: skip
    body = [listed(facts)]
    if unseen:
        note = "The logs take away less than 90 % of the uncertainty of these numbers: they stay near the robot's file."
        table = _numbers(unseen, bars=False)
        title = element("summary", f"Numbers that the logs do not determine ({len(unseen)})")
        body.append(element("details", title, element("p", note), table))
    return Section("unseen", "Not determined by the logs", join(body))
