"""Row stores from strangers, damaged ones, and those on a full disk."""

import sqlite3
from contextlib import closing, suppress

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armdyn.errors import ArmdynError, DiskFullError, ResultError
from armdyn.studies.executor import in_process
from armdyn.studies.rows import StudyRow, read_rows, row_store
from armdyn.studies.run import run_study
from armdyn.studies.tables import study_table
from toys import squares

STUDY = squares(4, neighbours="nearest")
COLUMNS = ("status", "good", "message", "settings", "facts", "seconds", "attempts", "worker", "begun_from")
DEEP = "[" * 100_000
WRONG = st.one_of(
    st.none(), st.integers(-2, 2), st.floats(), st.binary(max_size=4), st.text("{}[]:,\"'019aN", max_size=6),
    st.sampled_from(["null", "[]", "1", DEEP, '{"a":NaN}', '{"a":"\\ud800"}', '{"a":1e999}']),
)  # fmt: skip


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """A store of four rows, and a path for damaged ones."""
    file = tmp_path_factory.mktemp("rows") / "whole.sqlite"
    run_study(STUDY, file, in_process)
    return file.read_bytes(), file.with_name("damaged.sqlite")


def read_all(file):
    """Read and continue a store: rows, or an error that armdyn raises on purpose."""
    with suppress(ArmdynError):
        for row in study_table(file):
            assert isinstance(row["status"], str) and isinstance(row["seconds"], float | int)
    with suppress(ArmdynError):
        run_study(STUDY, file, in_process)


@pytest.mark.slow
@given(data=st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
def test_damaged_bytes_raise_nothing_else(data, store):
    whole, file = store
    damaged = bytearray(whole[: data.draw(st.integers(1, len(whole)) | st.just(len(whole)))])
    used = [at for at, byte in enumerate(damaged) if byte]  # most of the file is empty
    for at in data.draw(st.lists(st.sampled_from(used), max_size=8)):
        damaged[at] = data.draw(st.integers(0, 255))
    file.write_bytes(damaged)
    read_all(file)


@pytest.mark.slow
@given(column=st.sampled_from(COLUMNS), value=WRONG)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
def test_wrong_values_raise_nothing_else(column, value, store):
    whole, file = store
    file.write_bytes(whole)
    with closing(sqlite3.connect(file)) as connection, suppress(sqlite3.IntegrityError), connection:
        connection.execute(f"UPDATE rows SET {column} = ? WHERE k = 2", (value,))
    read_all(file)


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        ("UPDATE rows SET facts = '[1]'", "'.1.' is no JSON object"),
        (f"UPDATE rows SET settings = '{DEEP}'", "damaged"),
        ("UPDATE rows SET seconds = 'soon' WHERE k = 3", "seconds of case 3 is 'soon'"),
        ("UPDATE study SET asked = 'null'", "'null' is no JSON object"),
        ("DELETE FROM study", "None is no JSON object"),
    ],
)
def test_a_wrong_value_is_named(statement, words, store):
    whole, file = store
    file.write_bytes(whole)
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.execute(statement)
    with pytest.raises(ResultError, match=words):
        run_study(STUDY, file, in_process)
        study_table(file)


@pytest.mark.parametrize(
    "program",
    [
        "DROP TABLE rows; CREATE VIEW rows AS WITH RECURSIVE n(k) AS (SELECT 0 UNION ALL SELECT k + 1 FROM n LIMIT 99) "
        "SELECT k, 's' status, 1 good, '' message, '{}' settings, '{}' facts, 0 seconds, 1 attempts, '' worker, NULL "
        "begun_from FROM n",
        "CREATE TRIGGER t AFTER INSERT ON rows BEGIN DELETE FROM motions; END",
        "CREATE INDEX i ON rows (length(facts))",
        "DROP TABLE motions; CREATE TABLE motions (k INTEGER PRIMARY KEY, motion BLOB AS (zeroblob(k)))",
        "CREATE TABLE other (x)",
    ],
)  # fmt: skip
def test_programs_in_a_store_are_not_run(program, store):
    """A view of the table's name: with no LIMIT it hung, deaf to Ctrl-C."""
    whole, file = store
    file.write_bytes(whole)
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.executescript(program)
    for read in (study_table, lambda file: run_study(STUDY, file, in_process)):
        with pytest.raises(ResultError, match="not one of a study"):
            read(file)


@pytest.mark.parametrize("filled", [20, 40, 56, 60, 64])
def test_a_full_disk_is_said_however_sqlite_says_it(filled, tiny_disk):
    (tiny_disk / "filler").write_bytes(bytes(filled * 2**10))
    row = StudyRow(k=0, status="s", good=True, message="x" * 2**15, settings={}, facts={})
    with pytest.raises(DiskFullError), row_store(tiny_disk / "rows.sqlite", dict) as rows:
        rows.append([row], {})
    with suppress(ArmdynError), read_rows(tiny_disk / "rows.sqlite") as rows:
        assert not list(rows.rows())
