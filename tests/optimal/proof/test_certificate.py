from dataclasses import replace

import armdyn as ad
from armdyn.optimal.proof.certificate import certify
from problems import solved


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
