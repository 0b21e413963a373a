from dataclasses import replace

import pytest

import armdyn as ad
from armdyn.optimal.proof.certificate import certify, limit_violation
from problems import paper_problem, solved


def test_certificate_refuses_what_is_not_optimal():
    solution = solved("rr")
    problem = solution.problem
    slower = solution.local_optima[0]
    assert slower > solution.duration  # the other optimum is an extremal too: only the search tells them apart
    # Its torques are on the limits of this problem; with limits twice as wide they are on none.
    wider = replace(problem, effort_limit=6.0)
    certificate = certify(wider, solution.trajectory, solution.phases)
    assert any("sign" in reason for reason in certificate.reasons)  # its torques could still go further out
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
    without = certify(problem, solution.trajectory, None, "asked for no arcs")
    assert not without.ok and without.reasons == ("asked for no arcs",)


def test_limit_violation_looks_between_samples():
    problem = paper_problem("r", velocity_limit=1.0)
    # Between two samples at 0.9 rad/s the cubic speeds up to 1.5 times the mean slope less a quarter.
    motion = ad.Trajectory([0, 1], [[0.0], [1.2]], [[0.9], [0.9]], [[0.0], [0.0]])
    fastest = 1.5 * 1.2 - 0.5 * 0.9
    assert limit_violation(problem, motion) == pytest.approx(fastest - 1.0, rel=1e-9)
