"""The indirect method against exact and published-case references, and against the direct one."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal import Status
from armdyn.paper import IndirectOptions, compare_with_direct, solve_indirect
from problems import POSES, cart, paper_problem

FREE = IndirectOptions(bounded=False)
ANYWHERE = (-np.inf, np.inf)

# Durations and J of the optimum of ∫(1 + ½τᵀτ)dt without torque bound [s]: independent collocation, re-integrated.
# RR has several local optima; these are of the least J known. At 500 g two of them differ by 3e-3 of J.
TIME_ENERGY = {
    ("r", "tip", 0.0212): (0.26024668094683284, 0.3403174358522397),
    ("r", "tip", 0.1006): (0.31030416405287503, 0.41308930256268295),
    ("r", "mM", 1.0): (0.4343211126068135, 0.9955419782232015),
    ("rr", "tip", 0.0212): (0.35872572980856954, 0.4729566687533758),
    ("rr", "tip", 0.1006): (0.40677661719571767, 0.5577320121886695),
    ("rr", "mM", 0.1006): (0.3650041740708707, 0.5088623770543431),
    ("rr", "tip", 0.5): (0.47046641752993806, 1.0060152972671206),
}

# Exact bang-bang durations of Example 1 [s], by quadrature of the energy integral.
R_EXACT = {
    ("tip", 0.0212): 0.14821160378169002,
    ("tip", 0.1006): 0.17949750225056943,
    ("tip", 1.0): 0.3850872149537221,
    ("mM", 0.1006): 0.1652642194945807,
    ("mM", 1.0): 0.31240093323285334,
}
RR_BEST = 0.21067170186256495
"""Best known of Example 2 with 100.6 g at the tip [s]."""


@cache
def free_time_energy(arm, reading, mass):
    """Optimum of an example without torque bound."""
    return solve_indirect(problem_of(arm, reading, mass, effort_weight=1.0), options=FREE)


@cache
def bounded_rr():
    """Time-energy optimum of Example 2 with 100.6 g, within the torque limits."""
    return solve_indirect(paper_problem("rr", effort_weight=1.0))


def problem_of(arm, reading, mass, **limits):
    spec = ad.ArmSpec.paper(arm)
    payload = ad.Payload(mass=mass) if reading == "tip" else ad.Payload.at_last_com(spec, mass)
    start, goal = POSES[arm]
    robot = ad.Robot.from_spec(spec, payload=payload)
    return ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, **limits)


@pytest.mark.filterwarnings("ignore::armdyn.ArmdynWarning")  # 500 g cannot be held at RR's goal by 3 N m
@pytest.mark.parametrize(("arm", "reading", "mass"), TIME_ENERGY)
def test_time_energy_is_that_of_the_reference_by_both_methods(arm, reading, mass):
    duration, cost = TIME_ENERGY[arm, reading, mass]
    found = free_time_energy(arm, reading, mass)
    assert found.success, found.message
    # Measured 1e-9 of the indirect method and 5e-8 of the direct one, whose cost is flat at its optimum.
    assert found.duration == pytest.approx(duration, rel=1e-7)
    assert found.cost == pytest.approx(cost, rel=1e-7)
    assert found.direct.duration == pytest.approx(duration, rel=1e-7)
    errors = compare_with_direct(found)
    assert errors.duration < 1e-6
    # Torques of the direct method are linear in 80 to 350 intervals. Measured 3e-6 of states; a change of its costates
    # within their first-order saving of 1e-4 is none to it, and 9e-5 of their peak were measured.
    assert max(errors.q, errors.v) < 1e-5
    assert max(errors.costate_q, errors.costate_v) < 2e-4
    assert errors.tau < 1e-3
    assert found.hamiltonian_spread < 1e-7  # of H, in which time's term is 1; tolerance 1e-6 of the equations
    np.testing.assert_allclose(found.hamiltonian[0], found.hamiltonian[-1], atol=1e-7)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::armdyn.ArmdynWarning")  # 1 kg cannot be held at RR's goal by 3 N m
def test_artefacts_of_the_direct_mesh_are_given_up():
    found = solve_indirect(problem_of("rr", "mM", 1.0, effort_weight=1.0), options=FREE)
    assert found.success, found.message
    # A coarse mesh's best, of J = 1.16, is no motion of the arm; the reference's optimum is, of J = 1.2198, and this:
    # Radau arcs of ninth order, another transcription, had 0.789707317 s and J = 1.177036180.
    assert found.duration == pytest.approx(0.78970732, rel=1e-6)
    assert found.cost == pytest.approx(1.17703618, rel=1e-7)
    assert compare_with_direct(found).duration < 1e-5  # of the issue; 48 intervals of the fastest motion leave 2e-7


@pytest.mark.parametrize(("reading", "mass"), R_EXACT)
def test_one_link_minimum_time_is_exact(reading, mass):
    found = solve_indirect(problem_of("r", reading, mass))
    assert found.success, found.message
    # 1e-9: the point mass's stand-in inertia of 1e-12 kg m² shows at 5e-11.
    assert found.duration == pytest.approx(R_EXACT[reading, mass], rel=1e-9)
    assert len(found.arcs) == 2
    assert found.hamiltonian_spread < 1e-8
    assert np.all(np.abs(found.trajectory.tau) == 3.0)


@pytest.mark.slow
def test_two_links_minimum_time_from_time_energy_and_from_the_direct_costates():
    problem = paper_problem("rr", position_limit=ANYWHERE)
    direct = ad.solve_minimum_time(problem)
    alone, seeded = solve_indirect(problem), solve_indirect(problem, direct)
    for found in (alone, seeded):
        assert found.success, found.message
        assert found.duration == pytest.approx(RR_BEST, rel=1e-8)  # a best known, good to 1e-10
        assert found.duration == pytest.approx(direct.duration, rel=1e-9)
        assert [arc.modes for arc in found.arcs] == [arc.modes for arc in direct.arcs]
        assert found.hamiltonian_spread < 1e-8
        errors = compare_with_direct(found, direct.costates)
        # Required: 1e-2 of the peak; costates linear between 48 samples per arc leave 3e-4.
        assert max(errors.costate_q, errors.costate_v) < 1e-3
        assert errors.tau == 0  # both are on the limits, and switch at the same times
        assert max(errors.q, errors.v) < 1e-5
    replayed = ad.replay_torques(problem.robot, alone.trajectory)
    np.testing.assert_allclose(replayed.q[-1], problem.q_goal, atol=1e-8)  # an integrator that knows no costates


@pytest.mark.slow
def test_one_continuation_is_a_local_optimum():
    # The time-energy optimum of least J leads to another optimum than the fastest.
    problem = paper_problem("rr", position_limit=ANYWHERE)
    found = solve_indirect(problem, options=IndirectOptions(continuations=1))
    assert found.success, found.message
    assert found.duration > RR_BEST * (1 + 1e-4) and found.hamiltonian_spread < 1e-8


def test_saturated_law_keeps_the_limits_and_tends_to_minimum_time():
    exact, durations = R_EXACT["tip", 0.1006], []
    for weight in (0.2, 0.05, 0.01, 0.002):
        found = solve_indirect(paper_problem("r", effort_weight=weight))
        assert found.success, found.message
        assert np.max(np.abs(found.trajectory.tau)) <= 3.0
        assert found.hamiltonian_spread < 1e-6  # of H, in which time's term is 1: the tolerance of the equations
        errors = compare_with_direct(found)
        assert errors.duration < 1e-4  # the direct mesh has no knot where the torque leaves its limit
        durations.append(found.duration)
    assert np.all(np.diff(durations) < 0)
    assert exact < durations[-1] < exact * (1 + 1e-4)
    assert np.any(np.abs(found.trajectory.tau) == 3.0)


def test_limits_that_are_not_reached_change_nothing():
    bounded, free = bounded_rr(), free_time_energy("rr", "tip", 0.1006)
    assert np.max(np.abs(free.trajectory.tau)) < 3.0
    assert bounded.duration == pytest.approx(free.duration, rel=1e-8)


@pytest.mark.slow
def test_finite_differences_come_to_the_same_at_second_order():
    problem = paper_problem("rr", effort_weight=1.0)
    exact = bounded_rr().duration
    coarse, fine = (
        solve_indirect(problem, options=IndirectOptions(method="trapezoidal", intervals=intervals))
        for intervals in (100, 200)
    )
    assert coarse.success and fine.success, fine.message
    assert fine.trajectory.t.size == 201
    assert fine.duration == pytest.approx(exact, rel=1e-4)
    assert (coarse.duration - exact) / (fine.duration - exact) == pytest.approx(4, rel=0.1)  # leading term h²


def test_double_integrator_both_ways():
    robot = cart()
    problem = ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[2.0], effort_weight=2.0)
    found = solve_indirect(problem, options=FREE)
    # Minimum of T + 6 w d²/T³.
    assert found.duration == pytest.approx((18 * 2.0 * 4) ** 0.25, rel=1e-9)
    assert found.cost == pytest.approx(found.duration * 4 / 3, rel=1e-9)
    fastest = solve_indirect(replace(problem, effort_weight=0.0))
    assert fastest.duration == pytest.approx(2 * np.sqrt(2), rel=1e-9)


@pytest.mark.slow
def test_three_links_outside_the_position_limits():
    problem = paper_problem("rrr", effort_weight=1.0, position_limit=ANYWHERE)
    found = solve_indirect(problem, options=FREE)
    assert found.success, found.message
    assert found.cost < 0.6789716  # J with |θ| <= π, which is a limit on joint 3
    assert found.hamiltonian_spread < 1e-7
    assert compare_with_direct(found).duration < 1e-6
    seed = ad.Solution(
        True,
        Status.SOLVED,
        "",
        problem,
        found.duration,
        found.trajectory,
        ad.Certificate(0, 0, 0),
        costates=found.direct,
    )
    outside = solve_indirect(paper_problem("rrr", effort_weight=1.0), seed, FREE)
    assert not outside.success and outside.status is Status.INFEASIBLE
    assert "joint3" in outside.message and "position limit" in outside.message


def test_an_unsolved_case_is_reported():
    problem = paper_problem("rr", effort_weight=1.0)
    late = solve_indirect(problem, options=IndirectOptions(time_limit=1e-3))
    assert not late.success and late.status is Status.TIME_LIMIT
    short = solve_indirect(problem, options=IndirectOptions(max_nodes=50))
    assert not short.success and short.status is Status.ITERATION_LIMIT
    assert "nodes" in short.message and "of the duration" in short.message
    assert short.trajectory.t.size > 2


def test_bad_input_raises():
    with pytest.raises(ad.ArmdynError, match="torque limits"):
        solve_indirect(paper_problem("r"), options=FREE)
    seed = ad.solve_minimum_time(paper_problem("r"))
    with pytest.raises(ad.ArmdynError, match="1 joints, the problem 2"):
        solve_indirect(paper_problem("rr"), seed)


def test_path_constraints_are_refused():
    problem = paper_problem("r", acceleration_limit=50.0)
    with pytest.raises(ad.ArmdynError, match="the indirect method knows no"):
        solve_indirect(problem)
