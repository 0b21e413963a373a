import numpy as np

import armdyn as ad
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.refine.slowing import within_velocity_limits
from armdyn.optimal.search.starts import spline
from armdyn.optimal.solve.direct import solve_on_mesh
from problems import paper_problem


def test_slowed_down_within_velocity_limits_only_where_it_lands():
    problem = paper_problem("rr", velocity_limit=12.0)
    options = ad.MinimumTimeOptions()
    dynamics, scheme = ad.Dynamics(problem.robot, free_last_body=True), options.scheme(2)
    motion = solve_on_mesh(problem, spline(problem, []), dynamics, scheme, 60, options.alone(), Stop()).trajectory
    assert np.max(np.abs(ad.replay_torques(problem.robot, motion).v)) > 12 * (1 + 1e-5)  # there is something to mend
    slowed, certificate = within_velocity_limits(problem, motion, "", 1e-2, Stop())
    assert certificate.limit_violation <= 1e-6 and certificate.goal_error <= 1e-2
    assert 1 < slowed.duration / motion.duration < 1.01
    assert within_velocity_limits(problem, motion, "", 0.1 * certificate.goal_error, Stop()) is None
