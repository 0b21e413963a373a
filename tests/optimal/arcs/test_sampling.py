"""Polynomials between their nodes, and the trajectory that a solution with arcs is told as."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armdyn.optimal.arcs.arc import BANG
from armdyn.optimal.arcs.sampling import _curvature, lagrange
from armdyn.optimal.task.tableau import RADAU_5, TABLEAUS
from problems import solved

NODES = [np.append(0.0, RADAU_5.c), *(tableau.c for tableau in TABLEAUS.values() if tableau.c.size > 2)]
S = st.lists(st.floats(0, 1), min_size=1, max_size=5).map(np.array)


@pytest.mark.parametrize("nodes", NODES, ids=lambda nodes: str(nodes.size))
@given(s=S)
def test_they_add_up_to_one(nodes, s):
    # Lebesgue's constant of these nodes is below ten.
    np.testing.assert_allclose(lagrange(nodes, s).sum(axis=1), 1.0, rtol=1e-13)


@pytest.mark.parametrize("nodes", NODES, ids=lambda nodes: str(nodes.size))
def test_each_is_one_at_its_own_node_alone(nodes):
    np.testing.assert_array_equal(lagrange(nodes, nodes), np.eye(nodes.size))


@pytest.mark.parametrize("nodes", NODES, ids=lambda nodes: str(nodes.size))
@given(s=S, data=st.data())
def test_polynomials_and_their_second_derivatives_are_exact(nodes, s, data):
    coefficients = data.draw(st.lists(st.floats(-1, 1), min_size=nodes.size, max_size=nodes.size))
    polynomial = np.polynomial.Polynomial(coefficients)
    np.testing.assert_allclose(lagrange(nodes, s) @ polynomial(nodes), polynomial(s), atol=1e-12)
    # Second differences of these nodes are below a few hundred, and an inverse loses as much again.
    np.testing.assert_allclose(_curvature(nodes, s) @ polynomial(nodes), polynomial.deriv(2)(s), atol=1e-9)


def test_a_solution_with_arcs_is_sampled_at_knots_and_jumps():
    phases = solved("rr").phases
    motion = phases.torques
    assert all(mode in BANG for arc in phases.arcs for mode in arc.modes)
    assert motion.t[0] == 0.0 and motion.t[-1] == phases.t[-1]
    at = motion(phases.t)
    # Knots are samples: nothing between them is asked for.
    np.testing.assert_allclose(at.q, phases.q, atol=1e-13)
    np.testing.assert_allclose(at.v, phases.v, atol=1e-11)
    assert set(np.abs(motion.tau).ravel()) == {3.0}
    ends = np.cumsum([arc.duration for arc in phases.arcs])[:-1]
    jumps = motion.t[:-1][np.any(np.diff(motion.tau, axis=0) != 0, axis=1)]
    np.testing.assert_allclose(jumps, ends, atol=1e-12)
