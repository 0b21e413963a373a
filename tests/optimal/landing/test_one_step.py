"""One step of Dormand-Prince 8(5,3)."""

import numpy as np
import pytest
from scipy.integrate import DOP853

from armdyn.optimal.landing.one_step import NODES, one_step

REST = np.zeros((NODES.size, 1))


def swing(q, v, tau):
    return -q


def stepped(h, rtol=1e-6):
    return one_step(swing, REST, h, np.array([1.0, 0.0]), np.array([0.0, -1.0]), rtol)


def test_order_is_eight():
    steps = np.array([0.4, 0.2])
    errors = [np.max(np.abs(stepped(h)[0] - [np.cos(h), -np.sin(h)])) for h in steps]
    # Of one step the error falls with h⁹; constants of two steps are alike to a tenth.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(9, abs=0.2)


def test_state_and_rate_are_scipys():
    def pushed(t, x):
        return np.array([x[1], np.sin(3 * t) - x[0] ** 3])

    x = np.array([0.3, -1.0])
    solver = DOP853(pushed, 0.1, x, 0.2, rtol=1e-8, atol=1e-10, first_step=0.1)
    solver.step()
    assert solver.t == 0.2
    torques = np.sin(3 * (0.1 + NODES * (0.2 - 0.1)))
    state, rate = one_step(lambda q, v, tau: tau - q**3, torques, 0.2 - 0.1, x, pushed(0.1, x), 1e-8)
    assert np.array_equal(state, solver.y)  # the same sums in the same order
    assert np.array_equal(rate, pushed(0.2, state))


def test_what_is_too_long_or_not_finite_is_none():
    assert stepped(0.5, 1e-12) is None
    assert one_step(lambda q, v, tau: q * np.nan, REST, 1.0, np.ones(2), np.ones(2), 1e-6) is None


def test_rest_has_no_error():
    state, _ = one_step(lambda q, v, tau: 0 * q, REST, 1.0, np.zeros(2), np.zeros(2), 1e-10)
    assert not np.any(state)
