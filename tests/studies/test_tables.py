"""Rows as tables."""

import csv
from functools import partial

import pandas as pd
import pytest

import armdyn as ad
from armdyn.studies.executor import local_executor
from armdyn.studies.rows import read_rows
from armdyn.studies.tables import study_table, write_csv, write_parquet
from toys import squares


@pytest.fixture
def file(tmp_path):
    return ad.run_study(squares(7, refused=(2,)), tmp_path / "s.sqlite", partial(local_executor, workers=2)).file


def test_csv_and_parquet_agree(file, tmp_path):
    table = study_table(file)
    with read_rows(file) as rows:
        frame = pd.read_parquet(write_parquet(rows, tmp_path / "rows.parquet"))
        with write_csv(rows, tmp_path / "rows.csv").open(newline="") as text:
            lines = list(csv.DictReader(text))
    assert list(frame.columns) == list(lines[0])
    assert list(frame.columns[:4]) == ["k", "status", "good", "x"] and frame.columns[-1] == "message"
    for k, (row, line) in enumerate(zip(table, lines, strict=True)):
        assert row["k"] == int(line["k"]) == frame["k"][k] == k
        assert line["status"] == row["status"] == frame["status"][k] == ("refused" if k == 2 else "squared")
        if k != 2:
            assert row["square"] == int(line["square"]) == frame["square"][k] == k * k
    assert lines[2]["square"] == "" and pd.isna(frame["square"][2]) and lines[2]["message"] == "x is 2"
    assert not list(tmp_path.glob(".rows*"))


def test_a_table_is_whole_or_not_there(file, tmp_path):
    (tmp_path / "rows.csv").write_text("the old one")
    with read_rows(file) as rows:
        rows.rows = lambda: iter([None])  # as if the file were damaged on the way
        with pytest.raises(AttributeError):
            write_csv(rows, tmp_path / "rows.csv")
    assert (tmp_path / "rows.csv").read_text() == "the old one"
    assert not list(tmp_path.glob(".rows*"))
