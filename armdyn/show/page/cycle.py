"""A cycle on a page: its steps under the slider and in a table, and what its conditions cost."""

from __future__ import annotations

from typing import Any

import numpy as np

from armdyn.show.markup import Html, element, join
from armdyn.show.page.facts import Facts
from armdyn.show.page.sections import Section, stacked, td, th
from armdyn.trajectory import Trajectory


def step_data(motion: Trajectory) -> list[dict[str, Any]]:
    """Pieces of a motion for the scripts; empty: it is one piece."""
    if len(motion.pieces) < 2:
        return []
    start, ends = motion.t[0], [*(one.start for one in motion.pieces[1:]), motion.t[-1]]
    return [
        {
            "name": one.name,
            "begin": float(one.start - start),
            "end": float(end - start),
            "rest": bool(np.all(motion.q[(motion.t >= one.start) & (motion.t < end)] == motion(one.start).q)),
            "carries": one.load.mass if one.load else 0.0,
        }
        for one, end in zip(motion.pieces, ends, strict=True)
    ]


def steps_section(facts: Facts) -> Section | None:
    """Table of the steps: time, share, limit that decides, remedy; None: it is no cycle."""
    steps = facts.parts("steps")
    if not steps:
        return None
    head = [
        *map(th, ("step", "time [s]")), th("share of the cycle", class_="words"),
        *(th(name, class_="words") for name in ("carries", "decided by", "what would help")),
    ]  # fmt: skip
    body = [stacked(head, [_row(one) for one in steps])]
    order = [int(x) for x in facts.numbers("order") if x is not None]
    if order != sorted(order):
        body.append(element("p", f"The order {', '.join(map(str, order))} is the fastest one.", class_="note"))
    return Section("steps", "Steps", join(body), wide=True)


def _row(step: Facts) -> list[Html]:
    share, part, number = step.number("share") or 0.0, step.part("carries"), step.number("number") or 0.0
    bar = element("span", element("i", style=f"width:{min(100.0, 100 * share):.2f}%"), class_="share")
    carried = f"{part.text('name')}, {part.number('mass') or 0.0:g} kg" if part.text("name") else "–"
    return [
        th(f"{number:.0f}  {step.text('name')}", "row", data_begin=f"{step.number('begin') or 0.0:.9f}"),
        td(f"{step.number('duration') or 0.0:.3f}"),
        element("td", bar, element("span", f"{100 * share:.0f} %"), class_="words part"),
        *(td(words or "–", class_="words") for words in (carried, step.text("decided_by"), step.text("would_help"))),
    ]


def costs_section(facts: Facts) -> Section | None:
    """Section of the time that each condition of a cycle costs; None: not computed."""
    said = [one.text("said") for one in facts.parts("costs")]
    if not said:
        return None
    return Section("costs", "What each condition costs", element("ul", *(element("li", line) for line in said[:30])))
