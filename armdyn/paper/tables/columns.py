"""Tables 3 to 7 as the paper lays them out: in which line and in which column a row stands."""

from collections.abc import Sequence

from armdyn.paper.tables.rows import Row

TITLES = {
    3: "First approach for a robot with one arm",
    4: "Total time [s] for the R-type manipulator robot",
    5: "Total time [s] for the RR-type manipulator robot",
    6: "Total time [s] for the RRR-type manipulator robot",
    7: "Total torque [N m s] for Examples 1 to 6 with 100.6 g",
}


def with_numbers(rows: Sequence[Row]) -> list[Row]:
    """Rows without those of variants that have not come to a single number, as loops that never settle."""
    filled = {our_column(row) for row in rows if row.ours is not None}
    return [row for row in rows if not row.setup or our_column(row) in filled]


def table_line(row: Row) -> tuple[object, ...]:
    """Leading cells of a row: the payload, or in Table 7 robot, example and torque."""
    if row.table != 7:
        return (f"{1000 * row.payload_kg:g}",)
    return row.arm.upper(), row.example, f"τ{row.quantity.removeprefix('torque_integral_j').removesuffix('_nms')}"


def paper_column(row: Row) -> str:
    """The paper's column to the left of a row's; none in Table 7."""
    if row.table == 3:
        return {"switch_interval_s": "2π/r", "switch_torque_nm": "k/det"}[row.quantity]
    return "" if row.table == 7 else f"Example {row.example}"


def our_column(row: Row) -> str:
    """Model and arrival rule behind our number in a row."""
    if row.table == 3:
        formula = {"switch_interval_s": "π/√|r|", "switch_torque_nm": "τ limit"}[row.quantity]
        return f"{'as printed' if row.variant == 'printed' else formula}, {row.reading}"
    what = {"minimum_time": "minimum", "time_energy": "time–energy", "pid": "PID", None: ""}[row.kind]
    equations = ["(7) as printed"] if row.variant == "printed" else []
    return ", ".join([what, row.reading, *equations, *([row.setup] if row.setup else [])])
