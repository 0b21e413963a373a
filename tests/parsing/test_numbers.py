"""Numbers as people type them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armdyn.errors import ProblemError, TrajectoryError
from armdyn.parsing.numbers import number, position, to_number
from armdyn.trajectory.planned import read_planned


@given(st.floats(allow_nan=False))
def test_every_double_is_read_as_written(one):
    assert to_number(repr(one)) == one == number(f" {one!r} ", "x")


@given(st.text("0123456789_.e+-٣１ pi/*", max_size=8))
def test_no_number_has_pythons_own_spellings(text):
    try:
        value = number(text, "x")
    except ProblemError:
        return
    assert text.isascii() and "_" not in text
    if "pi" not in text:
        assert value == float(text)


@pytest.mark.parametrize("wrong", ["1_0", "１", "1_0deg", "٣*pi"])
def test_they_are_refused_wherever_a_number_is_read(wrong, tmp_path):
    with pytest.raises(ProblemError, match="is not a number"):
        position(wrong, "q")
    (tmp_path / "motion.csv").write_text(f"t,q1\n0,0\n{wrong},1\n")
    with pytest.raises(TrajectoryError, match=r"line 3.*is not a number"):
        read_planned(tmp_path / "motion.csv", ("a",))
