"""Rows along the path: their derivatives against CasADi's own, and that a plain problem has none."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import armdyn as ad
from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.constraints.regions import region_rows
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.constraints.rows import StageRows, differentiated, numbers_of, row_bounds
from armdyn.optimal.curves.program import CurveInterval
from armdyn.optimal.mesh.assembly import CollocationInterval, build_nlp
from armdyn.optimal.mesh.direct import legs_of, solve_on_mesh
from armdyn.optimal.mesh.layout import Layout
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.options import Scheme
from armdyn.optimal.problem.task import Task
from problems import POSES, cart, paper_arm, paper_problem

START, GOAL = POSES["rr"]


def test_a_plain_problem_has_no_rows_and_one_leg():
    problem = paper_problem("rr")
    constraints = TightenedConstraints.of(Task.of(problem))
    assert (
        constraints.path_constraints == () and constraints.rows(problem) == () and problem.path_constraint_names == ()
    )
    assert legs_of(problem, spline(problem, []), 40).intervals == (40,)


def test_derivatives():
    problem = ad.MinimumTimeProblem(
        paper_arm("rr").with_torque_speed({"joint1": [[0.0, 3.0], [1.0, 2.5], [2.0, 1.0]]}),
        q_start=START,
        q_goal=GOAL,
        acceleration_limit=100,
        jerk_limit=1e4,
        path_constraints=[
            ad.FrameSpeedLimit(0.5),
            ad.FrameSpeedLimit(0.5, "link2"),
            ad.TorqueRateLimit([20.0, 30.0]),
            ad.RmsTorque([2.0, 1.0], dwell=0.3),
        ],
    )
    scheme, constraints = Scheme("linear", compile=False), TightenedConstraints.of(Task.of(problem))
    dynamics, rows, N = ad.Dynamics(problem.robot, free_last_body=True), constraints.rows(problem), 2
    nlp = build_nlp(dynamics, scheme, N)
    more = build_nlp(dynamics, scheme, N, rows)
    x, p, f, g = (more.functions[name] for name in "xpfg")
    lower, upper = row_bounds(rows, CollocationInterval(dynamics, scheme), N)
    assert lower.size == upper.size == g.numel() - N * Layout(dynamics.nv, scheme).rows and np.all(lower <= upper)
    lam, sigma = ca.MX.sym("lam", g.numel()), ca.MX.sym("sigma")
    expected = ca.Function(
        "expected",
        [x, p, sigma, lam],
        [g, ca.jacobian(g, x), ca.triu(ca.hessian(sigma * f + ca.dot(lam, g), x)[0])],
    )
    random = np.random.default_rng(0)
    at = 0.3 * random.normal(size=x.numel())
    own = nlp.functions["p"].numel()
    numbers = np.concatenate([np.full(N, 1 / N), np.ones(own - N - 10), dynamics.last_body, numbers_of(rows)])
    weights = random.normal(size=g.numel())
    found, jacobian, hessian = (np.array(each) for each in expected(at, numbers, 0.7, weights))
    mine = [np.array(each) for each in more.jacobian(at, numbers)]
    np.testing.assert_allclose(mine[0], found, atol=1e-12 * np.max(np.abs(found)))
    # Rounding only: the same derivatives in another order of operations.
    np.testing.assert_allclose(mine[1], jacobian, atol=1e-10 * np.max(np.abs(jacobian)))
    np.testing.assert_allclose(
        np.array(more.hessian(at, numbers, 0.7, weights)), hessian, atol=1e-10 * np.max(np.abs(hessian))
    )
    plain = np.array(nlp.jacobian(at, numbers[:own])[0])
    np.testing.assert_array_equal(mine[0][: plain.size], plain)


def test_one_program_serves_all_numbers():
    def problem(speed, rate):
        path_constraints = [ad.FrameSpeedLimit(speed), ad.TorqueRateLimit(rate)]
        return ad.MinimumTimeProblem(paper_arm("rr"), q_start=START, q_goal=GOAL, path_constraints=path_constraints)

    rows = [
        TightenedConstraints.of(Task.of(each)).rows(each) for each in (problem(1, 20.0), problem(2, [30.0, np.inf]))
    ]
    assert rows[0] == rows[1] and hash(rows[0]) == hash(rows[1])
    assert not np.array_equal(numbers_of(rows[0]), numbers_of(rows[1]))
    assert replace(rows[0][0], numbers=[1.0, 2.0]) != rows[0][0]  # their count is the program's


def test_legs_share_the_mesh_by_time():
    problem = ad.MinimumTimeProblem(paper_arm("rr"), q_start=START, q_goal=GOAL, via=[[-0.7, 0.8], [-0.3, 0.9]])
    guess = spline(problem, [])
    legs = legs_of(problem, guess, 40)
    assert sum(legs.intervals) == 40 and min(legs.intervals) >= 4
    # The guess is at the via points at thirds of its time; it is sampled at fiftieths.
    np.testing.assert_allclose(legs.durations, guess.duration / 3, rtol=0.06)


def test_a_mesh_is_solved_again_on_its_own_knots_through_a_via_point():
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], via=[[0.5]])
    task = Task.of(problem)
    even = solve_on_mesh(task, spline(problem, []), 20, task.alone())
    knots = np.union1d(even.mesh, even.mesh[:4] + 0.004)  # four more in the first leg
    again = solve_on_mesh(task, even.trajectory, knots.size - 1, task.alone(), knots=knots)
    share = again.passing[0] / again.trajectory.duration
    assert again.usable and np.min(np.abs(again.mesh - share)) < 1e-12 and np.all(np.diff(again.mesh) > 0)
    np.testing.assert_allclose(again.trajectory(again.passing).q, 0.5, atol=1e-9)
    # Full thrust to the middle and back, 2 m by 1 N on 1 kg; an interval of constant thrust holds the switch.
    assert 2 * np.sqrt(2) * (1 - 1e-6) < again.trajectory.duration < 2 * np.sqrt(2) * (1 + 2e-3)


ROBOT = paper_arm("rrr")
PLACE = CurveInterval(Dynamics(ROBOT, free_last_body=True), False)
REGION = ad.GoalPose(ROBOT.tip, np.eye(4), tolerance=[0.01] * 6)


def torques(stages, numbers, stage):
    """Torques of inverse dynamics with a point of 0.1 kg."""
    q, v, a = (each[:, stage] for each in (stages.q, stages.v, stages.a))
    return stages.dynamics.rnea(q, v, a, np.append(0.1, np.zeros(9)))


@pytest.mark.parametrize(
    "rows",
    [region_rows(ROBOT, REGION, "every", None, (1, 2, 3)), StageRows(torques, -1, 1, arguments=(0,))],
    ids=["region", "torques"],
)
def test_the_chain_rule(rows):
    one, numbers = PLACE.stages(), ca.SX.sym("numbers", rows.size)
    p = ca.vertcat(one.p, numbers)
    direct = differentiated("direct", one.y, p, rows.expression(one, numbers, *rows.arguments), None, False)
    chained = rows.functions(PLACE)
    random = np.random.default_rng(3)
    y, given = random.uniform(0.2, 1, one.y.numel()), random.uniform(0.2, 1, p.numel())
    lam = random.normal(size=direct.defects.numel_out(0))
    np.testing.assert_allclose(chained.defects(y, given), direct.defects(y, given), rtol=1e-12)
    for name, arguments in (("jacobian", (y, given)), ("hessian", (y, given, 1.0, lam))):
        matrices = []
        for functions in (direct, chained):
            pattern = getattr(functions, f"{name}_pattern")
            matrices.append(ca.DM(pattern, getattr(functions, name)(*arguments)).full())
        scale = np.max(np.abs(matrices[0]))
        np.testing.assert_allclose(matrices[1], matrices[0], rtol=1e-10, atol=1e-12 * scale)
