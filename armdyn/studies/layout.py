"""Tables on disk: CSV for machines, Markdown and LaTeX in the paper's layout."""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from armdyn.files import write_whole
from armdyn.models.spec import PAPER_PAYLOADS
from armdyn.studies.cases import READINGS, Outcome
from armdyn.studies.feasibility import all_holdings, largest_payload
from armdyn.studies.first_approach import Linearisation, linearisation
from armdyn.studies.published import LARGEST_PAYLOAD
from armdyn.studies.tables import Row

TITLES = {
    3: "First approach for a robot with one arm",
    4: "Total time [s] for the R-type manipulator robot",
    5: "Total time [s] for the RR-type manipulator robot",
    6: "Total time [s] for the RRR-type manipulator robot",
    7: "Total torque [N m s] for Examples 1 to 6 with 100.6 g",
}
_MARKS = {"reproduced": "✓", "close": "≈", "not reproduced": ""}
_LEGEND = "✓ reproduced, ≈ within 2 %; – none; tip, mM: where the payload is"


@dataclass(frozen=True)
class Grid:
    """A table to print.

    Attributes:
        title: above it.
        header: one text per column.
        body: rows of texts.
        note: below it.
    """

    title: str
    header: tuple[str, ...]
    body: tuple[tuple[str, ...], ...]
    note: str = ""

    def markdown(self) -> str:
        """As GitHub shows it."""
        lines = [self.header, tuple("---:" for _ in self.header), *self.body]
        table = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
        return f"**{self.title}**\n\n{table}\n" + (f"\n{self.note}\n" if self.note else "")

    def latex(self) -> str:
        """A table environment that needs no package."""
        lines = [" & ".join(_tex(cell) for cell in line) + r" \\" for line in (self.header, *self.body)]
        return "\n".join(
            [
                r"\begin{table}",
                rf"\caption{{{_tex(self.title)}}}",
                rf"\begin{{tabular}}{{{'r' * len(self.header)}}}",
                r"\hline",
                lines[0],
                r"\hline",
                *lines[1:],
                r"\hline",
                r"\end{tabular}",
                *([rf"\par\smallskip {_tex(self.note)}"] if self.note else []),
                r"\end{table}",
                "",
            ]
        )


def write_tables(folder: Path, rows: Sequence[Row]) -> list[Path]:
    """Write tableK.csv, .md and .tex of every table that has rows, and variants.csv.

    tableK.csv has the cases as the paper states them; variants.csv those of other states or the printed sign.

    Args:
        folder: made if it is not there.
        rows: of any tables.

    Raises:
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for table in sorted({row.table for row in rows}):
        own = [row for row in rows if row.table == table]
        stated = [row for row in own if not row.setup]
        files.append(write_whole(folder / f"table{table}.csv", csv_of(stated).encode()))
        files += _write_grid(folder, f"table{table}", grid(own))
    variants = [row for row in rows if row.setup]
    return [*files, write_whole(folder / "variants.csv", csv_of(variants).encode())] if variants else files


def write_findings(folder: Path) -> list[Path]:
    """Write feasibility and first_approach, .csv, .md and .tex: what the paper does not have.

    Args:
        folder: made if it is not there.

    Raises:
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    holdings = [("arm", "payload_kg", "reading", "joint", "torque_nm", "limit_nm")] + [
        (one.arm, one.payload, one.reading, joint, torque, limit)
        for one in all_holdings()
        for joint, (torque, limit) in enumerate(zip(one.torque, one.limit, strict=True), 1)
    ]
    laws = [("payload_kg", "reading", "linearised_s", "minimum_time_s", "miss_rad", "miss_rad_per_s")] + [
        (one.payload, one.reading, one.linearised.duration, one.exact.duration, *one.miss) for one in _linearisations()
    ]
    return [
        write_whole(folder / "feasibility.csv", _csv(holdings).encode()),
        *_write_grid(folder, "feasibility", feasibility_grid()),
        write_whole(folder / "first_approach.csv", _csv(laws).encode()),
        *_write_grid(folder, "first_approach", first_approach_grid()),
    ]


def write_methods(folder: Path, outcomes: Iterable[Outcome]) -> list[Path]:
    """Write two_methods.csv: the direct and the indirect answer of every case that was solved by both.

    Args:
        folder: made if it is not there.
        outcomes: of any cases.

    Raises:
        OSError: the folder cannot be written.
    """
    names = [f"{name}_difference" for name in ("duration", "q", "v", "tau", "costate_q", "costate_v")]
    heads = ("arm", "payload_kg", "reading", "kind", "direct_s", "indirect_s", "hamiltonian_spread", *names)
    lines = [
        (
            one.case.arm, one.case.payload, one.case.reading, one.case.kind, one.time, one.facts["indirect_time_s"],
            one.facts["indirect_hamiltonian_spread"], *(one.facts.get(f"indirect_{name}") for name in names),
        )
        for one in outcomes
        if one.facts.get("indirect_time_s") is not None
    ]  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    return [write_whole(folder / "two_methods.csv", _csv([heads, *lines]).encode())] if lines else []


def csv_of(rows: Sequence[Row]) -> str:
    """Rows in full precision; an empty cell is a missing number."""
    names = [field.name for field in fields(Row)]
    first = ["arm", "payload_kg", "reading", "variant", "quantity", "published", "ours", "verdict", "reason"]
    order = [*first, *(name for name in names if name not in first)]
    return _csv([order, *([getattr(row, name) for name in order] for row in rows)])


def _csv(lines: Iterable[Sequence[object]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([_cell(cell) for cell in line] for line in lines)
    return text.getvalue()


def with_numbers(rows: Sequence[Row]) -> list[Row]:
    """Rows without those of variants that have not come to a single number, as loops that never settle."""
    filled = {our_column(row) for row in rows if row.ours is not None}
    return [row for row in rows if not row.setup or our_column(row) in filled]


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
    """What holds every arm at its goal, and the largest payload that can be held."""
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
        for m in PAPER_PAYLOADS
    ]
    body.append(["largest", *(f"{1000 * largest_payload(arm, r):.1f} g" for arm in arms for r in READINGS)])
    note = (
        f"Torques of the joints; ✗: beyond ±3 N m. The paper's conclusion, up to {LARGEST_PAYLOAD:g} kg, holds of R; "
        "a rest-to-rest motion to the goal may exist all the same."
    )
    return Grid("Torque that holds the goal [N m]", tuple(header), tuple(map(tuple, body)), note)


def first_approach_grid() -> Grid:
    """How far the linearised link is from the true one."""
    header = (
        "M [g]", "reading", "linearised t_f [s]", "switch [s]", "true minimum [s]", "difference",
        "its torque misses by [rad]", "[rad/s]",
    )  # fmt: skip
    body = []
    for one in _linearisations():
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
    return Grid("The first approach, put right, beside the true minimum time", header, tuple(body), note)


def _linearisations() -> list[Linearisation]:
    return [linearisation(payload, reading) for reading in READINGS for payload in PAPER_PAYLOADS]


def _write_grid(folder: Path, name: str, one: Grid) -> list[Path]:
    return [
        write_whole(folder / f"{name}.md", one.markdown().encode()),
        write_whole(folder / f"{name}.tex", one.latex().encode()),
    ]


def table_line(row: Row) -> tuple[object, ...]:
    """The first cells of the line that a row is in: the payload, or in Table 7 robot, example and torque."""
    if row.table != 7:
        return (f"{1000 * row.payload_kg:g}",)
    return row.arm.upper(), row.example, f"τ{row.quantity.removeprefix('torque_integral_j').removesuffix('_nms')}"


def paper_column(row: Row) -> str:
    """The paper's column that a row stands beside; none in Table 7."""
    if row.table == 3:
        return {"switch_interval_s": "2π/r", "switch_torque_nm": "k/det"}[row.quantity]
    return "" if row.table == 7 else f"Example {row.example}"


def our_column(row: Row) -> str:
    """What a row's number was computed as."""
    if row.table == 3:
        formula = {"switch_interval_s": "π/√|r|", "switch_torque_nm": "τ limit"}[row.quantity]
        return f"{'as printed' if row.variant == 'printed' else formula}, {row.reading}"
    what = {"minimum_time": "minimum", "time_energy": "time–energy", "pid": "PID", None: ""}[row.kind]
    equations = ["(7) as printed"] if row.variant == "printed" else []
    return ", ".join([what, row.reading, *equations, *([row.setup] if row.setup else [])])


def _cell(value: object) -> object:
    """For CSV, which writes numbers as Python prints them."""
    return "" if value is None else repr(float(value)) if isinstance(value, float) else value


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.4f}"


def _holding(torque: Sequence[float], possible: bool) -> str:
    return ", ".join(f"{x:.3f}" for x in torque) + ("" if possible else " ✗")


def _tex(text: str) -> str:
    for plain, tex in {
        "_": r"\_", "%": r"\%", "√|r|": r"$\sqrt{|r|}$", "±": r"$\pm$", "✓": r"$\surd$", "≈": r"$\approx$",
        "✗": r"$\times$", "–": "--", "π": r"$\pi$", "τ": r"$\tau$", "θ": r"$\theta$",
    }.items():  # fmt: skip
        text = text.replace(plain, tex)
    return text
