"""Verdict on each of the paper's numbers, over all readings of it."""

from collections.abc import Iterable, Sequence

import numpy as np

from armdyn.models.values.spec import PlanarArmName
from armdyn.paper.outcomes.outcome import Outcome
from armdyn.paper.printed.published import TABLE_OF_ARM
from armdyn.paper.tables.columns import paper_column, table_line
from armdyn.paper.tables.rows import Row, Verdict

VERDICTS: tuple[Verdict, ...] = ("reproduced", "close", "not reproduced")
"""Best first."""

Number = tuple[object, ...]


def number_of(row: Row) -> Number:
    """Identity of a number of the paper: table, column and line."""
    return (row.table, paper_column(row), *table_line(row))


def time_of(arm: PlanarArmName, example: int, payload: float) -> Number:
    """Identity of an example's time among the paper's numbers, as in `number_of`.

    Args:
        arm: of the example.
        example: 1 to 6.
        payload: M [kg].
    """
    return (TABLE_OF_ARM[arm], f"Example {example}", f"{1000 * payload:g}")


def standings(rows: Iterable[Row]) -> dict[Number, Verdict]:
    """Best verdict on each of the paper's numbers, over all readings of the paper."""
    best: dict[Number, Verdict] = {}
    for row in rows:
        if row.published is not None:
            before = best.get(number_of(row), VERDICTS[-1])
            best[number_of(row)] = min(before, row.verdict, key=VERDICTS.index)
    return best


def column(rows: Iterable[Row], **wanted: object) -> list[tuple[float, float]]:
    """Pairs of published and computed times, of rows with the given attributes, by increasing payload.

    Args:
        rows: of any tables; totals of torque, other states and other signs than the paper's examples are left out.
        **wanted: attributes of a `Row`.
    """
    times = [row for row in rows if row.table in (4, 5, 6) and not row.setup]
    found = [row for row in times if all(getattr(row, k) == v for k, v in wanted.items())]
    return [
        (row.published, row.ours)
        for row in sorted(found, key=lambda row: row.payload_kg)
        if row.published is not None and row.ours is not None
    ]


def ratios(pairs: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Smallest and largest of published over ours; there must be a pair."""
    each = [published / ours for published, ours in pairs]
    return min(each), max(each)


def rms(pairs: Sequence[tuple[float, float]]) -> float:
    """Root mean square of ours minus published, in their unit; there must be a pair."""
    return float(np.sqrt(np.mean([(ours - published) ** 2 for published, ours in pairs])))


def growths(outcomes: Iterable[Outcome], arm: str) -> list[float]:
    """Largest real parts of the eigenvalues [1/s] of an arm's PID loops at their goal, one per payload, at the tip.

    The loops are those of the paper's example with the mechanics of its arm.
    """
    found = {}
    for outcome in outcomes:
        case, growth = outcome.case, outcome.facts.get("max_real_eigenvalue")
        stated = case.states == "printed" and case.derivative_sign != "printed" and case.variant == "lagrangian"
        if (case.arm, case.kind, case.reading) == (arm, "pid", "tip") and stated and isinstance(growth, float):
            found[case.payload] = growth
    return [found[payload] for payload in sorted(found)]
