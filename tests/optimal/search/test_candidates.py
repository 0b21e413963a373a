"""What is worth a finer mesh, and what counts as solved there."""

import armdyn as ad
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import stopping
from armdyn.optimal.search.candidates import taken
from armdyn.optimal.search.starts import spline
from armdyn.optimal.solve.direct import solve_on_mesh
from armdyn.optimal.task.options import DirectOptions


def test_beyond_three_joints_a_feasible_motion_is_taken_and_said_not_to_have_converged():
    robot = ad.Robot.from_library("ur5")
    problem = ad.MinimumTimeProblem(robot, q_start=[0, -1, 1, -1, -1.5, 0], q_goal=[-1.5, -1.8, 1.6, -0.4, 0.3, 1.0])
    dynamics, scheme = ad.Dynamics(robot, free_last_body=True), ad.MinimumTimeOptions().scheme(6)
    with stopping(60) as stop:

        def solve(iterations):
            options = DirectOptions(1e-16, iterations)  # below rounding: it never ends by itself
            return solve_on_mesh(problem, spline(problem, []), dynamics, scheme, 20, options, stop)

        near, far = solve(100), solve(3)
    assert near.status is far.status is Status.ITERATION_LIMIT
    assert taken(near, 6).status is Status.SOLVED and taken(near, 6).worst_violation is not None
    assert taken(near, 3).status is Status.ITERATION_LIMIT
    assert taken(far, 6).status is Status.ITERATION_LIMIT
