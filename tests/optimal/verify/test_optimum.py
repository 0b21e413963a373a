"""Motions that slightly exceed a limit become usable under every strategy; others stay unchanged."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import armdyn as ad
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.mesh.direct import solve_on_mesh
from armdyn.optimal.mesh.shooting import landed
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.minimum_time import solve_task
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import certify
from armdyn.optimal.verify.optimum import Optimum, slowed, trajectory_cost
from armdyn.optimal.verify.rollout import dense, replay_of
from armdyn.optimal.verify.within_limits import can_be_slowed, least_factor, limit_violation
from oracles import PinDynamics
from problems import held_ur5, paper_problem, solve, solved

TOLERANCE = 1e-6
"""Of a limit, as `Certificate.keeps_limits` and path constraints have it."""


def optimum_of(problem, motion, phases=None):
    """A motion as an optimum of a problem with other limits."""
    path_constraints, passing = TightenedConstraints.of(Task.of(problem)), np.empty(0)
    checked = path_constraints.check(problem, motion, passing)
    cost = trajectory_cost(motion, problem.effort_weights())
    return Optimum(motion, certify(problem, motion, phases), cost, 40, phases, reports=checked)


def peaks(robot, motion):
    """Largest speeds, accelerations and jerks of each joint along a DOP853 replay, each of shape (nv,).

    Independent of armdyn's checks: jerks are differences over a twentieth of a sample, from either side of samples.
    """
    pin, n = PinDynamics(robot), robot.nv
    x, found = np.concatenate([motion.q[0], motion.v[0]]), np.zeros((3, n))
    rubs = np.any(robot.friction.per_joint(n))
    for k in np.flatnonzero(~motion.jumps):
        start, end = motion.t[k : k + 2]
        slope = (motion.tau[k + 1] - motion.tau[k]) / (end - start)

        def rate(t, x, k=k, start=start, slope=slope):
            tau = motion.tau[k] + (t - start) * slope
            if rubs:
                tau -= robot.friction.torque(x[n:])
            return np.concatenate([x[n:], pin.aba(x[:n], x[n:], tau)])

        t = start + (end - start) * np.array([0, 0.05, 0.5, 0.95, 1])
        run = solve_ivp(rate, (start, end), x, "DOP853", t, first_step=end - start, rtol=1e-12, atol=1e-14)
        a = np.array([rate(*each)[n:] for each in zip(t, run.y.T, strict=True)])
        jerks = np.diff(a, axis=0) / np.diff(t)[:, None]
        sizes = (np.max(np.abs(each), axis=0) for each in (run.y[n:].T, a, jerks))
        found = np.maximum(found, list(sizes))
        x = run.y[:, -1]
    return found, x


def test_a_mesh_that_exceeds_a_velocity_limit_is_slowed_down_and_lands():
    problem = paper_problem("rr", velocity_limit=12.0)
    task = Task.of(problem)
    mesh = solve_on_mesh(task, spline(problem, []), 20, task.alone())
    beside = optimum_of(problem, replay_of(task, mesh.trajectory))
    assert beside.certificate.limit_violation > 1e-5 and beside.certificate.goal_error > 1e-5  # the mesh's own error
    off = replace(beside, certificate=replace(beside.certificate, landing=1e-5))
    assert slowed(task, off) is off  # a motion that does not land is not slowed down
    landing = optimum_of(problem, replay_of(task, landed(task, mesh).trajectory(problem.robot.joint_names)))
    assert landing.certificate.on_goal and not landing.certificate.keeps_limits
    kept = slowed(task, landing)
    assert kept.certificate.keeps_limits and kept.certificate.on_goal
    assert 1 < kept.trajectory.duration / landing.trajectory.duration < 1.01


@pytest.mark.parametrize("excess", [1.3e-6, 2.8e-5, 5e-4])
def test_arcs_that_exceed_a_velocity_limit_are_slowed_down_by_as_much(excess):
    solution = solved("rr")
    motion = ad.replay_torques(solution.problem.robot, dense(solution.trajectory, 2000))
    problem = solution.problem.variant(velocity_limit=np.max(np.abs(motion.v), axis=0) / (1 + excess))
    arcs = optimum_of(problem, solution.trajectory, solution.phases)
    assert not arcs.certificate.keeps_limits
    kept = slowed(Task.of(problem), arcs)
    assert kept.certificate.keeps_limits and kept.certificate.on_goal and kept.phases is None
    assert kept.trajectory.duration / solution.duration - 1 == pytest.approx(excess, rel=0.05, abs=TOLERANCE)
    (speeds, _, _), end = peaks(problem.robot, kept.trajectory)
    assert np.all(speeds <= (1 + TOLERANCE) * problem.limits.velocity)
    assert np.max(np.abs(end - problem.x_goal)) < 1e-5  # positions [rad] and velocities [rad/s]


def test_a_motion_within_its_limits_stays_a_certified_extremal():
    solution = solved("rr")
    arcs = optimum_of(solution.problem, solution.trajectory, solution.phases)
    assert slowed(Task.of(solution.problem), arcs) is arcs


@pytest.mark.slow
@pytest.mark.parametrize("options", [{"effort_weight": 1.0}, {"obstacles": [ad.Sphere((0.33, 0, -0.12), 0.05)]}])
def test_other_strategies_end_in_the_same_slowing(options):
    """Time and energy, and motions past obstacles, that exceed a speed limit by 2.8e-5, and an acceleration by 1e-4."""
    free = solve(paper_problem("rr", **options), starts=2)
    motion = ad.replay_torques(free.problem.robot, dense(free.trajectory, 1000))
    (speeds, accelerations, _), _ = peaks(free.problem.robot, motion)
    problem = free.problem.variant(velocity_limit=speeds / (1 + 2.8e-5), acceleration_limit=accelerations / (1 + 1e-4))
    before = optimum_of(problem, motion)
    assert not before.certificate.keeps_limits and before.missed
    after = slowed(Task.of(problem), before)
    assert after.certificate.keeps_limits and not after.missed
    assert after.certificate.goal_error <= before.certificate.goal_error + 2e-7  # the path's own error
    assert 1e-5 < after.trajectory.duration / motion.duration - 1 < 1e-4  # half of the acceleration's excess
    (speeds, accelerations, _), _ = peaks(problem.robot, after.trajectory)
    assert np.all(speeds <= (1 + TOLERANCE) * problem.limits.velocity)
    assert np.all(accelerations <= (1 + TOLERANCE) * problem.acceleration_limit)


@pytest.mark.parametrize("options", [{"v_goal": [1e-3, 0]}, {"position_limit": (-np.inf, 0.15)}])
def test_a_motion_that_slowing_down_does_not_mend_stays_unchanged(options):
    solution = solved("rr")
    limit = np.max(np.abs(solution.trajectory.v)) / 1.01
    problem = solution.problem.variant(velocity_limit=limit)
    mending = slowed(Task.of(problem), optimum_of(problem, solution.trajectory))
    assert mending.certificate.keeps_limits
    options = {"q_goal": [0.14, -0.03]} | options if "position_limit" in options else options
    other = problem.variant(**options)
    left = optimum_of(other, solution.trajectory)
    assert slowed(Task.of(other), left) is left


def test_a_joint_without_a_motor_cannot_be_slowed_down():
    pole = ad.MinimumTimeProblem(ad.Robot.from_library("cart_pole"), q_start=[0, 0], q_goal=[1.0, 0.0])
    assert not can_be_slowed(pole) and can_be_slowed(paper_problem("rr"))


def test_the_least_factor_keeps_torques_exactly():
    """Of a fast motion: at that pace a torque is on its limit, which `pin.rnea` says; friction changes little."""
    problem = paper_problem("rr")
    pin = PinDynamics(problem.robot)
    motion = spline(problem, [])
    t = np.linspace(0, 0.15, 200)
    s = t / t[-1]
    way = np.subtract(problem.q_goal, problem.q_start)
    shape = s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2 / t[-1], 60 * s * (1 - 3 * s + 2 * s**2)
    q, v, a = (part[:, None] * way for part in (*shape[:2], shape[2] / t[-1] ** 2))
    q = q + problem.q_start
    tau = np.array([pin.rnea(*x) for x in zip(q, v, a, strict=True)])
    motion = ad.Trajectory(t, q, v, tau)
    factor = least_factor(problem.robot, problem.limits, motion)
    assert factor > 1.2
    slow = [pin.rnea(*x) for x in zip(q, v / factor, a / factor**2, strict=True)]
    assert np.max(np.abs(slow) / problem.limits.effort_upper) == pytest.approx(1.0, rel=1e-12)
    weak = problem.variant(effort_limit=0.1)
    assert least_factor(weak.robot, weak.limits, motion) == np.inf  # less than gravity takes on the way


def random_pair(robot, seed):
    """Poses within ±1.5 rad and the limits that the arm can hold with 90 % of its torques."""
    rng, limits, pin = np.random.default_rng(seed), robot.limits, PinDynamics(robot)
    low, high = np.maximum(limits.position_lower, -1.5), np.minimum(limits.position_upper, 1.5)
    while True:
        start, goal = rng.uniform(low, high, (2, robot.nv))
        if all(np.all(np.abs(pin.gravity(q)) < 0.9 * limits.effort_upper) for q in (start, goal)):
            return {"q_start": start, "q_goal": goal}


ARMS = {
    "rr": lambda: paper_problem("rr").robot,
    "held ur5": held_ur5,
    "panda": lambda: ad.Robot.from_library("panda"),
}
LIMITED = [
    ("rr", 15.0, 200.0, "mesh"),
    ("held ur5", 5.0, 40.0, "curves"),
    ("panda", 5.0, 50.0, "curves"),
    ("panda", 5.0, 50.0, "profiles"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("arm", "acceleration", "jerk", "method"), LIMITED)
def test_accelerations_and_jerks_are_kept_in_an_independent_replay(arm, acceleration, jerk, method):
    robot = ARMS[arm]()
    options = {"acceleration_limit": acceleration, "jerk_limit": jerk}
    problem = ad.MinimumTimeProblem(robot, **random_pair(robot, 7), **options)
    task = Task.of(problem, ad.MinimumTimeOptions(bound=False))
    solution = solve_task(replace(task, policy=task.policy.changed("strategy", methods=(method,))))
    assert solution.usable, solution.message
    assert limit_violation(problem.limits, solution.trajectory, dense=20) <= TOLERANCE
    (_, accelerations, jerks), end = peaks(robot, solution.trajectory)
    assert np.max(accelerations) <= acceleration * (1 + TOLERANCE)
    # Accelerations of 1e-12 of their size, over a twentieth of a thousandth of a second: 1e-7 of the limit.
    assert 0.99 * jerk < np.max(jerks) <= jerk * (1 + 2 * TOLERANCE)
    missed = np.max(np.abs((end - problem.x_goal)[: robot.nv]))
    assert missed == pytest.approx(solution.certificate.goal_error, abs=1e-7)  # the reported error, replayed


@pytest.mark.slow
@pytest.mark.parametrize(("finer", "duration"), [((2, 2, 4), 0.74605), ((2, 2), 0.74628), ((2,), 0.74678)], ids=str)
def test_dry_friction_shakes_no_joint_beyond_its_jerk_limit(finer, duration):
    """Samples close enough keep the limit; with fewer the motion is slowed down until it does."""
    robot = held_ur5().with_friction(0.0, 5.0, 0.1)
    problem = ad.MinimumTimeProblem(robot, **random_pair(robot, 9933), jerk_limit=300.0)
    task = Task.of(problem, ad.MinimumTimeOptions(calm=0, bound=False))
    policy = task.policy.changed("curves", finer=finer)
    solution = solve_task(replace(task, policy=policy.changed("strategy", methods=("curves",), fallback=())))
    assert solution.usable and solution.duration == pytest.approx(duration, rel=1e-3)
    (_, _, jerks), end = peaks(robot, solution.trajectory)
    assert np.max(jerks) <= 300 * (1 + 2 * TOLERANCE)
    assert np.max(np.abs((end - problem.x_goal)[: robot.nv])) < 1e-7


@pytest.mark.slow
def test_a_jerk_is_kept_in_flight_too():
    """There nothing can be slowed down: the program gets the limits of the followed motion."""
    robot = paper_problem("rr").robot.with_limits(None, 4.0)
    problem = ad.MinimumTimeProblem(robot, **random_pair(robot, 7), v_start=[0.3, -0.2], jerk_limit=60.0)
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(bound=False))
    assert solution.usable, solution.message
    (_, _, jerks), _ = peaks(robot, solution.trajectory)
    assert 0.98 * 60 < np.max(jerks) <= 60 * (1 + 2 * TOLERANCE)
