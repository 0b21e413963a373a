"""Time-energy optima by the direct method."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.mesh.smooth import cost, resolved_near, smooth_optima, time_energy
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.status import Stop
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.optimum import trajectory_cost
from problems import cart, paper_problem, solve


def search(problem, count, stop=None):
    optima, _ = smooth_optima(Task.of(problem, stop=stop), 6, count)
    return optima


def test_cost_of_linear_torques_is_exact():
    motion = ad.Trajectory([0, 1, 3], np.zeros((3, 1)), np.zeros((3, 1)), [[0], [2], [-1]])
    # ∫ τ² = 4/3 on the first second, 2 (4 - 2 + 1)/3 on the other two.
    assert trajectory_cost(motion, 1.0) == pytest.approx(3 + (4 / 3 + 2) / 2)
    assert trajectory_cost(motion, 0.0) == 3


def test_double_integrator_in_closed_form():
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[1.0], effort_weight=2.0, effort_limit=50.0)
    phases = resolved_near(Task.of(problem), spline(problem, []))
    duration = (18 * 2.0) ** 0.25  # of J = T + 6 w d²/T³
    assert phases.duration == pytest.approx(duration, rel=1e-7)  # J is flat there: IPOPT's 1e-10 leaves 1e-8
    assert cost(problem, phases) == pytest.approx(4 / 3 * duration, rel=1e-9)


@pytest.mark.slow
def test_optima_come_by_cost_and_the_first_is_not_the_fastest():
    problem = paper_problem("rr", effort_weight=1.0)
    found = search(problem, 6)
    costs = [cost(problem, phases) for phases in found]
    assert len(found) >= 2 and np.all(np.diff(costs) > 0)
    assert costs[0] == pytest.approx(0.5577320121886695, rel=1e-7)  # the reference's J
    assert found[1].duration < found[0].duration  # by duration the choice would be wrong


@pytest.mark.slow
def test_a_limit_that_is_touched_is_named_though_the_mesh_nearly_has_it():
    """RRR with 31.2 g: H strays by 2.5e-5 where joint 2 touches π unnamed, and by more on every finer mesh."""
    problem = paper_problem("rrr", 0.0312, effort_weight=1.0, effort_limit=30.0)
    solution = ad.solve_minimum_time(problem)
    assert solution.certified
    assert trajectory_cost(solution.trajectory, 1.0) == pytest.approx(0.58613, rel=2e-5)  # the reference's has 5 digits
    assert any(arc.touches for arc in solution.arcs)


@pytest.mark.slow
def test_a_guess_is_looked_at_first_and_leads_where_one_start_does_not():
    problem = paper_problem("rr", 0.1219, effort_weight=1.0)
    near = solve(paper_problem("rr", 0.1006, effort_weight=1.0), workers=1).trajectory
    options = ad.MinimumTimeOptions(starts=1, guesses=(near,))
    (optimum,), found = time_energy(Task.of(problem, options))
    assert optimum.cost == pytest.approx(0.5781908970767553, rel=1e-7)  # the reference's J
    alone = time_energy(Task.of(problem, ad.MinimumTimeOptions(starts=1)))[0][0]
    assert alone.cost > 1.01 * optimum.cost
    assert found.listed[0] == pytest.approx(optimum.trajectory.duration, rel=1e-6)


def test_a_guess_of_other_joints_is_refused():
    guess = ad.Trajectory([0, 1], np.zeros((2, 1)), np.zeros((2, 1)), np.zeros((2, 1)))
    with pytest.raises(ProblemError, match=r"guesses\[0\] moves 1 joint, rr has 2"):
        Task.of(paper_problem("rr", effort_weight=1.0), ad.MinimumTimeOptions(guesses=(guess,)))


def test_a_large_hamiltonian_on_the_finest_mesh_is_reported_as_no_optimum(monkeypatch):
    monkeypatch.setattr("armdyn.optimal.mesh.smooth._hamiltonian_error", lambda problem, phases: 0.5)
    problem = paper_problem("r", effort_weight=1.0, effort_limit=30.0)
    optima, found = time_energy(Task.of(problem))
    assert not optima and found.failed[0].status is ad.Status.FAILED
    assert "on 120 intervals is no optimum: the Hamiltonian strays from 0 by 0.5" in found.failed[0].message


def test_as_many_as_requested_and_none_once_stopped():
    problem = paper_problem("rr", effort_weight=1.0)
    assert len(search(problem, 1)) == 1
    assert search(problem, 6, Stop(deadline=0.0)) == ()


@pytest.mark.parametrize(("effort", "count"), [("quick", 6), ("normal", 16), ("thorough", 80)])
def test_effort_says_how_many_guesses_there_are(monkeypatch, effort, count):
    counts = []

    def searched(task, starts):
        counts.append(starts)
        return []

    monkeypatch.setattr("armdyn.optimal.mesh.smooth._searched", searched)
    assert time_energy(Task.of(paper_problem("rr", effort_weight=1.0), ad.MinimumTimeOptions(search=effort)))[0] == []
    assert counts == [count]


@pytest.mark.slow
def test_where_costates_stray_from_the_adjoint_equations_the_replay_is_finer(monkeypatch):
    task = Task.of(paper_problem("rr", effort_weight=1.0, effort_limit=30.0))
    (plain,), _ = time_energy(task)
    strays = plain.certificate.adjoint_error
    monkeypatch.setattr("armdyn.optimal.mesh.smooth.OPTIMALITY_TOLERANCE", strays / 2)
    (finer,), _ = time_energy(task)
    assert finer.intervals == 2 * plain.intervals and finer.trajectory.t.size >= 2 * plain.trajectory.t.size
    assert finer.certificate.adjoint_error < strays / 2
    assert finer.cost == pytest.approx(plain.cost, rel=1e-8)
