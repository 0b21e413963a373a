from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.verify.certificate import Certificate, certify
from problems import gantry_problem, solve, solved

LANDED = Certificate(1e-9, 1e-9, 0.0)
"""A motion that is on the goal within its limits, and of which no arcs are known."""


def test_certificate_refuses_motions_that_are_not_optimal():
    solution = solved("rr")
    problem = solution.problem
    slower = solution.local_optima[0]
    assert slower > solution.duration  # the other optimum is an extremal too: only the search distinguishes them
    # Its torques are on the limits of this problem; with limits twice as wide they are on none.
    wider = replace(problem, effort_limit=6.0)
    certificate = certify(wider, solution.trajectory, solution.phases)
    assert any("sign" in reason for reason in certificate.reasons)  # its torques could still go further out
    assert certificate.usable and not certificate.extremal
    tampered = replace(solution.phases, costate=-solution.phases.costate)
    certificate = certify(problem, solution.trajectory, tampered)
    assert not certificate.ok
    assert any("sign" in reason for reason in certificate.reasons)
    assert any("Hamiltonian" in reason for reason in certificate.reasons)
    missed = ad.Trajectory(
        solution.trajectory.t,
        solution.trajectory.q + 1e-3,
        solution.trajectory.v,
        solution.trajectory.tau,
    )
    assert any("misses the goal" in reason for reason in certify(problem, missed, solution.phases).reasons)
    without = certify(problem, solution.trajectory, None, "without arcs")
    assert not without.ok and without.reasons == ("without arcs",)


def test_a_costate_off_the_adjoint_equations_is_no_extremal():
    """|H| and the signs need not see it: at a switch the costates may turn within both tolerances."""
    solution = solved("rr")
    certificate = replace(solution.certificate, adjoint_error=2e-4)
    assert solution.certificate.extremal and not certificate.extremal and not certificate.ok
    assert certificate.usable
    assert certificate.reasons == ("the costates stray from the adjoint equations by 0.0002",)
    assert not replace(solution.certificate, adjoint_error=np.nan).extremal
    candidate = certify(solution.problem, solution.trajectory, solution.phases)
    assert candidate.adjoint_error is None and candidate.extremal  # as far as it was checked


@pytest.mark.parametrize(
    ("changes", "lands", "keeps"),
    [
        ({}, True, True),
        ({"goal_error": 9e-4}, True, True),
        ({"goal_error": 1.1e-3}, False, True),
        ({"goal_error": 1.1e-3, "landing": 1e-2}, True, True),
        ({"goal_error": np.nan}, False, True),
        ({"goal_velocity_error": 0.015}, True, True),
        ({"goal_velocity_error": 0.5}, False, True),  # it passes the goal
        ({"goal_velocity_error": np.nan}, False, True),
        ({"limit_violation": 1.1e-6}, True, False),
        ({"goal_error": np.inf, "limit_violation": np.inf}, False, False),
    ],
)
def test_landing_and_limits_are_reported_separately(changes, lands, keeps):
    certificate = replace(LANDED, **changes)
    assert (certificate.lands, certificate.keeps_limits) == (lands, keeps)
    assert certificate.usable == (lands and keeps)
    assert not certificate.ok and certificate.reasons  # nothing says that it is optimal


def test_a_small_gap_certifies_and_a_large_one_is_named():
    near = LANDED.bounded(1.0, 1.0009)
    assert near.gap == pytest.approx(9e-4) and near.gap_proven
    assert near.ok and not near.extremal and near.reasons == ()
    far = LANDED.bounded(1.0, 1.02)
    assert far.gap_proven and not far.ok
    assert far.reasons[-1] == "it is up to 2 % above the lower bound"
    assert LANDED.bounded(None, 1.0).gap is None and not LANDED.gap_proven


def test_a_gap_is_proven_only_of_a_motion_that_ends_on_the_goal_within_its_limits():
    for changes in ({"goal_error": 1e-5}, {"limit_violation": 1e-5}):
        certificate = replace(LANDED, **changes).bounded(1.0, 1.0001)
        assert certificate.gap is not None and not certificate.gap_proven and not certificate.ok
    assert replace(LANDED, goal_error=1e-5).usable


def test_a_motion_below_its_bound_proves_that_one_of_them_is_wrong():
    certificate = LANDED.bounded(1.0, 0.99)
    assert not certificate.gap_proven and not certificate.ok
    assert "one of the two is wrong" in certificate.reasons[-1]


def test_an_extremal_needs_no_bound_and_a_bound_no_extremal():
    solution = solved("rr")
    bounded = certify(solution.problem, solution.trajectory, solution.phases)
    bounded = bounded.bounded(0.5 * solution.duration, solution.duration)
    assert bounded.extremal and bounded.ok and bounded.gap == pytest.approx(1.0)
    near = certify(solution.problem, solution.trajectory, None).bounded(0.9995 * solution.duration, solution.duration)
    assert near.ok and not near.extremal


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.inf, np.nan, "1", True])
def test_a_bound_is_a_positive_number(wrong):
    with pytest.raises(ProblemError, match="lower_bound"):
        LANDED.bounded(wrong, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("limits", [{}, {"velocity_limit": 0.5}], ids=["torque decides", "speed decides"])
def test_a_joint_that_time_does_not_determine_is_idle_and_an_extremal_all_the_same(limits):
    solution = solve(gantry_problem(**limits))
    certificate = solution.certificate
    assert certificate.extremal and certificate.idle == ("y",)
    # The weight of the idle joint's roughness is 1e-6 of the time.
    costate = np.abs(solution.costates.costate)
    assert costate[:, [1, 3]].max() < 1e-4 * costate[:, [0, 2]].max()


def test_no_joint_is_idle_where_every_torque_is_on_its_limit():
    assert solved("rr").certificate.idle == ()


def test_the_claim_of_local_optimality_says_how_it_is_known():
    exact = replace(LANDED, hamiltonian_spread=1e-6, switching_violation=0.0)
    meshed = replace(LANDED, saving=3e-5)
    assert exact.claims == "locally optimal (Pontryagin)"
    assert meshed.extremal and meshed.claims == "locally optimal (to first order, within 0.003 %)"
    assert meshed.bounded(1.0, 1.02).claims.endswith("0.003 %), proven within 2 % of the fastest")
    assert replace(LANDED, saving=3e-4).claims == "not proven optimal"
