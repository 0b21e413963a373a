"""What is worth a finer mesh, and what counts as solved there."""

import pytest

import armdyn as ad
from armdyn.optimal.problem.status import Status
from armdyn.optimal.search.candidates import taken
from armdyn.optimal.search.starts import spline
from armdyn.optimal.solve.direct import solve_on_mesh
from armdyn.optimal.task.options import DirectOptions
from armdyn.optimal.task.task import Task


@pytest.mark.slow
def test_beyond_three_joints_a_feasible_motion_is_taken_and_said_not_to_have_converged():
    robot = ad.Robot.from_library("ur5")
    problem = ad.MinimumTimeProblem(robot, q_start=[0, -1, 1, -1, -1.5, 0], q_goal=[-1.5, -1.8, 1.6, -0.4, 0.3, 1.0])
    task = Task.of(problem)

    def solve(iterations):
        settings = DirectOptions(1e-16, iterations)  # below rounding: it never ends by itself
        return solve_on_mesh(task, spline(problem, []), 20, settings)

    near, far, kept = solve(100), solve(3), task.policy.program.kept
    assert near.status is far.status is Status.ITERATION_LIMIT
    assert taken(near, kept).usable and taken(near, kept).worst_violation is not None
    assert taken(near, kept).status is Status.ITERATION_LIMIT  # it is not said to have converged
    assert not taken(near, None).usable
    assert not taken(far, kept).usable
