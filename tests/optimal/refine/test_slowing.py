import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.refine.slowing import within_velocity_limits
from armdyn.optimal.search.starts import spline
from armdyn.optimal.solve.direct import solve_on_mesh
from armdyn.optimal.task.task import Task
from problems import paper_problem


@pytest.mark.slow
def test_slowed_down_within_velocity_limits_only_where_it_lands():
    problem = paper_problem("rr", velocity_limit=12.0)
    task = Task.of(problem, ad.MinimumTimeOptions(replay_tolerance=1e-2))
    motion = solve_on_mesh(task, spline(problem, []), 60, task.alone()).trajectory
    assert np.max(np.abs(ad.replay_torques(problem.robot, motion).v)) > 12 * (1 + 1e-5)  # there is something to mend
    slowed, certificate = within_velocity_limits(task, motion, "")
    assert certificate.limit_violation <= 1e-6 and certificate.goal_error <= 1e-2
    assert 1 < slowed.duration / motion.duration < 1.01
    strict = task.with_options(replay_tolerance=0.1 * certificate.goal_error)
    assert within_velocity_limits(strict, motion, "") is None
