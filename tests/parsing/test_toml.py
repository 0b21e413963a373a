"""TOML from strangers."""

import time
import tomllib
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armdyn.arguments import whole
from armdyn.errors import FileError, ProblemError
from armdyn.parsing.toml import MAX_BYTES, read_toml, to_toml


@pytest.fixture
def toml(tmp_path):
    def write(text):
        path = tmp_path / "file.toml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_toml(path)

    return write


def test_a_complaint_says_the_line(toml):
    table = toml("# first\na = 1\n\n[b.c]\nd = 'x'\n'e.f' = 2\ng.h = [\n 1,\n]\n")
    inner = table.table("b").table("c")
    assert str(table.error("a", "why")).endswith("file.toml, line 2: why")
    assert "line 5: " in str(inner.error("d", ""))
    assert "line 6: " in str(inner.error("e.f", ""))
    assert "line 7: " in str(inner.table("g").error("h", ""))
    assert "line 4: " in str(inner.error("not there", ""))  # the table that it would be in
    with (
        pytest.raises(ProblemError, match=r"line 5: b\.c\.d is 'x'; it must be a whole number of at least 1"),
        inner.at("d"),
    ):
        whole(inner.values["d"], inner.called("d"), least=1)
    with pytest.raises(ProblemError, match=r"line 2: a is 1; it must be a table, \[a\]"):
        table.table("a")
    with pytest.raises(ProblemError, match=r"line 5: no key 'd' in \[b\.c\]; known: e\.f, g$"):
        inner.only(("e.f", "g"))
    with pytest.raises(
        ProblemError, match=r"line 7: no table 'g' in \[b\.c\]; did you mean 'gg'|line 7: .* known: d, e"
    ):
        inner.only(("d", "e.f"))
    with pytest.raises(ProblemError, match=r"line 2: no key 'a' at the top; known: b$"):
        table.only(("b",))
    with pytest.raises(ProblemError, match=r"a is 1; it must be text"):
        table.text("a", "")
    assert table.text("z", "there") == "there"


def test_an_error_gets_the_line_of_the_key_that_it_speaks_of_first(toml):
    table = toml("[problem]\nq_start = 1\nq_goal = 1\n\n[[problem.obstacles]]\ntype = 'sphere'\n").table("problem")
    message = table.about(ProblemError("goal of joint 'q_start' is bad"), {"goal": "q_goal"})
    assert str(message).endswith("file.toml, line 3: goal of joint 'q_start' is bad")
    assert str(table.about(message)) == str(message)  # it has a line already
    assert "line 1: nobody" in str(table.about(ProblemError("nobody knows")))
    assert "line 5: obstacles is" in str(table.about(ProblemError("obstacles is")))
    with pytest.raises(ProblemError, match="line 2: file: q_start is bad"), table.locating_errors():
        raise FileError("file", "q_start is bad")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = 1\nb = = 2\n", "line 2, column 5: not TOML: Invalid value"),
        ("a = 1\na = 2\n", "line 2, column 6: not TOML: Cannot overwrite a value"),
        ("a = [1,\n", "not TOML"),
        ("[robot]\nname = panda", "line 2, column 8: not TOML"),
        ("x = " + "[" * 5000, r"not TOML that can be read \(RecursionError\)"),
        ("x = 1" + "0" * 5000, r"not TOML that can be read \(ValueError\)"),
        (b"a = '\xff'", r"not UTF-8 \(byte 5\)"),
        ("a" * (MAX_BYTES + 1), "larger than"),
    ],
)
def test_a_wrong_toml_is_refused(toml, text, words):
    with pytest.raises((ProblemError, FileError), match=words):
        toml(text)


@pytest.mark.parametrize("text", ["b = 1\n{} = 1", "b = 1\n[{}]", "b = 1\nx = {{ {} = 1 }}"])
@pytest.mark.parametrize("name", ["a", '"a b"', "'a'"])
def test_names_with_thousands_of_dots_are_refused_before_they_are_read(toml, text, name):
    with pytest.raises(ProblemError, match="line 2: a name of more than 16 parts"):
        toml(text.format(".".join([name] * 20_000)))


def test_a_wrong_file_is_refused(tmp_path):
    with pytest.raises(FileError, match="no such file"):
        read_toml(tmp_path / "none.toml")
    with pytest.raises(FileError, match="it is a device"):
        read_toml("/dev/zero")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.text(st.sampled_from("ab[]\"'={}.,# \n\t\x7f1é"), max_size=80))
def test_any_text_is_a_table_or_an_error_of_one_line(tmp_path, text):
    path = tmp_path / "file.toml"
    path.write_text(text)
    try:
        table = read_toml(path)
    except ProblemError as error:
        assert str(error).startswith(str(path)) and len(str(error).splitlines()) == 1
    else:
        assert all(0 < line <= len(text.splitlines()) for line in table.lines.values())


def test_numbers_of_numpy_are_written_as_numbers():
    values = {"a": np.float64(0.1), "b": np.int64(3), "c": [np.float64(np.inf)], "d": True, "e": 1e300}
    assert tomllib.loads(to_toml({"all": values})) == {"all": {"a": 0.1, "b": 3, "c": [np.inf], "d": True, "e": 1e300}}


@pytest.mark.parametrize("begin", ["", "#", "a = '", "[", "a.", "# '"])
@pytest.mark.parametrize("unit", ["a", "-_", "a ", "'", "a.b=1#", " ", '"a', "[["])
def test_time_is_not_that_of_a_square(begin, unit, toml):
    """40,000 letters of one word took 28 CPU s; a second is 1,000 times what the text takes by its length."""
    began = time.process_time()
    with suppress(ProblemError):
        toml(begin + unit * (MAX_BYTES // len(unit) - 9))
    assert time.process_time() - began < 1.0
