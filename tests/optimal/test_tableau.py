import numpy as np
import pytest

from armdyn.optimal.tableau import LOBATTO_3, TABLEAUS, Tableau


@pytest.mark.parametrize("tableau", TABLEAUS.values(), ids=str)
def test_order_measured_on_a_nonlinear_equation(tableau):
    # x' = x cos t, x = exp(sin t): one Newton-free linear solve per interval, as f is linear in x.
    def error(n):
        h, x = 2.0 / n, 1.0
        for k in range(n):
            rate = np.cos(k * h + tableau.c * h)
            stages = np.linalg.solve(np.eye(tableau.c.size) - h * tableau.A * rate, np.full(tableau.c.size, x))
            x += h * tableau.b @ (rate * stages)
        return abs(x - np.exp(np.sin(2.0)))

    n = np.array([8, 16, 32, 64])
    slope = np.polyfit(np.log(n), np.log([error(k) for k in n]), 1)[0]
    # A regression over three halvings is off the asymptotic order by a few per cent.
    assert -slope == pytest.approx(tableau.order, rel=0.05)


def test_a_wrong_coefficient_is_refused():
    A = LOBATTO_3.A.copy()
    A[1, 2] *= -1
    with pytest.raises(ValueError, match="does not integrate"):
        Tableau("wrong", A, LOBATTO_3.b, LOBATTO_3.c, 4)
    with pytest.raises(ValueError, match="degree 4"):
        Tableau("too proud", LOBATTO_3.A, LOBATTO_3.b, LOBATTO_3.c, 5)


def test_knots_of_lobatto():
    assert LOBATTO_3.starts_at_knot and LOBATTO_3.ends_at_knot
    assert list(LOBATTO_3.inner) == [1]
