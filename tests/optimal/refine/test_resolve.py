"""From a mesh's solution to arcs, or to the motion of a resolved mesh."""

import pytest

import armdyn as ad


@pytest.mark.slow
def test_arcs_with_a_wrong_sign_give_way_to_a_resolved_mesh():
    """Its switching structure ends with a switching function of the wrong sign, by 4e-4 of a torque's range."""
    links = (
        ad.LinkSpec(length=0.5823, com=0.4612, mass=0.5095, inertia=0.01647),
        ad.LinkSpec(length=0.4924, com=0.3009, mass=0.2761, inertia=0.005306),
        ad.LinkSpec(length=0.54, com=0.27, mass=0.04155, inertia=0.001677),
    )
    problem = ad.MinimumTimeProblem(
        ad.Robot.from_spec(ad.ArmSpec(name="rrr", links=links), ad.Payload(mass=0.01971)),
        q_start=[-1.6994, -2.5563, -2.4354],
        q_goal=[-1.7385, 0.7317, 2.0545],
        effort_limit=[2.2874, 1.1361, 1.557],
        velocity_limit=[12.726, 27.469, 42.489],
    )
    solution = ad.solve_minimum_time(problem)
    assert solution.certified and not solution.arcs
    assert solution.certificate.saving < 1e-5  # of the duration
