"""Figures 2 to 7 of the paper, computed: (a) position, (b) velocity, (c) torque over time."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from armdyn.paper.claims.traits import Traits
from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.outcome import Outcome, by_case
from armdyn.paper.printed import published
from armdyn.paper.printed.examples import EXAMPLES, PAYLOAD
from armdyn.show.figures.style import COLORS
from armdyn.show.plots import laid_out, plot_panels, put_head, run_handles, save_figure, svg_text, switches

EXAMPLE_OF_FIGURE = {2: 1, 3: 4, 4: 2, 5: 5, 6: 3, 7: 6}
"""Worked example of each of the paper's figures."""

MARK = "#a3195b"
"""Colour of the paper's numbers."""

_MARK_STYLE = (0, (6, 2, 1, 2))
_READINGS = {"tip": "payload at the tip", "mM": "m → m + M"}


@dataclass(frozen=True)
class PaperFigure:
    """One of Figures 2 to 7.

    Attributes:
        number: the paper's.
        outcomes: the drawn outcomes, solid first.
        published: the paper's t_f or time of arrival [s]; None for a payload that its tables do not have.
    """

    number: int
    outcomes: tuple[Outcome, ...]
    published: float | None

    @property
    def case(self) -> Case:
        """Payload of the solid curves."""
        return self.outcomes[0].case

    @property
    def title(self) -> str:
        """Above the panels."""
        what = "PID loop" if self.case.kind == "pid" else "time optimal, payload at the tip"
        grams = f"M = {1000 * self.case.payload:g} g"
        return f"Figure {self.number} (Example {self.case.example}): {self.case.arm.upper()}, {what}, {grams}"

    @property
    def caption(self) -> str:
        """Caption: motions, durations, switching times."""
        parts = []
        for outcome, style in zip(self.outcomes, ("Solid", "Dashed", "Dotted"), strict=False):
            parts.append(f"{style}: {_duration_words(outcome)}.")
            if outcome.case.kind == "minimum_time":
                parts += [
                    f"Torque {i + 1} switches at {', '.join(f'{t:.5f}' for t in times)} s."
                    for i, times in enumerate(switches(outcome.trajectory) if outcome.trajectory else ())
                    if times
                ]
                if not outcome.facts.get("certified", True):
                    parts.append(f"Not proven optimal: {outcome.facts['why_not_certified']}.")
            if outcome.case.variant == "printed" and outcome.trajectory is not None:
                traits = Traits.of(outcome.trajectory, outcome.case.q_goal)
                fastest = max(abs(v) for pair in traits.velocity for v in pair)
                parts.append(
                    f"It leaves the panels, with up to {fastest:.0f} rad/s and {max(traits.peak_torque):.0f} N m."
                )
        if self.case.kind == "pid" and any(outcome.time is not None for outcome in self.outcomes):
            parts.append("A dot on joint 1 marks the arrival.")
        if self.published is not None:
            parts.append(f"The paper gives {self.published:g} s (vertical line). Goals are dotted.")
        return " ".join(parts)


def paper_figures(outcomes: Iterable[Outcome], payload: float = PAYLOAD) -> tuple[PaperFigure, ...]:
    """Figures 2 to 7, as far as the outcomes suffice, with their curves.

    A time-optimal figure has the minimum time (solid) and the time-energy optimum (dashed), payload at the
    tip. A PID figure has the loop with the payload at the tip (solid) and read as m → m + M (dashed); that of
    RRR also has equation (7) as printed, which settles where the arm's mechanics do not (dotted).

    Args:
        outcomes: of any cases, in any order; those without a trajectory are left out.
        payload: M [kg].
    """
    found = by_case(outcome for outcome in outcomes if outcome.trajectory is not None)
    figures = []
    for number, example in EXAMPLE_OF_FIGURE.items():
        drawn = tuple(found[case] for case in drawn_cases(number, payload) if case in found)
        if drawn:
            said = published.printed_time(example, payload)
            figures.append(PaperFigure(number, drawn, None if said is None else said.value))
    return tuple(figures)


def draw(figure: PaperFigure) -> Figure:
    """The three panels, with units, goal, torque limits, switching times and the paper's time.

    Returns:
        A figure of its own: pyplot knows nothing of it.
    """
    case = figure.case
    motions = [outcome.trajectory for outcome in figure.outcomes if outcome.trajectory is not None]
    unresolved = [k for k, outcome in enumerate(figure.outcomes) if outcome.case.kind != "minimum_time"]
    drawn = plot_panels(motions, case.robot().limits, unresolved)
    panels = drawn.axes[:3]
    for panel, letter in zip(panels, "abc", strict=True):
        panel.set_ylabel(f"({letter}) {panel.get_ylabel()}")
    for joint, angle in enumerate(case.q_goal):
        panels[0].axhline(angle, color=COLORS[joint], linewidth=0.9, linestyle=(0, (1, 2)), zorder=1)
    for outcome, motion in zip(figure.outcomes, motions, strict=True):
        if case.kind == "pid" and outcome.time is not None:
            fill = COLORS[0] if outcome is figure.outcomes[0] else "white"
            here = motion(outcome.time).q[:1]
            panels[0].plot([outcome.time], here, "o", color=COLORS[0], markerfacecolor=fill, markersize=5, zorder=4)
    _fit_mechanics(panels, figure)
    _mark_published(panels, figure)
    _put_head(drawn, figure)
    return drawn


@dataclass(frozen=True)
class Picture:
    """One of Figures 2 to 7, drawn.

    Attributes:
        figure: its content.
        svg: as a text.
        files: as which it is on disk.
    """

    figure: PaperFigure
    svg: str
    files: tuple[Path, ...]


def picture(folder: Path, figure: PaperFigure) -> Picture:
    """Draw a figure, and write figureK.pdf and figureK.png.

    Args:
        folder: made if it is not there.
        figure: from `paper_figures`.

    Raises:
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    drawn = draw(figure)
    with laid_out(drawn):
        files = [save_figure(drawn, folder / f"figure{figure.number}.{suffix}") for suffix in ("pdf", "png")]
        return Picture(figure, svg_text(drawn), tuple(files))


def label(case: Case) -> str:
    """Legend text that distinguishes a curve from the others of its figure."""
    if case.kind != "pid":
        return case.kind.replace("_", " ") if case.kind == "minimum_time" else "time-energy"
    return "(7) as printed" if case.variant == "printed" else _READINGS[case.reading]


def drawn_cases(number: int, payload: float) -> tuple[Case, ...]:
    """The cases that a figure shows, solid first, under the paper's arrival rule.

    Args:
        number: the paper's.
        payload: M [kg].
    """
    example = EXAMPLE_OF_FIGURE[number]
    arm = EXAMPLES[example - 1].arm
    if EXAMPLES[example - 1].kind != "pid":
        return (Case(example, arm, "minimum_time", payload), Case(example, arm, "time_energy", payload))
    loops = (Case(example, arm, "pid", payload), Case(example, arm, "pid", payload, reading="mM"))
    return (*loops, Case(example, arm, "pid", payload, "mM", "printed")) if arm == "rrr" else loops


def _fit_mechanics(panels: Sequence[Axes], figure: PaperFigure) -> None:
    """Scale the panels by the motions of the corrected equations: those of (7) as printed are far larger."""
    own = [o.trajectory for o in figure.outcomes if o.case.variant == "lagrangian" and o.trajectory is not None]
    if not own or len(own) == len(figure.outcomes):
        return
    for panel, name in zip(panels, ("q", "v", "tau"), strict=True):
        values = np.concatenate([getattr(motion, name) for motion in own])
        low, high = float(values.min()), float(values.max())
        panel.set_ylim(low - 0.3 * (high - low), high + 0.3 * (high - low))


def _duration_words(outcome: Outcome) -> str:
    return f"{label(outcome.case)}, " + ("no arrival" if outcome.time is None else f"{outcome.time:.4g} s")


def _mark_published(panels: Sequence[Axes], figure: PaperFigure) -> None:
    if figure.published is None:
        return
    start, end = panels[0].get_xlim()
    panels[0].set_xlim(start, max(end, figure.published + 0.02 * (end - start)))
    for panel in panels:
        panel.axvline(figure.published, color=MARK, linewidth=1.1, linestyle=_MARK_STYLE, zorder=2)


def _put_head(drawn: Figure, figure: PaperFigure) -> None:
    handles = run_handles([_duration_words(outcome) for outcome in figure.outcomes])
    if figure.published is not None:
        text = f"published, {figure.published:g} s"
        handles.append(Line2D([], [], color=MARK, linestyle=_MARK_STYLE, linewidth=1.1, label=text))
    put_head(drawn, figure.title, handles)
