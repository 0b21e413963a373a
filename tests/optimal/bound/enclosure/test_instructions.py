"""Functions in intervals and in affine forms, against the Functions themselves."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armdyn.errors import BridgeError
from armdyn.optimal.bound.enclosure.affine import Affine
from armdyn.optimal.bound.enclosure.instructions import LevelledFunction
from armdyn.optimal.bound.enclosure.interval import Interval

X = ca.SX.sym("x", 3)
VALUES = ca.vertcat(
    ca.sin(X[0]) * ca.cos(X[1]) - X[2], 0, -(ca.sin(X[0] + X[1]) ** 2), 2.5 * X[2] + X[2], X[0] * X[1] * X[2], 7
)
FUNCTION = ca.Function("several", [X], [VALUES])
ROUNDING = 1e-14
"""By which a value computed in floats may lie beside the exact one: some ten operations on numbers below ten."""


@given(
    st.lists(st.floats(-3, 3), min_size=3, max_size=3),
    st.lists(st.floats(0, 1), min_size=3, max_size=3),
    st.lists(st.floats(-1, 1), min_size=3, max_size=3),
)
def test_values_are_within(middle, radius, where):
    middle, radius, where = (np.array(x)[:, None] for x in (middle, radius, where))
    box = Interval(middle - radius, middle + radius)
    x = np.clip(box.centre + where * box.radius, box.lower, box.upper)
    value = np.array(FUNCTION(x[:, 0]))
    levelled = LevelledFunction.of(FUNCTION)
    forms = levelled(Affine.over(box))
    for found in (levelled(box), forms.interval):
        assert np.all(found.lower <= value + ROUNDING) and np.all(value <= found.upper + ROUNDING)
    share = np.divide(x - box.centre, box.radius, out=np.zeros_like(x), where=box.radius > 0)
    linear = forms.centre + np.einsum("pkb,kb->pb", forms.slopes, share)
    assert np.all(np.abs(value - linear) <= forms.rest + ROUNDING)


def test_what_affine_forms_leave_is_of_second_order():
    levelled = LevelledFunction.of(FUNCTION)
    middle = np.array([[0.3], [-0.7], [1.1]])
    rests = [np.max(levelled(Affine.over(Interval(middle - r, middle + r))).rest) for r in (1e-2, 1e-3)]
    assert rests[0] / rests[1] == pytest.approx(100, rel=0.1)  # third order's share at 1e-2


def test_an_unknown_operation_is_refused():
    with pytest.raises(BridgeError, match="not known"):
        LevelledFunction.of(ca.Function("root", [X], [ca.sqrt(X)]))


def test_other_functions_are_refused():
    y = ca.MX.sym("y", 2)
    with pytest.raises(BridgeError, match="SX"):
        LevelledFunction.of(ca.Function("other", [y], [2 * y]))
