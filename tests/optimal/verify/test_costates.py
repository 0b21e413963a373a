"""Derivatives by the costates of a mesh and of arcs: against closed forms, one another, and differences of solves."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.dynamics.numeric import joint_inertia
from armdyn.optimal.mesh.mesh_costates import MeshCostates
from problems import cart, gantry_problem, luus_problem, mesh_alone, paper_arm, paper_problem, solve

SMALL = 2e-3
"""Step of differences of durations that the mesh resolves to 1e-8 of itself: 1e-5 of a derivative's relative error, and
the third derivative's part, 1e-6."""


def on_the_rail(**limits):
    return ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], **limits)


def assert_same_derivatives(problem, tolerance):
    """Of the mesh as of the arcs, each as a part of the largest of its kind."""
    arcs, mesh = solve(problem, workers=1, bound=False), mesh_alone(problem)
    assert arcs.arcs and isinstance(mesh.costates, MeshCostates)
    mine, theirs = mesh.sensitivities(), arcs.sensitivities()
    assert mine.payload_mass == pytest.approx(theirs.payload_mass, rel=tolerance)
    for name in ("effort_upper", "effort_lower", "velocity"):
        own, other = getattr(mine, name), getattr(theirs, name)
        np.testing.assert_allclose(own, other, rtol=0, atol=tolerance * max(np.max(np.abs(other)), 1e-12))
    end, other = mesh.costates.costate[-1], arcs.costates.costate[-1]
    np.testing.assert_allclose(end, other, rtol=0, atol=tolerance * np.max(np.abs(other)))
    shares = {share.name: share.part for share in arcs.decides}
    assert {share.name: share.part for share in mesh.decides} == pytest.approx(shares, abs=tolerance)


def test_the_mesh_has_the_closed_forms_of_a_double_integrator():
    # t = √(2 d m (1/F₊ + 1/F₋)) with F₊ = F₋ = 1 N, d = 2 m, m = 1 kg: ∂t/∂F₊ = −t/4, ∂t/∂m = t/2, ∂t/∂d = t/4.
    solution, t = mesh_alone(on_the_rail()), np.sqrt(8)
    by = solution.sensitivities()
    # The switch lies within an interval of the mesh, which is a thousandth of the time or less.
    assert by.effort_upper[0] == pytest.approx(-t / 4, rel=1e-6)
    assert by.effort_lower[0] == pytest.approx(t / 4, rel=1e-6)
    assert by.payload_mass == pytest.approx(t / 2, rel=1e-6)
    assert by.velocity[0] == 0
    assert -solution.costates.costate[-1, 0] == pytest.approx(t / 4, rel=1e-6)
    (share,) = solution.decides
    assert share.part == pytest.approx(1 / 2, rel=1e-6)


def test_the_mesh_has_the_closed_forms_of_a_velocity_limit():
    # t = d/v + v/a: ∂t/∂v = −d/v² + 1/a, ∂t/∂F = −v/F², of which each side has half.
    by = mesh_alone(on_the_rail(velocity_limit=0.8)).sensitivities()
    # The mesh is 3e-6 within the velocity limit (policy.motion_mesh.inside), and as much slower.
    assert by.velocity[0] == pytest.approx(1 - 2 / 0.64, rel=5e-5)
    assert by.effort_upper[0] == pytest.approx(-0.4, rel=5e-5)
    assert by.effort_lower[0] == pytest.approx(0.4, rel=5e-5)


@pytest.mark.parametrize(
    ("problem", "tolerance"),
    [
        pytest.param(paper_problem("r"), 1e-6, id="r"),
        pytest.param(gantry_problem(), 1e-6, id="idle joint", marks=pytest.mark.slow),
        pytest.param(paper_problem("rr"), 1e-4, id="rr", marks=pytest.mark.slow),
        pytest.param(luus_problem().variant(velocity_limit=1.0), 1e-4, id="velocity limit", marks=pytest.mark.slow),
    ],
)
def test_mesh_and_arcs_agree(problem, tolerance):
    """Of two links 1e-5 was measured, where a change of the mesh's motion saves 2e-6 at most; ten times is allowed."""
    assert_same_derivatives(problem, tolerance)


@pytest.mark.slow
def test_passive_joints_and_friction():
    robot = ad.Robot.from_library("cart_pole", effort_limit=3.0)
    assert_same_derivatives(ad.MinimumTimeProblem(robot, q_start=[0.0, 0.0], q_goal=[1.0, 0.0]), 1e-4)
    bare, rough = paper_problem("rr"), paper_arm("rr").with_friction(0.1, 0.2)
    assert_same_derivatives(ad.MinimumTimeProblem(rough, q_start=bare.q_start, q_goal=bare.q_goal), 1e-4)


@pytest.mark.slow
def test_a_torque_that_holds_another_joints_velocity_limit_by_differences():
    """Most of the time joint 2's torque holds joint 1 on its velocity limit, while joint 1's torque is on its own."""

    def limited(most):
        return paper_problem("rr", velocity_limit=8.0, effort_limit=([-3.0, -3.0], [most, 3.0]))

    by = mesh_alone(limited(3.0)).sensitivities()
    more, less = (mesh_alone(limited(3.0 + step)).duration for step in (SMALL, -SMALL))
    assert by.effort_upper[0] == pytest.approx((more - less) / (2 * SMALL), rel=1e-3)
    assert by.effort_upper[0] < -0.025


@pytest.mark.slow
def test_a_joint_that_time_leaves_open_is_idle_on_a_mesh_as_on_arcs():
    problem = gantry_problem()
    for solution in (mesh_alone(problem), solve(problem, workers=1)):
        assert solution.certificate.idle == ("y",)
    # A pole has no torque to switch, and no joint is idle.
    robot = ad.Robot.from_library("cart_pole", effort_limit=3.0)
    pole = ad.MinimumTimeProblem(robot, q_start=[0.0, 0.0], q_goal=[1.0, 0.0])
    assert mesh_alone(pole).certificate.idle == mesh_alone(paper_problem("rr")).certificate.idle == ()


def test_integrals_are_those_of_the_costates_at_the_knots():
    costates, robot = mesh_alone(paper_problem("r")).costates, paper_arm("r")
    h, rho = np.diff(costates.t), costates.costate[:, 1:]
    # The trapezoidal rule is off by a curvature's part, 1e-4 on a mesh of some hundred intervals.
    assert costates.pushed.sum() == pytest.approx(h @ (rho[:-1] + rho[1:])[:, 0] / 2, rel=1e-3)
    S = np.linalg.solve(joint_inertia(robot)(costates.points[0]), np.ones((len(costates.pushed), 1, 1)))[:, 0]
    np.testing.assert_allclose(costates.switched, S * costates.pushed, rtol=1e-9, atol=1e-15)
