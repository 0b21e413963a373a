"""Tables on disk: CSV, and Markdown and LaTeX in the paper's layout."""

from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path

from armdyn.files import write_whole
from armdyn.paper.claims.feasibility import all_holdings
from armdyn.paper.claims.first_approach import all_linearisations
from armdyn.paper.outcomes.outcome import Outcome
from armdyn.paper.tables.grids import feasibility_grid, first_approach_grid, grid
from armdyn.paper.tables.rows import Row
from armdyn.paper.tables.text_tables import csv_text, write_grid


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
        files += write_grid(folder, f"table{table}", grid(own))
    variants = [row for row in rows if row.setup]
    return [*files, write_whole(folder / "variants.csv", csv_of(variants).encode())] if variants else files


def write_findings(folder: Path) -> list[Path]:
    """Write feasibility and first_approach, .csv, .md and .tex, which the paper lacks.

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
        (one.payload, one.reading, one.linearised.duration, one.exact.duration, *one.miss)
        for one in all_linearisations()
    ]
    return [
        write_whole(folder / "feasibility.csv", csv_text(holdings).encode()),
        *write_grid(folder, "feasibility", feasibility_grid()),
        write_whole(folder / "first_approach.csv", csv_text(laws).encode()),
        *write_grid(folder, "first_approach", first_approach_grid()),
    ]


def write_methods(folder: Path, outcomes: Iterable[Outcome]) -> list[Path]:
    """Write two_methods.csv: the direct and the indirect solution of every case that was solved by both.

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
    return [write_whole(folder / "two_methods.csv", csv_text([heads, *lines]).encode())] if lines else []


def csv_of(rows: Sequence[Row]) -> str:
    """Rows in full precision; an empty cell is a missing number."""
    names = [field.name for field in fields(Row)]
    first = ["arm", "payload_kg", "reading", "variant", "quantity", "published", "ours", "verdict", "reason"]
    order = [*first, *(name for name in names if name not in first)]
    return csv_text([order, *([getattr(row, name) for name in order] for row in rows)])
