"""Tables 3 to 7 of the paper as rows: published against computed, with a verdict and its reason."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from armdyn.models.values.spec import PlanarArmName
from armdyn.paper.claims.first_approach import OneLink, printed_law
from armdyn.paper.outcomes.case import READINGS, Case, Reading, Variant
from armdyn.paper.outcomes.outcome import Outcome
from armdyn.paper.printed import published
from armdyn.paper.printed.examples import PAYLOADS, Kind
from armdyn.paper.printed.loop import PAPER_RULE
from armdyn.paper.printed.published import TABLE_OF_ARM, Printed
from armdyn.paper.tables.integrals import torque_integral, trapezoidal_integral

Verdict = Literal["reproduced", "close", "not reproduced"]

ARRIVAL_TOLERANCE = 0.01
"""Difference of an arrival time [s] that counts as reproduced. The paper samples its loops at a step that it does
not state; the nine payloads up to 500 g of Table 4, which follow its rule, differ by at most this."""
CLOSE = 0.02
"""Relative difference that counts as close: neighbouring payloads of the paper's columns differ by about as much."""

TRAPEZOID_STEP = 1e-3
"""Of (35) [s]. The paper prints (t_f - t_0)/N = 1, a step longer than its minimum times."""

QUANTITY_OF_KIND: dict[Kind, str] = {
    "minimum_time": "minimum_time_s",
    "time_energy": "time_energy_s",
    "pid": "pid_arrival_s",
}


@dataclass(frozen=True, kw_only=True)
class Row:
    """One number of the paper and ours.

    Attributes:
        table: 3 to 7.
        arm: of the paper.
        payload_kg: M [kg].
        reading: where the payload is.
        variant: equations of motion, in Table 3 the law's formulas.
        quantity: its name, with its unit.
        published: None where the paper has none.
        ours: None where there is none; `reason` says why.
        verdict: see `judge`.
        reason: of the verdict, in words.
        example: 1 to 6.
        kind: how our number came about; None in Table 3.
        setup: other states or another sign than the case's default, in words; mostly empty.
        trapezoid: Table 7's number by (35) with the step `TRAPEZOID_STEP` [N m s].
        indirect: t_f by the indirect method, for R and RR [s].
    """

    table: int
    arm: PlanarArmName
    payload_kg: float
    reading: Reading
    variant: Variant
    quantity: str
    published: float | None
    ours: float | None
    verdict: Verdict
    reason: str
    example: int
    kind: Kind | None = None
    setup: str = ""
    trapezoid: float | None = None
    indirect: float | None = None


def judge(printed: Printed | None, ours: float | None, tolerance: float = 0.0) -> Verdict:
    """Agreement of our number with a published one.

    Args:
        printed: the published number; None is not reproduced.
        ours: None is not reproduced.
        tolerance: "reproduced" is within this or one unit of the last printed digit, whichever is larger: a
            whole unit, as Tables 4 to 6 cut off digits where they should round. "close" is within `CLOSE`.
    """
    if printed is None or ours is None:
        return "not reproduced"
    difference = abs(ours - printed.value)
    if difference <= max(tolerance, printed.unit) * (1 + 1e-9):
        return "reproduced"
    return "close" if difference <= CLOSE * abs(printed.value) else "not reproduced"


def all_rows(outcomes: Iterable[Outcome], payloads: Sequence[float] = PAYLOADS) -> list[Row]:
    """Tables 3 to 7, as far as the outcomes go.

    Args:
        outcomes: of any cases.
        payloads: of Table 3, which needs no outcome [kg].
    """
    outcomes = list(outcomes)
    rows = [*table_3(payloads), *(time_row(outcome) for outcome in outcomes)]
    for outcome in outcomes:
        rows += torque_rows(outcome)
    return _with_columns(sorted(rows, key=lambda row: (row.table, row.example, row.payload_kg)))


def table_3(payloads: Sequence[float] = PAYLOADS) -> list[Row]:
    """Table 3: by the printed formulas, and by the corrected law."""
    return [row for payload in payloads for reading in READINGS for row in _first_approach(payload, reading)]


def _first_approach(payload: float, reading: Reading) -> list[Row]:
    link = OneLink.of(payload, reading)
    law, printed = printed_law(link), published.switching(payload) or (None, None)
    by_variant: dict[Variant, tuple[tuple[float, str], tuple[float, str]]] = {
        "printed": (
            (law.interval, "2π/|r| by the printed formula"),
            (
                law.amplitude(law.interval),
                "k/det by the printed formula at t = 2π/|r|, where det = 1; its unit is not N m",
            ),
        ),
        "lagrangian": (
            (np.pi / link.omega, "π/√|r|: the switching period of the linearised link's torque"),
            (link.torque_limit, "the torque limit: a bang-bang torque is on it"),
        ),
    }
    return [
        Row(
            table=3, arm="r", payload_kg=payload, reading=reading, variant=variant, quantity=quantity,
            published=_value(number), ours=float(ours), verdict=judge(number, ours), reason=reason, example=1,
        )
        for variant, entries in by_variant.items()
        for quantity, number, (ours, reason) in zip(
            ("switch_interval_s", "switch_torque_nm"), printed, entries, strict=True
        )
    ]  # fmt: skip


def time_row(outcome: Outcome) -> Row:
    """An outcome's time in Table 4, 5 or 6."""
    case, ours = outcome.case, outcome.time
    printed = published.printed_time(case.example, case.payload)
    indirect = outcome.facts.get("indirect_time_s")
    return Row(
        table=TABLE_OF_ARM[case.arm],
        arm=case.arm,
        payload_kg=case.payload,
        reading=case.reading,
        variant=case.variant,
        quantity=QUANTITY_OF_KIND[case.kind],
        published=_value(printed),
        ours=ours,
        verdict=judge(printed, ours, ARRIVAL_TOLERANCE if case.kind == "pid" else 0.0),
        reason=_reason(outcome, printed),
        example=case.example,
        kind=case.kind,
        setup=setup(case),
        indirect=indirect if isinstance(indirect, float) else None,
    )


def torque_rows(outcome: Outcome) -> list[Row]:
    """An outcome's ∫ |τ| dt in Table 7, of every joint, up to t_f or the arrival; none for other payloads than its."""
    case, motion = outcome.case, outcome.trajectory
    printed = published.total_torque(case.example, case.payload)
    if printed is None or motion is None:
        return []
    ours: list[float | None] = [None] * len(printed)
    trapezoids = list(ours)
    if outcome.time is None:
        reason = _reason(outcome, None)
    else:
        ours = [float(x) for x in torque_integral(motion, outcome.time)]
        trapezoids = [float(x) for x in trapezoidal_integral(motion, outcome.time, step=TRAPEZOID_STEP)]
        reason = f"up to {outcome.time:.4g} s, by quadrature between the torque's zeros; (35) at {TRAPEZOID_STEP:g} s"
    return [
        Row(
            table=7,
            arm=case.arm,
            payload_kg=case.payload,
            reading=case.reading,
            variant=case.variant,
            quantity=f"torque_integral_j{joint}_nms",
            published=number.value,
            ours=value,
            verdict=judge(number, value),
            reason=reason,
            example=case.example,
            kind=case.kind,
            setup=setup(case),
            trapezoid=trapezoid,
        )
        for joint, (number, value, trapezoid) in enumerate(zip(printed, ours, trapezoids, strict=True), 1)
    ]


def setup(case: Case) -> str:
    """Other states or another sign than the case's default, in words; empty if it has none."""
    parts = ["Example 2's states"] if case.states != "printed" else []
    parts += ["+ k_D as printed"] if case.derivative_sign == "printed" else []
    return ", ".join(parts)


def _reason(outcome: Outcome, printed: Printed | None) -> str:
    case, ours, facts = outcome.case, outcome.time, outcome.facts
    growth = facts.get("max_real_eigenvalue")
    stability = f"max Re λ = {growth:+.4g} 1/s at the goal" if isinstance(growth, float) else ""
    if ours is None:
        if case.kind != "pid":
            return outcome.message
        unstable = isinstance(growth, float) and growth >= 0
        slow = f"{facts['goal_error']:.2g} rad off after {_trajectory_duration(outcome):g} s"
        return f"does not settle: {stability}" if unstable else f"settles too slowly ({slow}): {stability}"
    if printed is None:
        return stability or "the paper has no such payload"
    difference = f"{ours - printed.value:+.3f} s, {ours / printed.value - 1:+.1%}"
    if case.kind == "pid":
        rule = "" if case.arrival_rule == PAPER_RULE else f"arrival by {case.arrival_rule.replace('_', ' ')}; "
        return f"{difference}; {rule}{stability}"
    if case.kind == "time_energy":
        return f"{difference}; optimum of ∫ (1 + ½ τᵀτ) dt without torque limit"
    return f"published is {printed.value / ours:.2f} times the minimum under ±3 N m"


def _trajectory_duration(outcome: Outcome) -> float:
    return outcome.trajectory.duration if outcome.trajectory is not None else 0.0


def _value(printed: Printed | None) -> float | None:
    return None if printed is None else printed.value


def _with_columns(rows: list[Row]) -> list[Row]:
    """Rows whose reasons also give the rms error of the column, so that one hit is not taken for a match."""
    errors: dict[tuple[object, ...], list[float]] = {}
    for row in rows:
        if row.table != 7 and row.published is not None and row.ours is not None:
            errors.setdefault(_column(row), []).append(row.ours / row.published - 1)
    out = []
    for row in rows:
        column = errors.get(_column(row), [])
        if row.table != 7 and row.published is not None and len(column) > 1:
            rms = float(np.sqrt(np.mean(np.square(column))))
            row = replace(row, reason=f"{row.reason}; the column of {len(column)} payloads: rms {rms:.1%}")
        out.append(row)
    return out


def _column(row: Row) -> tuple[object, ...]:
    return row.table, row.quantity, row.reading, row.variant, row.kind, row.setup
