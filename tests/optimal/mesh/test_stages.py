"""The chain rule equals the derivative of the condensed interval as one expression."""

import casadi as ca
import numpy as np
import pytest

from armdyn.dynamics import Dynamics
from armdyn.optimal.mesh.stages import StageFunctions
from optimal.mesh.condensed_program import condensed_program
from problems import paper_arm


@pytest.mark.parametrize("arm", ["r", "rr", "rrr"])
def test_values_and_derivatives_of_an_interval(arm):
    dynamics = Dynamics(paper_arm(arm), free_last_body=True)
    n, random = dynamics.nv, np.random.default_rng(4)
    y, lam, nu = random.uniform(-1, 1, 5 * n + 1), *random.normal(size=(2, 2 * n))
    y[-1] = 0.8
    p = np.concatenate([[0.1, 0.4, 1.2, 3.0], np.full(n, 0.1), np.full(n, 2.0), dynamics.last_body])
    one = StageFunctions.of(dynamics)

    left, u, right = y[: 2 * n], y[2 * n : 3 * n], y[3 * n : 5 * n]
    a_left, a_right = one.rate(left, u, p), one.rate(right, u, p)
    middle = one.middle(y, a_left, a_right, p)
    at_middle = one.second_order(middle, u, lam[n:], p)
    weights = one.weigh(y, at_middle[1], lam, nu, p)
    ends = [one.second_order(x, u, weight, p) for x, weight in zip((left, right), weights, strict=True)]
    values = np.array(one.equations(y, a_left, at_middle[0], a_right, p)).ravel()
    found = one.assemble(y, lam, nu, *ends[0], *at_middle, *ends[1], p)

    # The program of one interval: its unknowns are y, its parameters p.
    program = condensed_program(dynamics, 1)
    defects, jacobian = program.jacobian(y, p)
    x, q, cost = (program.functions[name] for name in "xpf")
    f = ca.Function("f", [x, q], [cost])
    along_middle = ca.Function("bent", [x, q], [ca.hessian(ca.dot(nu, program.middles(x, q)), x)[0]])
    hessian = program.hessian(y, p, 1.0, lam) + ca.triu(along_middle(y, p))
    moved = program.middles.factory("moved", ["i0", "i1"], ["jac:o0:i0"])(y, p)
    gradient = f.factory("gradient", ["i0", "i1"], ["grad:o0:i0"])(y, p)
    np.testing.assert_allclose(np.array(middle), program.middles(y, p), atol=1e-13)
    np.testing.assert_allclose(values, [*np.array(defects).ravel(), float(f(y, p))], atol=1e-13)
    for nonzeros, pattern, expected in zip(
        found,
        (one.jacobian, one.gradient, one.hessian, one.middle_jacobian),
        (jacobian, gradient, hessian, moved),
        strict=True,
    ):
        dense = np.array(ca.densify(ca.DM(pattern, nonzeros)))
        np.testing.assert_allclose(
            dense, np.array(ca.densify(expected)), atol=1e-12 * np.max(np.abs(dense))
        )  # rounding
