"""Minimum-time solves from search to sensitivities, against exact and published durations."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.answer.solution import minimum_time_summary
from armdyn.optimal.minimum_time import solve_task
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.optimum import trajectory_cost
from problems import cart, luus_problem, mesh_alone, paper_arm, paper_problem, solve, solved

# Exact bang-bang durations of Example 1 [s], payload at the tip, by quadrature of the energy integral.
R_EXACT = {
    0.0212: 0.14821160378169002,
    0.0312: 0.15256368080070265,
    0.0518: 0.1611059069013823,
    0.1006: 0.17949750225056943,
    0.1219: 0.1868717714980484,
    0.1307: 0.18982126559774137,
    0.1505: 0.19626968857366017,
    0.2: 0.21140382789979642,
    0.5: 0.28527648488914076,
    1.0: 0.3850872149537221,
}

# Best known of Example 2 [s], payload at the tip, without position limits.
RR_BEST = {
    0.0212: 0.17824211888875166,
    0.1006: 0.21067170186256495,
    0.5: 0.29361597136964557,
    1.0: 0.3644763653735844,
}


def test_double_integrator_in_closed_form():
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0])
    solution = solve(problem)
    assert solution.certificate.ok, solution.message
    assert solution.duration == pytest.approx(2 * np.sqrt(2), rel=1e-9)
    np.testing.assert_allclose([arc.duration for arc in solution.arcs], np.sqrt(2), rtol=1e-8)
    # t_f = 2 √(m d / F): costates, H and both derivatives are known.
    by = solution.sensitivities()
    assert by.effort()[0] == pytest.approx(-np.sqrt(2), rel=1e-6)
    assert by.payload_mass == pytest.approx(np.sqrt(2), rel=1e-6)
    np.testing.assert_allclose(solution.costates.costate[0], [-1 / np.sqrt(2), -1.0], rtol=1e-6)


def test_double_integrator_with_a_velocity_limit_in_closed_form():
    # Up to 0.8 m/s at 1 m/s², cruise, down: t = d/v + v/a.
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], velocity_limit=0.8)
    solution = solve(problem)
    assert solution.certificate.ok, solution.message
    # The mesh stays 5e-7 within the limit.
    assert solution.duration == pytest.approx(2 / 0.8 + 0.8, rel=1e-6)
    assert [arc.modes[0] for arc in solution.arcs] == ["torque upper", "velocity upper", "torque lower"]
    # ∂t/∂v = 1/a − d/v².
    assert solution.sensitivities().velocity[0] == pytest.approx(1 - 2 / 0.64, rel=1e-5)


@pytest.mark.parametrize("mass", R_EXACT)
def test_one_link_is_exact(mass):
    solution = solve(paper_problem("r", mass))
    assert solution.certificate.ok, solution.message
    # 1e-8: the point mass's stand-in inertia of 1e-12 kg m² shows at 1e-10.
    assert solution.duration == pytest.approx(R_EXACT[mass], rel=1e-8)


@pytest.mark.filterwarnings("ignore::armdyn.ArmdynWarning")  # 0.5 and 1 kg cannot be held at the goal
@pytest.mark.parametrize("mass", RR_BEST)
def test_two_links_are_the_best_known_and_certified(mass):
    solution = solve(paper_problem("rr", mass, position_limit=(-np.inf, np.inf)))
    assert solution.certificate.ok, solution.message
    assert solution.duration <= RR_BEST[mass] + 1e-6
    assert solution.certificate.limit_violation == 0  # every torque is exactly on a limit or inside


def test_luus_two_link_and_its_other_optimum():
    task = Task.of(luus_problem())  # both are refined: else the slower one is listed as a mesh has it
    solution = solve_task(replace(task, policy=task.policy.changed("same", slower=1.1, error_factor=1e9)))
    assert solution.certificate.ok, solution.message
    assert solution.duration == pytest.approx(2.982279943, abs=1e-7)
    assert any(other == pytest.approx(3.20834535, abs=1e-4) for other in solution.local_optima)
    # Switching times by Newton on the switching conditions, an independent computation.
    starts = np.cumsum([arc.duration for arc in solution.arcs])[:-1]
    np.testing.assert_allclose(starts, [0.94314035, 1.49113997, 2.62754505], atol=1e-6)


@pytest.mark.slow
def test_three_links_without_position_limits():
    solution = solve(paper_problem("rrr", position_limit=(-np.inf, np.inf)))
    assert solution.duration <= 0.2193035  # best known 0.21930342
    assert solution.certificate.ok, solution.message
    assert len(solution.local_optima) >= 2


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::armdyn.ArmdynWarning")  # 1 kg cannot be held at the goal
def test_a_payload_too_heavy_for_coarse_meshes():
    """1 kg within ±π: meshes of 15 to 60 intervals promise 0.22 to 0.40 s, and no replay of theirs lands."""
    solution = solve(paper_problem("rrr", 1.0))
    assert solution.certificate.ok, solution.message
    assert solution.duration < 0.417304  # the results of two searches on other meshes
    accuracy = 1e-11 * solution.certificate.growth  # the integrators' own errors, grown to the end
    assert solution.replay_error < 1e-9 + accuracy


def test_same_seed_same_answer():
    first, second = (solve(paper_problem("rr"), seed=3) for _ in range(2))
    assert first.duration == second.duration
    assert first.local_optima == second.local_optima


@pytest.mark.slow
def test_without_exact_times_the_mesh_answers_and_says_so():
    solution, exact = mesh_alone(paper_problem("rr")), solved("rr")
    assert "to first order a change saves at most" in minimum_time_summary(solution)["checks"][-2]["said"]
    assert solution.arcs and solution.sensitivities() is not None
    assert solution.duration == pytest.approx(exact.duration, rel=1e-6)  # the mesh's resolution


@pytest.mark.slow
def test_effort_weight_is_smooth_and_matches_the_reference():
    # Durations of ∫(1 + ½τ²)dt [s] without torque bound: independent collocation, re-integrated.
    for arm, expected in (("r", 0.31030416405287503), ("rr", 0.40677661719571767)):
        solution = solve(paper_problem(arm, effort_weight=1.0, effort_limit=50.0))
        # Torques that are linear between the samples of the replay: 1e-6; by the reference's own account 1e-4.
        assert solution.duration == pytest.approx(expected, abs=5e-6)
        assert solution.certificate.ok


@pytest.mark.slow
def test_effort_weight_is_judged_by_cost_not_by_duration():
    """RR, 100.6 g: the optimum that a straight guess finds is faster, J = 0.5704; the best has 0.5577."""
    solution = solve(paper_problem("rr", effort_weight=1.0, effort_limit=50.0), workers=1)
    assert trajectory_cost(solution.trajectory, 1.0) == pytest.approx(0.55773201, rel=1e-6)  # the reference's
    plain = solve(paper_problem("rr", effort_weight=1.0, effort_limit=50.0), starts=1)
    assert plain.duration < solution.duration
    assert trajectory_cost(plain.trajectory, 1.0) > trajectory_cost(solution.trajectory, 1.0)


def test_all_robots_are_the_same_after_a_solve():
    robot = paper_arm("rr")
    before = robot.model.saveToString()
    solve(ad.MinimumTimeProblem(robot, q_start=[0, 0], q_goal=[0.5, -0.5]))
    assert robot.model.saveToString() == before


def test_two_links_land_when_replayed():
    solution = solved("rr")
    assert solution.status is ad.Status.SOLVED
    # Best known 0.21067170 s: a local solution may be slower, none may be faster.
    assert solution.duration > 0.2106717
    replay = ad.replay_torques(solution.problem.robot, solution.trajectory)
    # The claimed error is no better than this, and two integrators agree on it.
    assert np.max(np.abs(replay.q[-1] - solution.problem.q_goal)) <= solution.replay_error < 1e-9
    assert np.max(np.abs(solution.trajectory.tau)) <= 3 * (1 + 1e-7)  # IPOPT's relaxed bounds


@pytest.mark.slow
def test_velocity_limit_holds_and_costs_time():
    problem = paper_problem("rr", velocity_limit=12.0)
    slow = solve(problem, max_intervals=80)
    # A solution that is not certified has its error; a velocity is held by the collocation, not by the replay.
    assert np.max(np.abs(slow.trajectory.v)) <= 12 * (1 + max(1e-6, slow.certificate.limit_violation))
    assert slow.certificate.limit_violation < 1e-3
    assert slow.duration > max(solved("rr").duration, problem.duration_bound())


def test_moving_start_and_goal():
    problem = paper_problem("rr", v_start=[3.0, -2.0], v_goal=[1.0, 1.0])
    solution = solve(problem)
    np.testing.assert_allclose(solution.trajectory.v[[0, -1]], [[3, -2], [1, 1]], atol=1e-9)
    assert solution.replay_velocity_error < 1e-2


def test_library_arm_within_torque_and_velocity_limits():
    robot = ad.Robot.from_library("panda")
    problem = ad.MinimumTimeProblem(
        robot,
        q_start=[0, -0.785, 0, -2.356, 0, 1.571, 0.785],
        q_goal=[1.0, 0.2, 0.5, -1.5, 0.3, 2.0, -0.5],
    )
    # Joint 7 turns 1.285 rad at no more than 2.61 rad/s.
    assert problem.duration_bound() == pytest.approx(1.285 / 2.61, rel=1e-12)
    solution = solve(problem, starts=1, calm=0.0)
    # A curve of twice the intervals takes 0.493396 s.
    assert 0.4933 < solution.duration < 0.49345
    assert solution.replay_error < 1e-6  # torques follow the curve; 1e-9 measured
    assert np.all(np.abs(solution.trajectory.v) <= robot.limits.velocity * (1 + 1e-7))


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        (
            {"velocity_limit": 1e-9},
            r"velocity limit 1e-09 rad/s: its way of 0.4 rad takes 4e\+08 s .*`velocity_limit` of 0.00011",
        ),
        (
            {"acceleration_limit": 1e-9},
            r"acceleration limit 1e-09 rad/s²: .* takes 4e\+04 s .*`acceleration_limit` of 1.2e-07",
        ),
        ({"jerk_limit": 1e-12}, r"jerk limit 1e-12 rad/s³: .*`jerk_limit` of 2.7e-10 rad/s³ or more"),
    ],
)
def test_limits_that_let_no_motion_take_less_than_an_hour_are_refused(limits, said):
    robot = ad.Robot.from_library("ur5")
    problem = ad.MinimumTimeProblem(robot, q_start=[0.1] * 6, q_goal=[0.5] * 6, **limits)
    with pytest.raises(ProblemError, match=said):
        ad.solve_minimum_time(problem)


@pytest.mark.slow
def test_without_a_bound_the_motion_is_the_same_and_no_gap_is_known():
    arm = ad.Robot.from_library("panda")
    ready = np.array([0, -0.785, 0, -2.356, 0, 1.571, 0.785])
    problem = ad.MinimumTimeProblem(arm, q_start=ready, q_goal=ready + 0.4)
    bare, whole = (ad.solve_minimum_time(problem, ad.MinimumTimeOptions(bound=each, calm=0)) for each in (False, True))
    assert bare.usable
    assert bare.duration == pytest.approx(whole.duration, rel=1e-9)
    assert bare.lower_bound is None
    assert whole.lower_bound is not None


def test_a_method_by_name_is_the_method():
    problem = paper_problem("r")
    mesh, curve = (
        ad.solve_minimum_time(problem, ad.MinimumTimeOptions(method=name, starts=1, workers=1))
        for name in ("mesh", "curves")
    )
    assert mesh.certified and mesh.phases is not None and curve.usable and curve.phases is None
    assert 1 < curve.duration / mesh.duration < 1.01  # a smooth torque does not jump: it costs up to half a percent
    limited = problem.variant(acceleration_limit=5.0, effort_limit=10.0)
    profile = ad.solve_minimum_time(limited, ad.MinimumTimeOptions(method="profiles", workers=1))
    way = abs(float(problem.q_goal[0] - problem.q_start[0]))
    assert profile.duration == pytest.approx(
        2 * (way / 5.0) ** 0.5, rel=2e-5
    )  # the motion is slowed down by 1e-5 to keep the limit between samples
