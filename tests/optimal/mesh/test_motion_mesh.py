"""Meshes divided until a motion is certified, and motions that are resolved once."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.mesh import motion_mesh
from armdyn.optimal.mesh.direct import Attempt
from armdyn.optimal.mesh.motion_mesh import MeshWork, _Meshes, finer_knots, mesh_optimum
from armdyn.optimal.mesh.search import find
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import Certificate, repeated
from armdyn.optimal.verify.optimum import MeshMargins, Optimum
from armdyn.optimal.verify.rollout import under_feedback
from armdyn.optimal.verify.within_limits import paced
from armdyn.trajectory import Trajectory
from problems import cart, paper_arm

FAST = ad.MinimumTimeProblem(
    paper_arm("rr", 0.05), q_start=[-2.5, -1.5], q_goal=[2.0, 1.0], velocity_limit=[12.0, 15.0]
)
"""Both velocity limits are met."""


def task_of(**numbers):
    """The task with other numbers of its meshes."""
    task = Task.of(FAST, ad.MinimumTimeOptions(starts=4, workers=1))
    return replace(task, policy=task.policy.changed("motion_mesh", **numbers))


def optimum_of(task, work=None):
    """Optimum that the meshes of the first guess's optimum are resolved to."""
    return mesh_optimum(task, find(task).attempts[0], work or MeshWork(task.policy), lambda mesh: None)


@pytest.mark.slow
def test_a_motion_that_exceeds_a_limit_a_little_is_certified_on_a_divided_mesh():
    once = {"rounds": 1, "further_meshes": 0, "kept": ()}
    coarse, divided, fine = (optimum_of(task_of(**one)) for one in (once, {"rounds": 1}, {}))
    assert 1e-6 < coarse.certificate.limit_violation < 1e-4 and not coarse.certificate.ok
    assert divided.certificate.ok
    assert divided.intervals > coarse.intervals
    assert fine.trajectory.duration < divided.trajectory.duration < (1 + 5e-5) * fine.trajectory.duration


@pytest.mark.slow
def test_a_reserve_of_velocity_is_a_lower_velocity_limit():
    reserving = FAST.variant(velocity_limit=FAST.limits.velocity / 0.9, velocity_reserve=0.1)
    optima = (optimum_of(Task.of(one, ad.MinimumTimeOptions(starts=4, workers=1))) for one in (FAST, reserving))
    lower, reserved = optima
    assert reserved.certificate.ok
    assert reserved.trajectory.duration == pytest.approx(lower.trajectory.duration, rel=1e-8)  # of the interior point


@pytest.mark.slow
def test_a_motion_that_exceeds_a_limit_on_a_mesh_that_is_not_divided_keeps_further_within():
    once = {"rounds": 1, "further_meshes": 0}
    coarse, within = (optimum_of(task_of(**once, **more)) for more in ({"kept": ()}, {}))
    assert coarse.certificate.on_goal and not coarse.certificate.keeps_limits
    assert within.certificate.usable and within.intervals == coarse.intervals
    # It is slower by about the excess, and by 1.5 times the torque that is kept.
    assert 1 < within.trajectory.duration / coarse.trajectory.duration < 1 + 3e-4


@pytest.mark.slow
def test_a_motion_is_resolved_once():
    task = task_of()
    work = MeshWork(task.policy)
    first, after = optimum_of(task, work), work.left
    assert optimum_of(task, work) is first
    assert task.policy.motion_mesh.work - after > 10 * (after - work.left) > 0


@pytest.mark.slow
def test_a_motion_is_recognised_on_its_second_mesh():
    task = task_of(rounds=2)
    work = MeshWork(task.policy)
    first, second = _Meshes(task, work).finer(find(task).attempts[0])
    slower = replace(first, trajectory=paced(first.trajectory, 1.01))
    work.add((first, second), None)
    assert work.known((first,)) == (None,)
    assert work.known((slower,)) is None
    assert work.known((slower, second)) == (None,)
    assert work.known((slower, slower)) is None


@pytest.mark.parametrize(("idle", "known"), [((), False), (("b",), True), (("a",), False)])
def test_a_motion_is_recognised_whatever_its_idle_joints_do(idle, known):
    work, names = MeshWork(Policy.of(FAST)), ("a", "b")
    motion = ad.Trajectory([0.0, 1.0], np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2)), names)
    first = Attempt(ad.Status.SOLVED, "", motion, 160, 1, None)
    other = replace(first, trajectory=replace(motion, q=np.array([[0.0, 0.0], [0.0, 2.0]])))
    optimum = Optimum(motion, Certificate(0.0, 0.0, 0.0, idle=idle), 1.0, 160)
    work.add((first,), optimum)
    assert work.known((other,)) == ((optimum,) if known else None)


def test_a_mesh_that_a_usable_motion_beats_by_far_is_given_up():
    task = task_of()
    work = MeshWork(task.policy)
    work.best = 0.9 * optimum_of(task_of(work=0)).trajectory.duration
    assert optimum_of(task, work) is None
    first, second = 160, 3 * 160 + 160  # intervals; the second mesh was the last one
    assert task.policy.motion_mesh.work - work.left < 100 * (first + second)


def test_without_work_left_one_mesh_is_solved():
    task = task_of(work=0)
    assert optimum_of(task).intervals == 4 * task.policy.search.fine_mesh


@pytest.mark.slow
def test_a_motion_whose_replay_does_not_land_is_judged_by_its_segments(monkeypatch):
    monkeypatch.setattr(motion_mesh, "replay_of", lambda task, motion: replace(motion, q=motion.q + 1e-3))
    optimum = optimum_of(task_of())
    judged = repeated(FAST, optimum.trajectory, optimum.certificate)
    assert judged.usable and judged.saving < 1e-4 and judged.segment_error < 1e-9


@pytest.mark.slow
def test_a_motion_that_no_integrator_repeats_is_not_certified(monkeypatch):
    monkeypatch.setattr(
        "armdyn.optimal.verify.certificate.OPEN_LOOP_GROWTH", 0.0
    )  # every motion is judged under feedback,
    monkeypatch.setattr("armdyn.optimal.verify.certificate.under_feedback", lambda *_: None)  # which leaves it
    certificate = optimum_of(task_of()).certificate
    assert not certificate.ok and certificate.saving < 1e-4
    assert "replay under feedback leaves the motion" in certificate.remark


@pytest.mark.slow
def test_a_motion_that_leaves_feedback_no_torque_is_planned_with_less(monkeypatch):
    def with_room(robot, limits, motion, segments):
        return under_feedback(robot, limits, motion, segments) if least_room(limits, motion) > 1e-5 else None

    def least_room(limits, motion):
        return np.min(-limits.actuators.excess(motion.tau, motion.q, motion.v) / limits.actuators.scale)

    optimum = optimum_of(task_of())
    monkeypatch.setattr(
        "armdyn.optimal.verify.certificate.OPEN_LOOP_GROWTH", 0.0
    )  # every motion is judged under feedback,
    monkeypatch.setattr("armdyn.optimal.verify.certificate.under_feedback", with_room)  # which needs some torque
    kept = optimum_of(task_of())
    assert least_room(FAST.limits, optimum.trajectory) < 1e-7 < 2.9e-5 < least_room(FAST.limits, kept.trajectory)
    assert kept.certificate.ok and kept.certificate.replay == "segments"
    assert 1 < kept.trajectory.duration / optimum.trajectory.duration < 1 + 4.5e-5


def test_a_divided_mesh_stays_within_position_limits_by_the_excess():
    folded = FAST.variant(velocity_limit=30.0, position_limit=([-2.6, -1.6], [2.1, 1.1]))
    task = Task.of(folded, ad.MinimumTimeOptions(starts=4, workers=1))
    within = _Meshes(task, MeshWork(task.policy))._within(MeshMargins(position=1e-3)).problem.limits
    assert within.position_lower == pytest.approx([-2.6 + 4.7e-3, -1.6 + 2.7e-3])
    assert within.position_upper == pytest.approx([2.1 - 4.7e-3, 1.1 - 2.7e-3])
    wide = _Meshes(task, MeshWork(task.policy))._within(MeshMargins(position=0.1)).problem.limits
    assert np.all(wide.position_lower <= folded.q_start) and np.all(wide.position_upper >= folded.q_goal)


@pytest.mark.slow
def test_a_goal_at_the_velocity_limit_is_reached():
    limits = {"velocity_limit": 8.0, "v_goal": [8.0, 0.5]}
    problem = ad.MinimumTimeProblem(paper_arm("rr"), q_start=[-1.5, 0.0], q_goal=[0.2, -0.1], **limits)
    # The margin of the mesh refused it: "beyond its limit 7.99996 rad/s".
    assert ad.solve_minimum_time(problem, ad.MinimumTimeOptions(starts=1, workers=1)).certified


def test_margins_leave_ends_in_flight_their_positions():
    ends = {"q_start": [-2.5, -1.5], "q_goal": [2.0, 1.0], "v_goal": [-1.0, 1.0]}
    problem = ad.MinimumTimeProblem(paper_arm("rr"), **ends, position_limit=([-2.6, -1.6], [2.001, 1.1]))
    within = MeshMargins(position=1e-3).task_within(Task.of(problem, ad.MinimumTimeOptions())).problem.limits
    assert within.position_upper == pytest.approx([2.001, 1.1 - 2.7e-3])


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("margin", [0.0, 1e-3])
def test_a_mesh_without_position_limits_stays_without(margin):
    endless = FAST.variant(position_limit=(-np.inf, [np.inf, 2.0]))
    task = Task.of(endless, ad.MinimumTimeOptions(starts=4, workers=1))
    within = _Meshes(task, MeshWork(task.policy))._within(MeshMargins(position=margin)).problem.limits
    assert within.position_lower.tolist() == [-np.inf, -np.inf]
    assert within.position_upper.tolist() == [np.inf, 2.0 - margin]


def test_intervals_are_divided_on_both_sides_of_a_switch():
    task = task_of(rounds=1, gap=1.0, velocity_excess=1.0)  # of switches alone
    first, *_ = _Meshes(task, MeshWork(task.policy)).finer(find(task).attempts[0])
    middles = (first.mesh[:-1] + first.mesh[1:]) / 2
    torques = first.trajectory(first.trajectory.duration * middles).tau / FAST.limits.actuators.scale
    switches = np.flatnonzero(np.any(np.abs(np.diff(torques, axis=0)) > 0.5, axis=1))
    counts = np.histogram(finer_knots(task, first), first.mesh)[0]
    assert switches.size > 2 and np.all(counts[switches] > 1) and np.all(counts[switches + 1] > 1)


def test_the_last_mesh_is_solved_sharply():
    task = task_of(rounds=2)
    meshes = _Meshes(task, MeshWork(task.policy))
    *_, rough = meshes.finer(find(task).attempts[0])
    sharp = meshes.sharp(rough, rough.mesh)
    assert np.array_equal(sharp.mesh, rough.mesh)
    # The rough one's barrier keeps every torque off its limits, which costs 1e-8 for each of 2,000 bounds at least.
    assert 1e-6 < rough.trajectory.duration / sharp.trajectory.duration - 1 < 1e-4


def test_linear_torques_are_divided_where_they_bend_or_jump():
    cart_task = Task.of(ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], acceleration_limit=0.5))
    assert cart_task.scheme.control == "linear"
    t = np.linspace(0, 1, 41)
    tau = np.where(t < 0.5, 0.5, -0.5) + 0.1 * np.maximum(t - 0.75, 0)  # a jump in interval 19, a corner at knot 30
    motion = Trajectory(t, t[:, None], np.ones((41, 1)), tau[:, None], ("slide",), "torques")
    attempt = Attempt(Status.SOLVED, "", motion, 40, 0, None)
    knots = finer_knots(cart_task, attempt)
    counts = np.histogram(knots[:-1] + 1e-9, t)[0]
    most = cart_task.policy.motion_mesh.parts
    assert list(np.flatnonzero(counts == most)) == [18, 19, 20] and list(np.flatnonzero(counts == 3)) == [29, 30]
    assert np.sum(counts == 1) == 35 and np.all(np.isin(t, knots))
