"""When enough guesses have been solved."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armdyn.optimal.search.multistart import enough


@pytest.mark.parametrize(("optima", "guesses"), [(1, 7), (2, 16), (3, 29), (4, 46), (5, 67)])
def test_enough_guesses_by_the_rule(optima, guesses):
    """W (n - 1) / (n - W - 2) <= W + 1/2 is n >= 2 W² + 3 W + 2."""
    assert guesses == 2 * optima**2 + 3 * optima + 2
    assert not enough(guesses - 1, optima) and enough(guesses, optima)


@given(st.integers(0, 200), st.integers(1, 40))
def test_who_has_enough_has_enough_of_more_and_for_fewer(solved, optima):
    if enough(solved, optima):
        assert enough(solved + 1, optima)
        assert optima == 1 or enough(solved, optima - 1)
