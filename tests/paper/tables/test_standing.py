"""How the paper's numbers stand: each counted once, by its best reading."""

from dataclasses import replace

import pytest

from armdyn.paper.outcomes.case import Case
from armdyn.paper.tables.rows import all_rows, table_3
from armdyn.paper.tables.standing import column, growths, number_of, ratios, rms, standings, time_of
from paper.computed import outcome, outcomes


def test_a_number_counts_once_by_its_best_reading():
    rows = [row for row in table_3() if row.quantity == "switch_interval_s" and row.payload_kg == 0.1006]
    assert len(rows) == 4  # two formulas, two readings
    (key,) = standings(rows)
    assert key == (3, "2π/r", "100.6")
    assert standings(rows)[key] == "not reproduced"
    rows = [replace(row, verdict="close") if row is rows[2] else row for row in rows]
    assert standings(rows)[key] == "close"
    assert standings([*rows, replace(rows[0], verdict="reproduced")])[key] == "reproduced"
    assert standings([replace(rows[0], published=None)]) == {}


def test_table_3_has_twenty_numbers():
    assert len(standings(table_3())) == 20


def test_a_time_is_found_by_arm_example_and_payload():
    rows = all_rows(outcomes())
    (row,) = [r for r in rows if r.kind == "pid" and r.arm == "r" and r.reading == "mM" and r.payload_kg == 0.1006
              and r.table == 4]  # fmt: skip
    assert number_of(row) == time_of("r", 4, 0.1006)
    assert standings(rows)[time_of("r", 4, 0.1006)] == "reproduced"


def test_columns_leave_other_states_and_totals_of_torque_out():
    rows = all_rows(outcomes())
    pairs = column(rows, arm="r", kind="pid", reading="mM")
    assert [published for published, _ in pairs] == [4.26, 4.317, 4.502]
    assert rms(pairs) == pytest.approx((sum((a - b) ** 2 for a, b in pairs) / 3) ** 0.5, rel=1e-12)  # rounding
    assert ratios([(2.0, 1.0), (3.0, 2.0)]) == (1.5, 2.0)
    assert column([replace(row, setup="other") for row in rows], arm="r") == []


def test_growths_are_of_the_papers_loops_alone():
    loop = outcome(Case(6, "rrr", "pid", 0.1006))
    assert growths(outcomes(), "rrr") == [loop.facts["max_real_eigenvalue"]]
    assert growths([outcome(Case(6, "rrr", "pid", 0.1006, "mM", "printed"))], "rrr") == []
