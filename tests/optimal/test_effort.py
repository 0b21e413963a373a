"""Time and energy on a mesh: closed forms, the reference's optima, and their choice by J."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.curves.curves import rough_motions
from armdyn.optimal.mesh.mesh import mesh
from armdyn.optimal.mesh.search import find
from armdyn.optimal.problem.status import Stop
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import OPTIMALITY_TOLERANCE
from armdyn.optimal.verify.costates import adjoint_error
from armdyn.optimal.verify.optimum import trajectory_cost
from problems import cart, paper_problem, solve


def test_cost_of_linear_torques_is_exact():
    motion = ad.Trajectory([0, 1, 3], np.zeros((3, 1)), np.zeros((3, 1)), [[0], [2], [-1]])
    # ∫ τ² = 4/3 on the first second, 2 (4 - 2 + 1)/3 on the other two.
    assert trajectory_cost(motion, 1.0) == pytest.approx(3 + (4 / 3 + 2) / 2)
    assert trajectory_cost(motion, 0.0) == 3


def test_double_integrator_in_closed_form():
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[1.0], effort_weight=2.0, effort_limit=50.0)
    solution = solve(problem, workers=1, compile=False)
    duration = (18 * 2.0) ** 0.25  # of J = T + 6 w d²/T³, by a torque that is linear in time, and so in an interval
    assert solution.duration == pytest.approx(duration, rel=1e-7)  # J is flat there
    assert trajectory_cost(solution.trajectory, 2.0) == pytest.approx(4 / 3 * duration, rel=1e-9)
    # ρ_q = -∂J/∂d = -12 w d/T³; the torque falls from 6 d/T² at the rate of ρ_q/w.
    np.testing.assert_allclose(solution.costates.costate[:, 0], -24 / duration**3, rtol=1e-5)
    np.testing.assert_allclose(solution.costates.costate[[0, -1], 1], [-12 / duration**2, 12 / duration**2], rtol=1e-5)
    assert "no change saves more than" in str(solution) and "of its cost" in str(solution)
    assert solution.certified and solution.certificate.saving < 1e-6


@pytest.mark.slow
def test_optima_come_by_cost_and_the_first_is_not_the_fastest():
    problem = paper_problem("rr", effort_weight=1.0)
    found = find(Task.of(problem)).attempts
    costs = [attempt.cost for attempt in found]
    assert len(found) >= 2 and np.all(np.diff(costs) > 0)
    assert 0 < costs[0] / 0.5577320121886695 - 1 < 2e-4  # the reference's J; constant torques in 80 intervals cost more
    assert found[1].trajectory.duration < found[0].trajectory.duration  # by duration the choice would be wrong
    (optimum, *_), _ = mesh(Task.of(problem), rough_motions)
    assert optimum.cost == pytest.approx(0.5577320121886695, rel=1e-7)  # J of linear torques is right to 1e-9


@pytest.mark.slow
def test_a_limit_that_is_touched_is_named():
    """RRR with 31.2 g: joint 2 touches π."""
    problem = paper_problem("rrr", 0.0312, effort_weight=1.0, effort_limit=30.0)
    solution = ad.solve_minimum_time(problem)
    assert solution.certified
    assert trajectory_cost(solution.trajectory, 1.0) == pytest.approx(0.58613, rel=2e-5)  # the reference's has 5 digits
    assert any(arc.touches for arc in solution.arcs)


@pytest.mark.slow
def test_a_guess_leads_where_one_start_does_not():
    problem = paper_problem("rr", 0.1219, effort_weight=1.0)
    near = solve(paper_problem("rr", 0.1006, effort_weight=1.0), workers=1).trajectory
    (optimum, *_), _ = mesh(Task.of(problem, ad.MinimumTimeOptions(starts=1, guesses=(near,))), rough_motions)
    assert optimum.cost == pytest.approx(0.5781908970767553, rel=1e-7)  # the reference's J
    (alone, *_), _ = mesh(Task.of(problem, ad.MinimumTimeOptions(starts=1)), rough_motions)
    assert alone.cost > 1.01 * optimum.cost


def test_a_guess_of_other_joints_is_refused():
    guess = ad.Trajectory([0, 1], np.zeros((2, 1)), np.zeros((2, 1)), np.zeros((2, 1)))
    with pytest.raises(ProblemError, match=r"guesses\[0\] moves 1 joint, rr has 2"):
        Task.of(paper_problem("rr", effort_weight=1.0), ad.MinimumTimeOptions(guesses=(guess,)))


def test_none_once_stopped():
    optima, found = mesh(Task.of(paper_problem("rr", effort_weight=1.0), stop=Stop(deadline=0.0)), rough_motions)
    assert not optima and not found.attempts


@pytest.mark.parametrize(("level", "count"), [("quick", 67), ("normal", 200), ("thorough", 1000)])
def test_the_level_of_search_says_how_many_guesses_there_are(level, count):
    task = Task.of(paper_problem("rr", effort_weight=1.0), ad.MinimumTimeOptions(search=level))
    assert task.policy.search.guesses(task.options) == count


@pytest.mark.parametrize("arm", ["r", pytest.param("rr", marks=pytest.mark.slow)])
def test_costates_keep_the_adjoint_equations_where_effort_is_paid_for(arm):
    """The adjoint equations integrated otherwise, along the replay: the costates of the mesh are no part of it."""
    solution = solve(paper_problem(arm, effort_weight=1.0, effort_limit=50.0))
    costates = solution.costates
    assert adjoint_error(solution.problem.robot, solution.trajectory, costates) < 0.1 * OPTIMALITY_TOLERANCE
    n, w = solution.problem.robot.nv, solution.problem.effort_weight
    # Off the limits the torque minimises H = 1 + w/2 τᵀτ + ρᵀf: S = w τ + ρ_v M⁻¹ is zero, and so is H.
    a = ad.Dynamics(solution.problem.robot)
    tau = np.vstack([costates.tau[:, 0], costates.tau[-1:, 1]])
    rows = zip(costates.q, costates.v, tau, costates.costate, strict=True)
    h = [1 + w / 2 * t @ t + r[:n] @ v + r[n:] @ np.array(a.aba(q, v, t)).ravel() for q, v, t, r in rows]
    np.testing.assert_allclose(h, 0.0, atol=3e-4)  # its mean is the saving, of at most 1e-4
