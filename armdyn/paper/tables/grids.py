"""Tables to print: Tables 3 to 7 in the paper's layout, and further ones."""

from collections.abc import Sequence

from armdyn.paper.claims.feasibility import all_holdings, largest_payload
from armdyn.paper.claims.first_approach import all_linearisations
from armdyn.paper.outcomes.case import READINGS
from armdyn.paper.printed.examples import PAYLOADS
from armdyn.paper.printed.published import LARGEST_PAYLOAD
from armdyn.paper.tables.columns import TITLES, our_column, paper_column, table_line, with_numbers
from armdyn.paper.tables.rows import Row
from armdyn.paper.tables.text_tables import Grid

_MARKS = {"reproduced": "✓", "close": "≈", "not reproduced": ""}
_LEGEND = "✓ reproduced, ≈ within 2 %; – none; tip, mM: where the payload is"


def grid(rows: Sequence[Row]) -> Grid:
    """One of Tables 3 to 7 in the paper's layout: its columns, each followed by ours."""
    table = rows[0].table
    rows = with_numbers(rows)
    lines = list(dict.fromkeys(table_line(row) for row in rows))
    heads = ("robot", "example", "torque") if table == 7 else ("M [g]",)
    columns = list(dict.fromkeys((paper_column(row), our_column(row)) for row in rows))
    columns.sort(key=lambda column: column[0])
    header, body = list(heads), [[str(x) for x in key] for key in lines]
    shown = None
    for paper, ours in columns:
        own = {table_line(row): row for row in rows if (paper_column(row), our_column(row)) == (paper, ours)}
        if paper != shown:
            shown, whole = paper, {table_line(row): row for row in rows if paper_column(row) == paper}
            header.append(f"{paper} published".strip())
            for cells, key in zip(body, lines, strict=True):
                cells.append(_number(whole[key].published) if key in whole else "–")
        header.append(ours)
        for cells, key in zip(body, lines, strict=True):
            cells.append(f"{_number(own[key].ours)} {_MARKS[own[key].verdict]}".strip() if key in own else "–")
    return Grid(f"Table {table}: {TITLES[table]}", tuple(header), tuple(map(tuple, body)), _LEGEND)


def feasibility_grid() -> Grid:
    """Holding torque of every arm at its goal, and the largest payload that it can hold."""
    found = {(h.arm, h.payload, h.reading): h for h in all_holdings()}
    arms = list(dict.fromkeys(arm for arm, *_ in found))
    header = ["M [g]", *(f"{arm.upper()} {reading}" for arm in arms for reading in READINGS)]
    body = [
        [
            f"{1000 * m:g}",
            *(
                _holding(found[arm, m, reading].torque, found[arm, m, reading].possible)
                for arm in arms
                for reading in READINGS
            ),
        ]
        for m in PAYLOADS
    ]
    body.append(["largest", *(f"{1000 * largest_payload(arm, r):.1f} g" for arm in arms for r in READINGS)])
    note = (
        f"Torques of the joints; ✗: beyond ±3 N m. The paper's conclusion, up to {LARGEST_PAYLOAD:g} kg, holds of R; "
        "a rest-to-rest motion to the goal may exist all the same."
    )
    return Grid("Torque that holds the goal [N m]", tuple(header), tuple(map(tuple, body)), note)


def first_approach_grid() -> Grid:
    """Error of the linearised link."""
    header = (
        "M [g]", "reading", "linearised t_f [s]", "switch [s]", "true minimum [s]", "difference",
        "its torque misses by [rad]", "[rad/s]",
    )  # fmt: skip
    body = []
    for one in all_linearisations():
        ours, exact = one.linearised.duration, one.exact.duration
        switches = ", ".join(f"{t:.6f}" for t in one.linearised.switches)
        body.append(
            (
                f"{1000 * one.payload:g}", one.reading, f"{ours:.6f}", switches, f"{exact:.6f}",
                f"{ours / exact - 1:+.1%}", f"{one.miss[0]:+.3f}", f"{one.miss[1]:+.2f}",
            )
        )  # fmt: skip
    note = (
        "Both from -π/2 to π/20 under ±3 N m. "
        "The linearisation takes cos θ for θ + π/2, 1.73 at the goal where it is 0.99."
    )
    return Grid("The first approach, corrected, against the true minimum time", header, tuple(body), note)


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.4f}"


def _holding(torque: Sequence[float], possible: bool) -> str:
    return ", ".join(f"{x:.3f}" for x in torque) + ("" if possible else " ✗")
