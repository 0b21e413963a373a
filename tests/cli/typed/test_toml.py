"""TOML files: lines of keys, and nothing but one kind of error whatever is in them."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armdyn.cli.typed.toml import Table, read_tables
from armdyn.errors import ProblemError
from armdyn.toml import MAX_BYTES

TEXT = """# a comment with name = 1

[robot]
name = "arm"
payload = { mass = 1 }
[robot.lock]
joint = 1

[ problem ]  # with a comment
"q_start" = [
  1,
  2,
]
q_goal = 1
options.a = 1

[[problem.obstacles]]
type = "sphere"
"""


@pytest.fixture
def path(tmp_path):
    return tmp_path / "problem.toml"


def test_keys_have_the_lines_that_they_stand_on(path):
    path.write_text(TEXT)
    tables = read_tables(path, ["robot", "problem", "options"])
    assert tables["robot"].lines == {"": 3, "name": 4, "payload": 5, "lock": 6}
    assert tables["problem"].lines == {"": 9, "q_start": 10, "q_goal": 14, "options": 15, "obstacles": 17}
    assert tables["options"].values == {}


def test_an_unknown_key_is_told_with_its_line_and_the_nearest(path):
    path.write_text(TEXT)
    table = read_tables(path, ["robot", "problem"])["problem"]
    with pytest.raises(
        ProblemError, match=r"problem\.toml, line 10: no key 'q_start' in .* did you mean 'q_starts'\?$"
    ):
        table.only(["q_goal", "q_starts", "options", "obstacles"])
    with pytest.raises(ProblemError, match=r"line 14: no key 'q_goal' in .*; known: a, b$"):
        Table(path, "problem", {"q_goal": 1}, table.lines).only(["b", "a"])


def test_an_error_gets_the_line_of_the_key_that_it_speaks_of_first(path):
    path.write_text(TEXT)
    table = read_tables(path, ["robot", "problem"])["problem"]
    told = table.about(ProblemError("goal of joint 'q_start' is bad"), {"goal": "q_goal"})
    assert str(told).endswith("problem.toml, line 14: goal of joint 'q_start' is bad")
    assert "line 9: nobody" in str(table.about(ProblemError("nobody knows"), {}))


def test_a_table_that_is_none(path):
    path.write_text("\n[robott]\nname = 1")
    with pytest.raises(ProblemError, match="line 2: 'robott' is no table of a problem; did you mean 'robot'"):
        read_tables(path, ["robot", "problem"])
    path.write_text("robot = 1")
    with pytest.raises(ProblemError, match="line 1: 'robot' is no table"):
        read_tables(path, ["robot", "problem"])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"[robot]\nname = panda", "line 2, column 8: not TOML"),
        (b"\xff", "not TOML"),
        (b"a = " + b"[" * 100_000, "not TOML"),
        (b"a = " + b"9" * 10_000, "not TOML"),
        (b"#" * (MAX_BYTES + 1), "larger than"),
        (b"a = 1\na = 2", "not TOML"),
    ],
)
def test_what_is_no_toml(path, content, words):
    path.write_bytes(content)
    with pytest.raises(ProblemError, match=words):
        read_tables(path, ["robot"])


def test_what_is_no_file(path):
    with pytest.raises(ProblemError, match="no such file"):
        read_tables(path, ["robot"])
    with pytest.raises(ProblemError, match="it is a device"):
        read_tables(Path("/dev/zero"), ["robot"])


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.text(st.sampled_from("ab[]\"'={}.,# \n\t\x7f1é"), max_size=80))
def test_any_text_is_tables_or_one_kind_of_error(path, text):
    path.write_text(text)
    try:
        tables = read_tables(path, ["a", "b"])
    except ProblemError as error:
        assert str(error).startswith(str(path)) and len(str(error).splitlines()) == 1
    else:
        assert all(0 < line <= len(text.splitlines()) for table in tables.values() for line in table.lines.values())
