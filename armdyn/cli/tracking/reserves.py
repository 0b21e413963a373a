"""How much torque a motion leaves to feedback, when a command chooses it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armdyn.studies.reserve import ReserveCurve, Settling


def reserve_facts(curve: ReserveCurve | None) -> dict[str, object]:
    """A reserve curve for machines; empty without one."""
    if curve is None:
        return {}
    best = curve.best
    return {
        "for_tracking": {"best": None if best is None else best.facts(), "rows": [row.facts() for row in curve.rows]}
    }


def reserve_choice(curve: ReserveCurve | None) -> dict[str, str]:
    """The same for people: what was chosen, and what each reserve gives."""
    if curve is None:
        return {}
    best = curve.best
    if best is None:
        return {"for tracking": "no reserve has a usable motion"}
    count = len(curve.plants)
    lines = ["      motion    mean   worst  settled [s]"]
    lines += [f"{row.reserve:<5g} {row.duration:.4f}  {_settled(row)}" for row in curve.rows]
    told = f"reserve {best.reserve:g}: the last of {count} arms settles after {best.worst:.3f} s"
    return {"for tracking": told, "by reserve": "\n".join(lines)}


def write_reserves(curve: ReserveCurve | None, folder: Path, title: str) -> list[Path]:
    """The curve's figure, reserve.png; none without a row."""
    if curve is None or not curve.rows:
        return []
    from armdyn.show.figures.reserve_curve import plot_reserves
    from armdyn.show.plots import save_figure

    return [save_figure(plot_reserves([row.facts() for row in curve.rows], title), folder / "reserve.png")]


def _settled(row: Settling) -> str:
    if math.isfinite(row.worst):
        return f"{row.mean:6.3f}  {row.worst:6.3f}"
    return f"{row.count} of {len(row.settled)} settle"
