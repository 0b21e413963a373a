"""Meshes divided until a motion is certified, and motions that are resolved once."""

from dataclasses import replace

import pytest

import armdyn as ad
from armdyn.optimal.refine.motion_mesh import ResolvedMotions, mesh_optimum
from armdyn.optimal.search.candidates import find
from armdyn.optimal.task.task import Task
from problems import paper_arm

FAST = ad.MinimumTimeProblem(
    paper_arm("rr", 0.05), q_start=[-2.5, -1.5], q_goal=[2.0, 1.0], velocity_limit=[12.0, 15.0]
)
"""Both velocity limits are met."""


def task_of(**numbers):
    """The task with other numbers of its meshes."""
    task = Task.of(FAST, ad.MinimumTimeOptions(starts=4, workers=1))
    return replace(task, policy=task.policy.changed("motion_mesh", **numbers))


def optimum_of(task, resolved=None):
    """Optimum that the meshes of the first guess's optimum are resolved to."""
    return mesh_optimum(task, find(task).attempts[0], "", resolved)


@pytest.mark.slow
def test_a_motion_that_exceeds_a_limit_a_little_is_certified_on_a_divided_mesh():
    coarse, divided, fine = (optimum_of(task_of(**one)) for one in ({"rounds": 2, "again": 0}, {"rounds": 2}, {}))
    assert 1e-6 < coarse.certificate.limit_violation < 1e-4 and not coarse.certificate.ok
    assert divided.certificate.ok
    assert divided.intervals > coarse.intervals
    assert fine.trajectory.duration < divided.trajectory.duration < (1 + 5e-5) * fine.trajectory.duration


@pytest.mark.slow
def test_a_motion_is_resolved_once():
    task = task_of()
    resolved = ResolvedMotions(task.policy.motion_mesh)
    first, after = optimum_of(task, resolved), resolved.left
    assert optimum_of(task, resolved) is first
    assert task.policy.motion_mesh.work - after > 10 * (after - resolved.left) > 0


def test_without_work_left_one_mesh_is_solved():
    task = task_of(work=0)
    resolved = ResolvedMotions(task.policy.motion_mesh)
    assert optimum_of(task, resolved).intervals == task.policy.motion_mesh.intervals
    assert -resolved.left <= task.policy.motion_mesh.intervals * task.policy.motion_mesh.fewest
