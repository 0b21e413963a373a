"""Figures of sweeps: curves over a setting, maps over two settings, Pareto fronts, minimum time over payload."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from armdyn.arrays import Array, Flags
from armdyn.optimal.verify.certificate import GAP_TOLERANCE
from armdyn.reprs import percent
from armdyn.show.figures.style import COLORS, INK, LOOK, literal, one_panel

Row = Mapping[str, Any]
Named = Callable[[str], str]
"""Axis labels by column."""
Kind = Literal["words", "linear", "log"]
"""Values of a setting: words, or numbers on a scale."""

MAX_CURVES = 8
_MAX_PANELS = 4
_COLORS = "viridis"
_MOST, _FAR = 0.9, 3.0
"""Upper quantile of a map's colours, and the ratio of the ranges above which it replaces the largest number."""
_REACH = 0.3
"""A tangent goes this part of the way to the neighbouring payloads."""
_CERTIFIED = f"locally optimal, or proven within {percent(GAP_TOLERANCE)}"
_TICKED = 8
"""Most rows or columns of a map with a tick each."""


def pareto(points: Array) -> Flags:
    """Pareto front of points with two numbers, of which the least is best: a mask of shape (n,).

    Args:
        points: shape (n, 2).
    """
    front = np.zeros(len(points), dtype=bool)
    least = np.inf
    order = np.lexsort((points[:, 1], points[:, 0]))
    for k in order:  # by the first number, and of those alike by the second: only a smaller second one is new
        if points[k, 1] < least:
            least, front[k] = points[k, 1], True
    return front


def plot_curve(
    rows: Sequence[Row], x: str, y: str, by: Sequence[str] = (), *, named: Named = str, log: Collection[str] = (),
    title: str | None = None,
) -> Figure:  # fmt: skip
    """Plot a number over a setting, one curve for each combination of the other settings.

    Args:
        rows: as `study_table` gives them; where the number is None the curve has a gap.
        x: the setting's column.
        y: the number's.
        by: columns that tell curves from each other.
        named: label of a column on the axes.
        log: settings on a logarithmic axis.
        title: above the axes.

    Returns:
        A figure of its own: pyplot knows nothing of it.
    """
    figure, axes = one_panel(title)
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in by), []).append(row)
    for (group, own), color in zip(groups.items(), COLORS, strict=False):
        points = np.array(sorted((row[x], np.nan if row[y] is None else row[y]) for row in own), dtype=float)
        label = ", ".join(
            f"{name} {value if isinstance(value, str) else f'{value:g}'}" for name, value in zip(by, group, strict=True)
        )
        axes.plot(*points.T, "o-", color=color, markersize=3.5, linewidth=1.2, label=label or None)
    axes.set(xlabel=named(x), ylabel=named(y), xscale="log" if x in log else "linear")
    if by:
        axes.legend(loc="best")
    return figure


@rc_context(LOOK)
def plot_map(
    rows: Sequence[Row], x: str, y: str, z: str, panel: str | None = None, *, named: Named = str,
    log: Collection[str] = (), title: str | None = None,
) -> Figure:  # fmt: skip
    """A number over two settings: cells of a grid, else points; of cases that share a place the least.

    Args:
        rows: as `study_table` gives them; cases whose number is None are crosses.
        x: column of the first setting.
        y: of the second.
        z: of the number.
        panel: a column whose values have a panel each; None: one panel for all.
        named: label of a column on the axes.
        log: settings on a logarithmic axis.
        title: above the panels.
    """
    values = list(dict.fromkeys(row[panel] for row in rows))[:_MAX_PANELS] if panel else [None]
    numbers = [row[z] for row in rows if row[z] is not None]
    low, high = _colored(numbers)
    clipped = bool(numbers) and max(numbers) > high
    shared = len({(row[x], row[y], row[panel] if panel else None) for row in rows}) < len(rows)
    text = f"{named(z)}{', least of those at a place' if shared else ''}"
    figure = Figure(figsize=(1.4 + 4.8 * len(values), 4.4), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(values), sharey=True))
    drawn: Any = None
    for axes, value in zip(panels, values, strict=True):
        own = [row for row in rows if panel is None or row[panel] == value]
        axes.set_xscale("log" if x in log else "linear")  # before the ticks, which it would undo
        axes.set_yscale("log" if y in log else "linear")
        drawn = _cells(axes, own, (x, y, z), (low, high), f"no {named(z).partition(' [')[0]}") or drawn
        axes.grid(visible=False)
        axes.set_xlabel(named(x))
        if value is not None:
            axes.set_title(literal(f"{panel} {value}"), fontsize=10)
    panels[0].set_ylabel(named(y))
    if drawn is not None:
        figure.colorbar(drawn, ax=list(panels), label=text, extend="max" if clipped else "neither")
    if title:
        figure.suptitle(literal(title), fontsize=12, fontweight="bold")
    return figure


def plot_pareto(
    rows: Sequence[Row], x: str, y: str, color: str | None = None, *, named: Named = str, log: Collection[str] = (),
    title: str | None = None,
) -> Figure:  # fmt: skip
    """Two numbers of every case against each other, with their Pareto front.

    Args:
        rows: as `study_table` gives them; cases that lack a number are left out.
        x: column of the first number; less is better.
        y: of the second, likewise.
        color: of a setting that colours the cases; None: they are alike.
        named: label of a column on the axes.
        log: settings whose colours are logarithmic.
        title: above the axes.
    """
    figure, axes = one_panel(title)
    whole = [row for row in rows if row[x] is not None and row[y] is not None]
    points = np.array([[row[x], row[y]] for row in whole], dtype=float).reshape(-1, 2)
    front = pareto(points)
    best = points[front][np.argsort(points[front, 0])]
    if color:
        values = [float(row[color]) for row in whole]
        scale = "log" if color in log else "linear"
        drawn = axes.scatter(points[:, 0], points[:, 1], c=values, cmap=_COLORS, norm=scale, s=16, zorder=3)
        figure.colorbar(drawn, ax=axes, label=named(color))
    else:
        axes.scatter(points[:, 0], points[:, 1], color=COLORS[0], s=16, zorder=3)
    axes.plot(
        *best.T, "o-", drawstyle="steps-post", color=COLORS[3], markersize=7, markerfacecolor="none", linewidth=1.2,
        zorder=2, label=f"Pareto front: {len(best)} of {len(points)} cases",
    )  # fmt: skip
    axes.set(xlabel=named(x), ylabel=named(y))
    axes.legend(loc="best")
    return figure


def _colored(numbers: Sequence[float]) -> tuple[float, float]:
    """Range of the colours, without a few numbers far off."""
    if not numbers:
        return 0.0, 1.0
    low, most, high = min(numbers), float(np.quantile(numbers, _MOST)), max(numbers)
    return low, (most if high - low > _FAR * (most - low) > 0 else high)


def _cells(axes: Axes, rows: Sequence[Row], columns: tuple[str, str, str], span: tuple[float, float], none: str) -> Any:
    """One panel; returns the artist of its colour bar, None without one."""
    least: dict[tuple[float, float], float] = {}
    missing: set[tuple[float, float]] = set()
    for row in rows:
        place, number = (float(row[columns[0]]), float(row[columns[1]])), row[columns[2]]
        if number is None:
            missing.add(place)
        else:
            least[place] = min(number, least.get(place, np.inf))
    missing -= least.keys()
    drawn: Any = None
    xs, ys = (np.unique([place[i] for place in [*least, *missing]]) for i in (0, 1))
    if least and len(xs) * len(ys) <= 4 * (len(least) + len(missing)) and min(len(xs), len(ys)) > 1:
        cells = np.full((len(ys), len(xs)), np.nan)
        for (a, b), number in least.items():
            cells[np.searchsorted(ys, b), np.searchsorted(xs, a)] = number
        drawn = axes.pcolormesh(xs, ys, cells, cmap=_COLORS, vmin=span[0], vmax=span[1], shading="nearest")
        for axis, places in ((axes.xaxis, xs), (axes.yaxis, ys)):
            if len(places) <= _TICKED:
                axis.set_ticks(places, [f"{place:g}" for place in places])
    elif least:
        where = np.array(list(least))
        drawn = axes.scatter(
            where[:, 0], where[:, 1], c=list(least.values()), cmap=_COLORS, vmin=span[0], vmax=span[1], s=22
        )
    if missing:
        axes.plot(*np.array(sorted(missing)).T, "x", color=INK, markersize=5, label=none)
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, borderaxespad=0.2)  # on no point
    return drawn


@rc_context(LOOK)
def plot_sweep(rows: Sequence[dict[str, Any]], title: str | None = None) -> Figure:
    """Minimum time over payload, with the slope that each optimum's multipliers give.

    Args:
        rows: of increasing payloads, with the columns of sweep.csv; those that did not land are left out.
        title: above the axes.

    Returns:
        A figure of its own: pyplot knows nothing of it.
    """
    landed = [row for row in rows if row["success"]]
    grams = np.array([1e3 * row["payload_kg"] for row in landed])
    times = np.array([row["duration_s"] for row in landed])
    certified = np.array([row["certified"] for row in landed], dtype=bool)
    figure, axes = one_panel(title, height=4.2)
    axes.plot(grams, times, color=COLORS[0], linewidth=1, alpha=0.5)
    for of, face, word in ((certified, COLORS[0], _CERTIFIED), (~certified, "white", "usable, neither")):
        if np.any(of):
            axes.plot(grams[of], times[of], "o", color=COLORS[0], markerfacecolor=face, label=word, zorder=3)
    slope: str | None = r"slope $\partial t_f/\partial m$ of the multipliers"
    for k, row in enumerate(landed):
        if len(landed) < 2 or not row["certified"] or row["ms_per_gram"] is None:
            continue
        ends = _REACH * (np.array([grams[max(k - 1, 0)], grams[min(k + 1, len(landed) - 1)]]) - grams[k])
        rise = 1e-3 * row["ms_per_gram"] * ends
        axes.plot(grams[k] + ends, times[k] + rise, color=COLORS[1], linewidth=2, zorder=4, label=slope)
        slope = None
    axes.set(xlabel="payload [g]", ylabel="minimum time [s]")
    if landed:
        axes.legend(loc="upper left")
    return figure


def figures_of(
    rows: Sequence[Row],
    settings: Mapping[str, Kind],
    outcomes: tuple[str, str],
    *,
    named: Named = str,
    title: str | None = None,
) -> dict[str, Figure]:
    """The figures that suit a study, by their names: curve, map, pareto; none if no case has a number.

    Args:
        rows: as `study_table` gives them.
        settings: columns that vary, and of which kind they are.
        outcomes: columns of the two numbers that count.
        named: label of a column on the axes.
        title: of all.
    """
    found: dict[str, Figure] = {}
    rows = [{**dict.fromkeys(outcomes), **row} for row in rows]  # of cases that came to nothing, too
    main, second = outcomes
    if all(row[main] is None for row in rows):
        return found
    log = [name for name, kind in settings.items() if kind == "log"]
    levels = {name: len({row[name] for row in rows}) for name in settings}
    numeric = sorted(
        (name for name, kind in settings.items() if kind != "words" and levels[name] > 1), key=lambda one: -levels[one]
    )
    if numeric:
        others = [name for name in settings if name != numeric[0] and levels[name] > 1]
        if np.prod([levels[name] for name in others]) <= MAX_CURVES:
            found["curve"] = plot_curve(rows, numeric[0], main, others, named=named, log=log, title=title)
    if len(numeric) > 1:
        words = next((name for name, kind in settings.items() if kind == "words" and levels[name] > 1), None)
        found["map"] = plot_map(rows, numeric[0], numeric[1], main, words, named=named, log=log, title=title)
    if sum(row[main] is not None and row[second] is not None for row in rows) > 2:
        color = numeric[0] if numeric else None
        found["pareto"] = plot_pareto(rows, main, second, color, named=named, log=log, title=title)
    return found
