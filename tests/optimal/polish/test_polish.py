"""Exact switching times from a mesh: closed forms, shooting of the same arcs, and motions that have none."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.polish.polish import polished
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.costates import pontryagin
from armdyn.paper import solve_indirect
from problems import cart, mesh_alone, paper_problem, random_solution, solved


def task_of(problem):
    return Task.of(problem, MinimumTimeOptions(compile=False))


def hasty(problem, wrong):
    """A bang-bang guess of a cart of 1 kg with 1 N over 2 m, whose switch is off by a part."""
    t = np.linspace(0, 2 * np.sqrt(2), 41)
    v = np.minimum(t, t[-1] - t)
    q = np.where(t < np.sqrt(2), t**2 / 2, 2 - (t[-1] - t) ** 2 / 2)
    tau = np.sign((1 + wrong) * np.sqrt(2) - t)[:, None]
    return ad.Trajectory(t, q[:, None], v[:, None], tau, problem.robot.joint_names, "mesh", hold="zero-order")


def test_double_integrator_in_closed_form():
    # t_f = 2 √(m d / F), the switch in the middle; ρ = (-1/√2, ∓1) at the ends.
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0])
    found = polished(task_of(problem), hasty(problem, 0.1), set())
    np.testing.assert_allclose([arc.duration for arc in found.arcs], np.sqrt(2), rtol=1e-10)
    np.testing.assert_allclose(found.costate[[0, -1]], [[-1 / np.sqrt(2), -1], [-1 / np.sqrt(2), 1]], atol=1e-9)


def test_a_motion_that_touches_a_limit_has_no_bang_arcs_alone():
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], velocity_limit=np.sqrt(2))
    assert polished(task_of(problem), hasty(problem, 0.1), set()) is None


def test_too_few_switches_have_no_motion():
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0])
    assert polished(task_of(problem), hasty(problem, 2.0), set()) is None  # it never brakes


def test_more_switches_than_conditions_satisfy_pontryagin_s_conditions():
    # Five arcs, whose four switching times and duration meet four conditions at the goal.
    with pytest.warns(ad.ArmdynWarning, match="hold the goal"):
        problem = paper_problem("rr", 0.5)
    best = solved_with(problem)
    found = polished(task_of(problem), best.trajectory, set())
    hamiltonian, _, violation = pontryagin(problem, found)
    assert np.max(np.abs(hamiltonian)) < 1e-6 and violation < 1e-5
    assert len(found.arcs) == 5
    assert found.duration == pytest.approx(best.duration, rel=1e-9)


def solved_with(problem):
    return ad.solve_minimum_time(problem, ad.MinimumTimeOptions(bound=False))


@pytest.mark.parametrize(
    "solution",
    [
        lambda: solved("rr"),
        pytest.param(lambda: random_solution(6), marks=pytest.mark.slow),
        pytest.param(lambda: random_solution(12), marks=pytest.mark.slow),
    ],
)
def test_shooting_of_the_canonical_system_agrees(solution):
    # Root finding of the paper's second approach, with costates as unknowns; it starts from the polished ones.
    own = solution()
    other = solve_indirect(own.problem, own)
    assert other.success, other.message
    assert own.duration == pytest.approx(other.duration, rel=1e-8)
    scale = np.max(np.abs(other.costates), axis=0)
    for k in (0, -1):
        np.testing.assert_allclose(own.phases.costate[k] / scale, other.costates[k] / scale, atol=1e-4)


@pytest.mark.parametrize("arm", ["rr", pytest.param("rrr", marks=pytest.mark.slow)])
def test_the_motion_of_a_resolved_mesh_is_polished_to_the_same(arm):
    problem = paper_problem(arm, position_limit=(-np.inf, np.inf))
    mesh, exact = mesh_alone(problem, starts=40), solved_with(problem)
    found = polished(task_of(problem), mesh.trajectory, set())
    if mesh.duration < (1 + 1e-6) * exact.duration:  # else the few guesses found another optimum
        assert found.duration == pytest.approx(exact.duration, rel=1e-8)
    assert found.duration <= mesh.duration
    assert found.duration == pytest.approx(mesh.duration, rel=3e-6)  # the mesh's resolution
