import numpy as np
import pytest

from armdyn.paper.tables.integrals import torque_integral, trapezoidal_integral
from armdyn.trajectory import Trajectory


def motion(t, tau):
    tau = np.asarray(tau, dtype=float).reshape(len(t), 1)
    return Trajectory(t, 0 * tau, 0 * tau, tau)


def test_a_sine_that_changes_sign():
    t = np.linspace(0, 2 * np.pi, 401)
    # A cubic spline errs by 5/384 h⁴ of the fourth derivative.
    assert torque_integral(motion(t, np.sin(t)))[0] == pytest.approx(4, abs=1e-8)
    assert torque_integral(motion(t, np.sin(t)), until=np.pi / 2)[0] == pytest.approx(1, abs=1e-8)


def test_bang_bang_is_exact():
    switch = 0.3
    t = np.array([0, 0.1, switch, np.nextafter(switch, 1), 0.7, 1.0])
    tau = [2, 2, 2, -1, -1, -1]
    assert torque_integral(motion(t, tau))[0] == pytest.approx(2 * 0.3 + 0.7, rel=1e-12)
    assert torque_integral(motion(t, tau), until=0.5)[0] == pytest.approx(2 * 0.3 + 0.2, rel=1e-12)


def test_trapezoid_converges_with_the_square_of_its_step():
    t = np.linspace(0, 1, 2001)
    smooth = motion(t, np.exp(t))
    errors = [trapezoidal_integral(smooth, step=h)[0] - (np.e - 1) for h in (0.1, 0.05)]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.01)
    # The step that is printed, 1 s, is one trapezoid for all of it.
    assert trapezoidal_integral(smooth, step=1.0)[0] == pytest.approx((1 + np.e) / 2)
