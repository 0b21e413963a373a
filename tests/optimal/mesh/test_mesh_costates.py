"""Time saved by a change of a motion, against closed forms, slower motions and another integrator."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

import armdyn as ad
from armdyn.optimal.mesh.direct import solve_on_mesh
from armdyn.optimal.mesh.mesh_costates import mesh_costates
from armdyn.optimal.mesh.motion_mesh import MeshWork, _Meshes, mesh_optimum
from armdyn.optimal.mesh.search import find
from armdyn.optimal.mesh.shooting import Shooting, landed
from armdyn.optimal.problem.options import SolverSettings
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.costates import sensitivities
from armdyn.optimal.verify.optimum import trajectory_cost
from armdyn.optimal.verify.rollout import replay_of
from armdyn.paper import solve_indirect
from problems import cart, gantry_problem, miss, paper_arm, paper_problem, solve

FAST = ad.MinimumTimeProblem(
    paper_arm("rr", 0.05), q_start=[-2.5, -1.5], q_goal=[2.0, 1.0], velocity_limit=[12.0, 15.0]
)
"""Both velocity limits are met."""


@cache
def attempted(problem):
    """A task, and its search's first optimum on a coarse mesh."""
    task = Task.of(problem, ad.MinimumTimeOptions(starts=4, workers=1))
    return task, find(task).attempts[0]


def resolved(task, attempt):
    """Optimum that the meshes of an attempt are resolved to."""
    return mesh_optimum(task, attempt, MeshWork(task.policy), lambda mesh: None)


@cache
def fast():
    """`of(FAST)`, for several tests."""
    return of(FAST)


def of(problem, **mesh):
    """A task, its first optimum's motion and its costates."""
    task, coarse = attempted(problem)
    task = replace(task, policy=task.policy.changed("motion_mesh", **mesh))
    meshes = _Meshes(task, MeshWork(task.policy))
    *_, finest = meshes.finer(coarse)
    motion = landed(task, meshes.sharp(finest, finest.mesh))
    replay = replay_of(task, motion.trajectory(problem.robot.joint_names))
    return task, motion, replay, mesh_costates(problem, motion, replay, task.policy)


def test_a_cart_with_a_velocity_limit_has_the_costates_of_the_closed_form():
    # 1 kg, 1 N, 1 m/s, 3 m: it speeds up for 1 s, cruises for 2 s, brakes for 1 s.
    problem = ad.MinimumTimeProblem(cart(), q_start=[0], q_goal=[3], velocity_limit=1.0, effort_limit=1.0)
    *_, replay, costates = of(problem)
    assert replay.duration == pytest.approx(4.0, rel=1e-5)  # the mesh keeps 3e-6 of the velocity limit
    assert costates.saving < 2e-5
    t = costates.t / costates.t[-1] * 4
    # H = 1 + ρ_q v + ρ_v τ = 0: while it cruises ρ_v = 0, so that ρ_q = -1 / (1 m/s), always.
    assert np.max(np.abs(costates.costate[:, 0] + 1)) < 1e-3
    expected = np.where(t < 1, t - 1, np.where(t > 3, t - 3, 0))
    assert np.max(np.abs(costates.costate[:, 1] - expected)) < 2e-3  # a stretch of the linear program
    middle = (t[:-1] + t[1:]) / 2
    cruises = (middle > 1.1) & (middle < 2.9)
    part = np.diff(t)[cruises]
    assert part @ costates.held[cruises, 1] / part.sum() == pytest.approx(1.0, abs=1e-2)


@pytest.mark.slow
def test_a_motion_that_is_slower_has_a_saving_of_no_less(monkeypatch):
    best = of(FAST, rounds=4)
    assert best[3].saving < 1e-4
    for mesh, reserve in (({"rounds": 3}, 1e-6), ({"rounds": 2}, 1e-6), ({"rounds": 1}, 1e-6), ({}, 2e-4)):
        monkeypatch.setattr("armdyn.optimal.mesh.motion_mesh.LIMIT_TOLERANCE", reserve)  # half of it is a mesh's
        *_, replay, costates = of(FAST, **mesh)
        slower = replay.duration / best[2].duration - 1
        assert 0 < slower < costates.saving


@pytest.mark.slow
def test_another_integrator_and_pinocchio_lead_to_the_same_costates():
    task, motion, replay, costates = fast()
    robot, n = FAST.robot, 2
    data = robot.model.createData()
    assert np.any(costates.held)
    q = CubicHermiteSpline(replay.t, replay.q, replay.v)
    v = q.derivative()

    def down(t, rho, tau, held):
        pin.computeABADerivatives(robot.model, data, q(t), v(t), tau)
        return -np.concatenate([data.ddq_dq.T @ rho[n:], rho[:n] + data.ddq_dv.T @ rho[n:]]) - held

    rho = costates.costate[-1]
    for k in range(len(motion.tau) - 1, -1, -1):
        span = costates.t[k + 1], costates.t[k]
        rho = solve_ivp(down, span, rho, "RK45", args=(motion.tau[k, 0], costates.held[k]), rtol=1e-8, atol=1e-12).y[
            :, -1
        ]
    size = np.concatenate([np.max(np.abs(replay.v), axis=0), np.max(np.abs(replay.v), axis=0) / replay.duration * 10])
    assert np.max(np.abs((rho - costates.costate[0]) * size)) < 1e-4  # of H, whose cost of time is 1
    assert task.problem is FAST


def test_idle_joints_do_not_count():
    optimum = resolved(*attempted(gantry_problem()))
    assert optimum.certificate.ok
    assert optimum.trajectory.duration == pytest.approx(4.0, rel=1e-5)


@pytest.mark.slow
def test_costates_of_a_program_that_is_not_solved_give_a_bound_too():
    task, motion, replay, costates = fast()
    beyond, rough = (
        mesh_costates(FAST, motion, replay, task.policy.changed("shooting", converged=tolerance))
        for tolerance in (1e-20, 1e-1)  # beyond rounding; after a few iterations
    )
    assert beyond.saving == pytest.approx(costates.saving, abs=2e-6)  # twice the tolerance
    assert rough.saving > costates.saving


def test_a_joint_without_a_motor_has_no_torque_to_change():
    robot = ad.Robot.from_library("cart_pole", effort_limit=3.0)
    problem = ad.MinimumTimeProblem(robot, q_start=[0.0, 0.0], q_goal=[1.0, 0.0])
    task = Task.of(problem, ad.MinimumTimeOptions(starts=8, workers=1))
    optimum = resolved(task, find(task).attempts[0])
    assert optimum.certificate.ok, optimum.certificate.reasons
    assert optimum.trajectory.duration == pytest.approx(1.559332194, rel=1e-5)  # docs/passive.md; less is certified


@pytest.mark.slow
def test_a_mesh_optimum_is_refused_where_a_change_saves_much(monkeypatch):
    task, attempt = attempted(FAST)
    monkeypatch.setattr("armdyn.optimal.mesh.motion_mesh.LIMIT_TOLERANCE", 2e-3)  # half of it is a mesh's reserve
    optimum = resolved(task, attempt)
    assert optimum.certificate.usable
    assert not optimum.certificate.ok
    (reason,) = optimum.certificate.reasons
    assert re.fullmatch(
        r"a small change may save up to 0\.0\d+ % of its time; at most 0\.01 % counts as locally optimal", reason
    )


def with_effort(problem, near, intervals):
    """A mesh's motion of least time and energy, with torques linear in its intervals; its replay and costates."""
    task = Task.of(problem, ad.MinimumTimeOptions(workers=1))
    linear = replace(task, scheme=replace(task.scheme, control="linear"))
    motion = landed(task, solve_on_mesh(linear, near, intervals, SolverSettings(1e-9, 100, barrier=1e-4)))
    replay = replay_of(task, motion.trajectory(problem.robot.joint_names))
    assert miss(problem, replay) < 1e-8  # two integrators; rad and rad/s
    return replay, mesh_costates(problem, motion, replay, task.policy)


CART = ad.MinimumTimeProblem(cart(), q_start=[0], q_goal=[1], effort_weight=2.0, effort_limit=10.0)
"""1 kg, 1 m: τ = 6 (1 − 2 t/T)/T² costs J = T + 12/T³, least for T = 36^¼ s."""


def test_a_cart_that_pays_for_effort_has_the_costates_of_the_closed_form():
    best = 36**0.25
    replay, costates = with_effort(CART, ad.ramp(cart(), [0.0], [1.0], 2.0), 32)
    assert trajectory_cost(replay, 2.0) == pytest.approx(best + 12 / best**3, rel=1e-7)  # IPOPT's tolerance, at rest
    assert costates.saving < 1e-5
    # ∂J/∂(way) = 24/T³ = −ρ_q, and S = ρ_v + 2 τ = 0.
    np.testing.assert_allclose(costates.costate[:, 0], -24 / best**3, rtol=1e-5)
    np.testing.assert_allclose(costates.costate[:, 1], -12 / best**2 * (1 - 2 * costates.t / best), atol=2e-5)
    by = sensitivities(CART, costates)
    assert by.payload_mass == pytest.approx(24 / best**3, rel=1e-5)
    assert by.effort_upper[0] == by.effort_lower[0] == 0  # they are far away


@pytest.mark.parametrize("pace", [0.9, 0.99, 1.01, 1.1])
def test_what_another_pace_would_save_is_within_the_bound(pace):
    """The same lines at another pace: feasible, and no optimum."""
    task, best = Task.of(CART), 36**0.25
    T = pace * best
    s = np.linspace(0, 1, 33)
    tau = 6 * (1 - 2 * s[:, None]) / T**2
    x = np.stack([3 * s**2 - 2 * s**3, 6 * (s - s**2) / T], axis=1)
    motion = Shooting(T * s, x, np.stack([tau[:-1], tau[1:]], axis=1))
    replay = replay_of(task, motion.trajectory(cart().joint_names))
    saved = (T + 12 / T**3) - (best + 12 / best**3)
    assert 0 < saved < mesh_costates(CART, motion, replay, task.policy).saving * T


@pytest.mark.slow
@pytest.mark.parametrize(("weight", "limit"), [(1.0, 30.0), (0.1, 3.0)])
def test_two_links_that_pay_for_effort_have_the_costates_of_another_mesh_and_of_root_finding(weight, limit):
    """The smaller weight takes the torques to their limits."""
    problem = paper_problem("rr", effort_weight=weight, effort_limit=limit)
    arcs = solve(problem, workers=1)
    roots = solve_indirect(problem, arcs)
    assert roots.success, roots.message
    np.testing.assert_allclose(
        arcs.costates.costate[[0, -1]], roots.costates[[0, -1]], rtol=0, atol=1e-3 * np.max(np.abs(roots.costates))
    )
    replay, costates = with_effort(problem, arcs.trajectory, 128)
    assert trajectory_cost(replay, weight) == pytest.approx(trajectory_cost(arcs.trajectory, weight), rel=1e-7)
    assert costates.saving < 1e-4
    mine, theirs = sensitivities(problem, costates), arcs.sensitivities()
    assert mine.payload_mass == pytest.approx(theirs.payload_mass, rel=1e-4)
    # Where a torque leaves its limit within an interval, a hundredth of the time, its end is left out.
    np.testing.assert_allclose(mine.effort(), theirs.effort(), rtol=1e-2, atol=1e-9)
    for k in (0, -1):
        other = arcs.costates.costate[k]
        np.testing.assert_allclose(costates.costate[k], other, rtol=0, atol=1e-3 * np.max(np.abs(other)))
