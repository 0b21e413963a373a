"""A solution with exact arcs: torques on limits, states that Pinocchio's dynamics join, costates as derivatives."""

import numpy as np
import pytest

from armdyn.optimal.polish.polish import polished
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.arc import BANG, Mode
from oracles import PinDynamics
from problems import solved

ARMS = ["r", "rr"]


def arc_of(phases):
    """Index of each segment's arc."""
    ends = np.cumsum([arc.duration for arc in phases.arcs])
    return np.searchsorted(ends, (phases.t[:-1] + phases.t[1:]) / 2)


@pytest.mark.parametrize("arm", ARMS)
def test_torques_are_where_the_modes_say(arm):
    phases, limits = solved(arm).phases, solved(arm).problem.limits
    side = {Mode.UPPER: limits.effort_upper, Mode.LOWER: limits.effort_lower}
    for k, a in enumerate(arc_of(phases)):
        for i, mode in enumerate(phases.arcs[a].modes):
            np.testing.assert_array_equal(phases.tau[k, :, i], side[mode][i])


@pytest.mark.parametrize("arm", ARMS)
def test_segments_fill_their_arcs(arm):
    phases = solved(arm).phases
    lengths = np.bincount(arc_of(phases), np.diff(phases.t))
    np.testing.assert_allclose(lengths, [arc.duration for arc in phases.arcs], rtol=1e-12)


@pytest.mark.parametrize("arm", ARMS)
def test_states_are_joined_by_quadrature_and_pinocchios_dynamics(arm):
    phases, pin = solved(arm).phases, PinDynamics(solved(arm).problem.robot)
    K, _, n = phases.tau.shape
    a = np.array([pin.aba(*row) for row in zip(*phases.points, strict=True)]).reshape(K, -1, n)
    h, weights = np.diff(phases.t)[:, None], np.polynomial.legendre.leggauss(5)[1] / 2
    # The states are integrated; Gauss' quadrature errs by 4e-7 over a sixteenth of the motion.
    rise = h * np.einsum("j,kji->ki", weights, phases.points[1].reshape(K, -1, n))
    np.testing.assert_allclose(np.diff(phases.q, axis=0), rise, rtol=1e-6, atol=1e-7)
    rise = h * np.einsum("j,kji->ki", weights, a)
    np.testing.assert_allclose(np.diff(phases.v, axis=0), rise, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("arm", ARMS)
def test_the_hamiltonian_is_zero_and_torques_pull_outward(arm):
    phases, pin = solved(arm).phases, PinDynamics(solved(arm).problem.robot)
    K, _, n = phases.tau.shape
    owner = arc_of(phases)
    for k in [np.argmax(owner == a) for a in range(len(phases.arcs))]:
        rates = np.concatenate([phases.v[k], pin.aba(phases.q[k], phases.v[k], phases.tau[k, 0])])
        assert 1 + phases.costate[k] @ rates == pytest.approx(0.0, abs=1e-4)  # the certificate's tolerance
    for k, a in enumerate(owner):
        for i in range(n):
            outward = 1.0 if phases.arcs[a].modes[i] is Mode.UPPER else -1.0
            assert np.all(outward * phases.switched.reshape(K, -1, n)[k, :, i] <= 1e-7 * phases.duration)


def test_costates_are_how_the_time_to_go_depends_on_the_state():
    """Differences of t_f for neighbouring goals, against the costate at the end: ρ there is −∂t_f/∂x_goal."""
    solution, step = solved("rr"), 1e-4
    for i in range(2):
        goals = (np.array(solution.problem.q_goal) + sign * step * np.eye(2)[i] for sign in (1, -1))
        tasks = [Task.of(solution.problem.variant(q_goal=goal), MinimumTimeOptions(compile=False)) for goal in goals]
        more, less = (polished(task, solution.trajectory, set()).duration for task in tasks)
        assert -solution.phases.costate[-1, i] == pytest.approx((more - less) / (2 * step), rel=1e-4)


def test_a_solution_is_sampled_at_knots_and_jumps():
    phases = solved("rr").phases
    motion = phases.torques
    assert all(mode in BANG for arc in phases.arcs for mode in arc.modes)
    assert motion.t[0] == 0.0 and motion.t[-1] == phases.t[-1]
    at = motion(phases.t)
    # Knots are samples: nothing between them is sampled.
    np.testing.assert_allclose(at.q, phases.q, atol=1e-13)
    np.testing.assert_allclose(at.v, phases.v, atol=1e-11)
    assert set(np.abs(motion.tau).ravel()) == {3.0}
    ends = np.cumsum([arc.duration for arc in phases.arcs])[:-1]
    jumps = motion.t[:-1][np.any(np.diff(motion.tau, axis=0) != 0, axis=1)]
    np.testing.assert_allclose(jumps, ends, atol=1e-12)
