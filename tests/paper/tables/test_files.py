import csv
import io
from dataclasses import replace

import numpy as np
import pytest

from armdyn.paper.tables.files import csv_of, write_findings, write_tables
from armdyn.paper.tables.rows import all_rows, time_row

COLUMNS = ["arm", "payload_kg", "reading", "variant", "quantity", "published", "ours", "verdict", "reason"]


@pytest.mark.slow
def test_csv_is_exact_and_leaves_missing_numbers_empty(r_loops):
    rows = [
        time_row(r_loops[0]),
        time_row(replace(r_loops[0], time=None)),
        time_row(replace(r_loops[0], time=np.float64(4.2))),
    ]
    read = list(csv.DictReader(io.StringIO(csv_of(rows))))
    assert list(read[0])[: len(COLUMNS)] == COLUMNS
    assert float(read[0]["ours"]) == rows[0].ours and read[1]["ours"] == "" and read[2]["ours"] == "4.2"
    assert read[0]["reading"] == "tip" and read[0]["variant"] == "lagrangian" and read[0]["quantity"] == "pid_arrival_s"


@pytest.mark.slow
def test_a_row_of_a_table_is_identified_by_its_case_and_quantity(tmp_path, r_loops):
    odd = [replace(o, case=replace(o.case, derivative_sign="printed"), time=None) for o in r_loops]
    write_tables(tmp_path, all_rows([*odd, *r_loops]))
    read = list(csv.DictReader((tmp_path / "table4.csv").open(newline="")))
    keys = [tuple(row[c] for c in ("arm", "payload_kg", "reading", "variant", "quantity")) for row in read]
    assert len(keys) == len(set(keys)) == 20
    variants = list(csv.DictReader((tmp_path / "variants.csv").open(newline="")))
    assert len(variants) >= 20 and all(row["setup"] for row in variants)
    assert {p.suffix for p in tmp_path.iterdir()} == {".csv", ".md", ".tex"}


def test_findings(tmp_path):
    assert {p.name for p in write_findings(tmp_path)} >= {"feasibility.csv", "feasibility.md", "first_approach.tex"}
    read = list(csv.DictReader((tmp_path / "feasibility.csv").open(newline="")))
    assert len(read) == 10 * 2 * (1 + 2 + 3)
