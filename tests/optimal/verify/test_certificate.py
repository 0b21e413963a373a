"""The certificate of a motion, and its replay by another integrator: open loop, or by segments and under feedback."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import armdyn as ad
from armdyn.dynamics.numeric import forward_dynamics, joint_inertia
from armdyn.errors import ProblemError
from armdyn.models.values.friction import JointFriction
from armdyn.optimal.answer.solution import minimum_time_summary
from armdyn.optimal.answer.words import advice, solution_words
from armdyn.optimal.verify.certificate import OPEN_LOOP_GROWTH, Certificate, certify, repeated
from armdyn.optimal.verify.rollout import FEEDBACK_BANDWIDTH, FEEDBACK_TICK, Segments, ticked
from problems import gantry_problem, paper_arm, solve, solved

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


KINOVA = [0.0, 2.9, 1.3, 4.2, 1.4, 0.0], [1.2, 4.0, 2.2, 5.2, 2.4, 1.5]


@cache
def kinova():
    """A short motion of a Kinova with 0.5 kg, whose open-loop errors grow by 10⁸ and more."""
    robot = ad.Robot.from_library("kinova", payload=ad.Payload(mass=0.5))
    problem = ad.MinimumTimeProblem(robot, q_start=KINOVA[0], q_goal=KINOVA[1])
    return ad.solve_minimum_time(problem, ad.MinimumTimeOptions(search="quick"))


def segment(robot, motion, k, x, method, rtol, correction=0.0):
    """The end of a segment from a state x by scipy."""
    acceleration, n, t, tau = forward_dynamics(robot), robot.nv, motion.t[k : k + 2], motion.tau[k : k + 2] + correction

    def rate(at, x):
        return np.concatenate(
            [x[n:], acceleration(x[:n], x[n:], tau[0] + (at - t[0]) / (t[1] - t[0]) * (tau[1] - tau[0]))]
        )

    return solve_ivp(rate, t, x, method=method, rtol=rtol, atol=1e-2 * rtol, first_step=t[1] - t[0]).y[:, -1]


def states(motion):
    return np.hstack([motion.q, motion.v])


@pytest.mark.parametrize("friction", [None, JointFriction(damping=0.02, coulomb=0.05)])
def test_growth_is_that_of_open_loop_replays(friction):
    robot = replace(paper_arm("rr"), friction=friction) if friction else paper_arm("rr")
    motion = ad.replay_torques(robot, solved("rr").trajectory)
    found, step, columns = Segments.of(robot, motion), 1e-6, []
    for one in step * np.eye(4):
        ends = [
            states(ad.replay_torques(robot, replace(motion, q=motion.q + sign * one[:2], v=motion.v + sign * one[2:])))[
                -1
            ]
            for sign in (1, -1)
        ]
        columns.append((ends[0] - ends[1]) / (2 * step))
    # To 0.2 %: derivatives are taken at the middle of a segment, within which dry friction turns.
    assert found.growth == pytest.approx(np.linalg.norm(np.column_stack(columns), 2), rel=2e-3)


@pytest.mark.slow
def test_two_integrators_agree_open_loop_on_the_papers_arm():
    solution = solved("rr")
    certificate, motion = solution.certificate, solution.trajectory
    assert certificate.replay == "open loop" and certificate.growth == pytest.approx(13.3, rel=0.01)
    assert certificate.correction is None and certificate.segment_error < 1e-7
    assert f"open-loop replay ends within {certificate.goal_error:.1e} rad of the goal (growth 13)" in solution.message
    for method in ("DOP853", "Radau"):
        x = states(motion)[0]
        for k in np.flatnonzero(~motion.jumps):
            x = segment(solution.problem.robot, motion, k, x, method, 1e-10)
        assert np.max(np.abs(x[:2] - solution.problem.q_goal)) <= 10 * certificate.goal_error


@pytest.mark.slow
def test_an_unstable_motion_is_judged_by_its_segments_and_under_feedback():
    solution = kinova()
    robot, motion, certificate = solution.problem.robot, solution.trajectory, solution.certificate
    assert solution.usable and certificate.replay == "segments" and certificate.growth > 100 * OPEN_LOOP_GROWTH
    assert f"every segment replayed to within {certificate.segment_error:.1e}" in solution.message
    assert (
        "open loop the motion is unstable (growth" in solution.message and "under feedback it ends" in solution.message
    )
    assert "under feedback" in " ".join(map(str, solution_words(solution).values()))
    said = minimum_time_summary(solution)["certificate"]
    assert said["replay"] == "segments" and said["growth"] == certificate.growth
    assert said["correction"] == certificate.correction and said["segment_error"] == certificate.segment_error
    x, n, inertia = states(motion), robot.nv, joint_inertia(robot)
    assert np.max(np.diff(motion.t)) <= FEEDBACK_TICK
    for k in np.random.default_rng(1).choice(np.flatnonzero(~motion.jumps), 20, replace=False):
        for method in ("DOP853", "Radau"):
            assert (
                np.max(np.abs(segment(robot, motion, k, x[k], method, 1e-10) - x[k + 1]))
                <= 10 * certificate.segment_error
            )
    # The feedback as docs/certificate.md says it, by scipy, from sample to sample.
    state, largest = x[0], 0.0
    for k in range(motion.t.size - 1):
        beside = state - x[k]
        correction = -inertia(x[k, :n]) @ (2 * FEEDBACK_BANDWIDTH * beside[n:] + FEEDBACK_BANDWIDTH**2 * beside[:n])
        largest = max(largest, np.max(np.abs(correction)))
        state = segment(robot, motion, k, state, "DOP853", 1e-10, correction)
    assert np.max(np.abs(state[:n] - solution.problem.q_goal)) <= 10 * certificate.goal_error
    assert largest <= 10 * certificate.correction


def test_a_state_that_its_torques_do_not_lead_to_is_found():
    solution = solved("rr")
    v = solution.trajectory.v.copy()
    v[100, 0] += 1e-5
    motion = replace(solution.trajectory, v=v)
    certificate = repeated(solution.problem, motion, certify(solution.problem, motion, None))
    assert certificate.goal_error < 1e-6 and certificate.segment_error == pytest.approx(1e-5, rel=0.1)
    assert not certificate.lands and not certificate.usable
    assert any("a segment ends 1e-05 from the next sample" in reason for reason in certificate.reasons)


def test_a_motion_that_feedback_cannot_follow_does_not_land():
    solution = kinova()
    q = solution.trajectory.q.copy()
    q[200:] += 1e-4  # a step that no torque makes
    motion = replace(solution.trajectory, q=q)
    certificate = repeated(solution.problem, motion, certify(solution.problem, motion, None))
    assert certificate.replay == "segments" and certificate.correction is None
    assert not certificate.lands and certificate.goal_error == np.inf
    assert any("under feedback leaves" in reason for reason in certificate.reasons)
    assert "`reserve` of the torque limits" in advice(replace(solution, certificate=certificate))["lands"]


def test_ticks_are_on_the_motion():
    robot, motion = solved("rr").problem.robot, solved("rr").trajectory
    v = motion.v.copy()
    v[::50] += 1e-7
    motion = replace(motion, v=v)
    finer = ticked(robot, motion, 3e-4)
    assert finer.t.size > motion.t.size and np.max(np.diff(finer.t)) <= 3e-4 and set(motion.t) <= set(finer.t)
    np.testing.assert_allclose(Segments.of(robot, finer).end(), Segments.of(robot, motion).end(), rtol=0.02, atol=1e-12)
    assert ticked(robot, motion, 1.0) is motion
