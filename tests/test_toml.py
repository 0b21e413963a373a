"""TOML from strangers."""

import pytest

from armdyn.errors import FileError, ProblemError
from armdyn.toml import MAX_BYTES, read_toml


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
    with pytest.raises(ProblemError, match=r"line 5: b\.c\.d is 'x'; it must be a whole number of at least 1"):
        inner.whole("d", 1, least=1)
    with pytest.raises(ProblemError, match=r"line 2: a is 1; it must be a table, \[a\]"):
        table.table("a")
    with pytest.raises(ProblemError, match=r"line 5: b\.c\.d is not known here; did you mean 'dd'\?|known: dd"):
        inner.only(("dd", "e.f", "g"))
    with pytest.raises(ProblemError, match=r"a is 1; it must be text"):
        table.text("a", "")
    assert table.text("z", "there") == "there" and table.number("a", 2.0) == 1.0


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a = 1\nb = = 2\n", "line 2, column 5: not TOML: Invalid value"),
        ("a = 1\na = 2\n", "line 2, column 6: not TOML: Cannot overwrite a value"),
        ("a = [1,\n", "not TOML"),
        ("x = " + "[" * 5000, r"not TOML that can be read \(RecursionError\)"),
        ("x = 1" + "0" * 5000, r"not TOML that can be read \(ValueError\)"),
        (b"a = '\xff'", r"not TOML: it is not UTF-8 \(byte 5\)"),
        ("a" * (MAX_BYTES + 1), "larger than"),
    ],
)
def test_what_is_no_toml(toml, text, told):
    with pytest.raises((ProblemError, FileError), match=told):
        toml(text)


@pytest.mark.parametrize("text", ["b = 1\n{} = 1", "b = 1\n[{}]", "b = 1\nx = {{ {} = 1 }}"])
@pytest.mark.parametrize("name", ["a", '"a b"', "'a'"])
def test_names_with_thousands_of_dots_are_refused_before_they_are_read(toml, text, name):
    with pytest.raises(ProblemError, match="line 2: a name of more than 16 parts"):
        toml(text.format(".".join([name] * 20_000)))
