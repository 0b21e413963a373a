"""The printed law (19) to (21), and its motion."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from armdyn.dynamics import Dynamics
from armdyn.paper import IndirectOptions, solve_indirect
from armdyn.paper.indirect.canonical import canonical_system
from armdyn.paper.printed.law import PRINTED
from oracles import PinDynamics, robot_named
from problems import paper_problem

FREE = IndirectOptions(bounded=False)


def hamiltonian(robot, y, tau):
    """H = 1 + ρᵀf by `pin.aba`."""
    n = robot.nv
    return 1 + y[2 * n :] @ np.concatenate([y[n : 2 * n], PinDynamics(robot).aba(y[:n], y[n : 2 * n], tau)])


def test_one_joint_lacks_the_factor_k():
    y = np.array([0.3, 1.0, 0.2, 0.4])
    assert float(canonical_system(robot_named("r"), PRINTED).torque(y, 0.0, -np.inf, np.inf)) == -0.4  # (19)


def test_two_joints_and_that_it_does_not_minimise_its_h():
    two, none = robot_named("rr"), np.full(2, np.inf)
    y = np.array([0.3, -0.5, 1.0, 2.0, 0.2, -0.1, 0.4, -0.3])
    system = canonical_system(two, PRINTED)
    tau = system.torque(y, 0.0, -none, none).full().ravel()
    # (20): minus the rows of D⁻¹, with ρ_2 and ρ_4 of the paper's order (θ1, θ1', θ2, θ2').
    np.testing.assert_allclose(tau, -np.linalg.solve(PinDynamics(two).crba(y[:2]), y[6:]), rtol=1e-12)
    value = float(system.hamiltonian(y, tau, 0.7)[0])  # w is without effect
    assert value == pytest.approx(hamiltonian(two, y, tau), rel=1e-9)
    assert hamiltonian(two, y, 1.01 * tau) < hamiltonian(two, y, tau)  # H is linear in τ


@pytest.mark.parametrize("arm", ["r", "rr"])
def test_it_is_slower_and_worse_and_its_h_varies(arm):
    problem = paper_problem(arm, effort_weight=1.0)
    proper = solve_indirect(problem, options=FREE)
    printed = solve_indirect(problem, options=replace(FREE, law=PRINTED))
    assert printed.success, printed.message
    assert abs(printed.hamiltonian[-1]) < 1e-9  # the paper's (18) is satisfied
    assert printed.hamiltonian_spread > 0.1  # but H = 1 + ρᵀf, which an optimum keeps at 0, is not
    assert "H varies by" in printed.message and "does not minimise" in printed.message
    assert "varies" not in proper.message
    assert printed.duration > 1.1 * proper.duration and printed.cost > 1.02 * proper.cost
    # H + k/2 τᵀτ is constant, with k = 1 for (20) and 1/D for (19): energy at a fixed time is minimised.
    inertia = Dynamics(problem.robot).crba(problem.q_start)[0, 0]
    k = 1 / inertia if arm == "r" else 1.0
    kept = printed.hamiltonian + k / 2 * np.sum(printed.trajectory.tau**2, axis=1)
    assert np.ptp(kept) < 1e-6 * np.max(np.abs(printed.hamiltonian))


def test_it_is_seeded_by_the_weight_that_it_belongs_to():
    one, two = paper_problem("r"), paper_problem("rr")
    inertia = PinDynamics(one.robot).crba(one.q_start)[0, 0]
    assert PRINTED.seed_weight(one) == pytest.approx(1 / inertia, rel=1e-12)
    assert PRINTED.seed_weight(two) == 1.0


def test_it_goes_to_other_processes():
    assert pickle.loads(pickle.dumps(PRINTED)) == PRINTED
