"""Costates of extremals: against the multipliers of another method, and against the adjoint equations."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.arcs.arc import POSITION, outward
from armdyn.optimal.arcs.phases import Phases, solve_phases
from armdyn.optimal.proof.sensitivity import sensitivities
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.task import Task
from problems import random_problem, random_solution, solved


@pytest.mark.parametrize(
    "solution",
    [lambda: solved("rr"), lambda: solved("rrr"), pytest.param(lambda: random_solution(15), marks=pytest.mark.slow)],
)
def test_collocation_of_the_same_arcs_agrees(solution):
    # Five-stage Radau IIA of ninth order, solved by IPOPT: durations, costates from its multipliers, sensitivities.
    own = solution()
    task = Task.of(own.problem, MinimumTimeOptions(compile=False))
    other = solve_phases(task, own.phases.arcs, own.phases.torques, 48, warm=True)
    assert isinstance(other, Phases)
    assert own.phases.duration == pytest.approx(other.duration, rel=1e-8)
    scale = np.max(np.abs(other.costate), axis=0)
    for k in (0, -1):
        np.testing.assert_allclose(own.phases.costate[k] / scale, other.costate[k] / scale, atol=1e-4)
    mine, theirs = own.sensitivities(), sensitivities(own.problem, other)
    assert mine.payload_mass == pytest.approx(theirs.payload_mass, rel=1e-4)
    np.testing.assert_allclose(mine.effort(), theirs.effort(), rtol=1e-4)


@pytest.mark.slow
def test_the_costates_of_a_contact_keep_the_adjoint_equations():
    # 22 ms along the lower limit of the third joint, in which the second one switches: collocation of these arcs was
    # 5e-7 s too slow, and had pulls of the wrong sign.
    solution = ad.solve_minimum_time(random_problem(53))
    assert solution.certified
    phases = solution.phases
    along = [(k, i) for k, a in enumerate(phases.arc_of) for i, m in enumerate(phases.arcs[a].modes) if m in POSITION]
    assert along
    for k, i in along:
        mode = phases.arcs[phases.arc_of[k]].modes[i]
        assert np.all(-outward(mode) * phases.state_multiplier[k, :, 0, i] >= 0)
        # The torque that holds it is within its limits, so that its switching function is zero.
        assert abs(solution.certificate.switching[k, i]) < 1e-9
    # Integrated back along the replay by another method, with the pulls of the limit as they are.
    assert solution.certificate.adjoint_error < 1e-5
    assert np.max(np.abs(phases.knot_multiplier)) > 1e-3  # where the contact begins it is pushed
