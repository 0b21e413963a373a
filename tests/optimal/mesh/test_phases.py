"""A solution with arcs: torques on their limits, states that the collocation joins, multipliers as derivatives."""

import numpy as np
import pytest

from armdyn.optimal.verify.arc import Mode
from armdyn.optimal.verify.phases import TABLEAU
from oracles import PinDynamics
from problems import solved

ARMS = ["r", "rr"]


@pytest.mark.parametrize("arm", ARMS)
def test_torques_are_where_the_modes_say(arm):
    phases, limits = solved(arm).phases, solved(arm).problem.limits
    side = {Mode.UPPER: limits.effort_upper, Mode.LOWER: limits.effort_lower}
    for k, a in enumerate(phases.arc_of):
        for i, mode in enumerate(phases.arcs[a].modes):
            np.testing.assert_array_equal(phases.tau[k, :, i], side[mode][i])


@pytest.mark.parametrize("arm", ARMS)
def test_intervals_fill_their_arcs(arm):
    phases = solved(arm).phases
    lengths = np.bincount(phases.arc_of, np.diff(phases.t))
    np.testing.assert_allclose(lengths, [arc.duration for arc in phases.arcs], rtol=1e-12)


@pytest.mark.parametrize("arm", ARMS)
def test_states_are_joined_by_the_tableau_and_pinocchios_dynamics(arm):
    phases, pin = solved(arm).phases, PinDynamics(solved(arm).problem.robot)
    K, stages, n = phases.tau.shape
    a = np.array([pin.aba(*row) for row in zip(*phases.points, strict=True)]).reshape(K, stages, n)
    h = np.diff(phases.t)[:, None]
    # The states are integrated; the tableau's quadrature errs by 4e-7 over a sixteenth of the motion.
    rise = h * np.einsum("j,kji->ki", TABLEAU.b, phases.points[1].reshape(K, stages, n))
    np.testing.assert_allclose(np.diff(phases.q, axis=0), rise, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(
        np.diff(phases.v, axis=0), h * np.einsum("j,kji->ki", TABLEAU.b, a), rtol=1e-6, atol=1e-6
    )


@pytest.mark.parametrize("arm", ARMS)
def test_the_hamiltonian_is_zero_and_torques_pull_outward(arm):
    phases, pin = solved(arm).phases, PinDynamics(solved(arm).problem.robot)
    n = phases.q.shape[1]
    firsts = [np.argmax(phases.arc_of == a) for a in range(len(phases.arcs))]
    for k in firsts:
        a = pin.aba(phases.q[k], phases.v[k], phases.tau[k, 0])
        rates = np.concatenate([phases.v[k], a])
        assert 1 + phases.costate[k] @ rates == pytest.approx(0.0, abs=1e-4)  # the certificate's tolerance
    for k, arc in enumerate(phases.arc_of):
        for i in range(n):
            outward = 1.0 if phases.arcs[arc].modes[i] is Mode.UPPER else -1.0
            switched = phases.switched.reshape(phases.tau.shape)[k, :, i]
            assert np.all(outward * switched <= 1e-7 * phases.duration)
