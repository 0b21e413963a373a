"""Problems whose programs of curves are small."""

import numpy as np

import armdyn as ad
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curve import Basis, Curve, graded
from armdyn.optimal.curves.layout import CurveSpec
from armdyn.optimal.problem.task import Task
from problems import POSES, paper_arm

START, GOAL = POSES["rr"]
VIA = [-0.7, 0.8]
BALL = ad.Sphere((0.33, 0, -0.12), 0.05, name="ball")

KINDS = {
    "plain": {},
    "friction": {"velocity_limit": [8.0, np.inf]},
    "via": {"via": [VIA], "velocity_limit": 6.0},
    "acceleration and jerk": {"acceleration_limit": [50.0, np.inf], "jerk_limit": [np.inf, 900.0]},
    "via and jerk": {"via": [VIA], "jerk_limit": 900.0},
    "torque rate": {"path_constraints": [ad.TorqueRateLimit([40.0, np.inf])]},
    "via and torque rate": {"via": [VIA], "path_constraints": [ad.TorqueRateLimit(40.0)]},
    "via and continuous torque": {"via": [VIA], "path_constraints": [ad.RmsTorque([1.0, np.inf], dwell=0.2)]},
    "frame speed": {"path_constraints": [ad.FrameSpeedLimit(2.0)]},
    "obstacle": {"obstacles": [BALL]},
    "torque speed": {"velocity_limit": [8.0, np.inf]},
    "effort": {"relative_effort_weight": 0.5, "effort_weight": 0.1},
    "jerk in flight": {"v_start": [0.5, -0.3], "jerk_limit": 900.0},
    "in flight": {"v_start": [0.5, -0.3], "v_goal": [0.0, 0.4]},
}
"""A problem of the paper's arm of two links."""


def problem(kind, **more):
    """One of `KINDS`."""
    robot = paper_arm("rr")
    if kind == "friction":
        robot = robot.with_friction(friction=0.02, damping=0.01, width=0.5)
    if kind == "torque speed":
        robot = robot.with_torque_speed({"joint2": [[0.0, 3.0], [2.0, 2.5], [9.0, 0.5]]})
    return ad.MinimumTimeProblem(robot, q_start=START, q_goal=GOAL, **KINDS[kind], **more)


def task(kind, **more):
    """The same as a task, whose derivatives are not compiled: each is evaluated a few times only."""
    return Task.of(problem(kind, **more), ad.MinimumTimeOptions(compile=False))


def bent(problem, intervals=4, shortest=0.2):
    """A curve from pose to pose whose control points are off the straight line, so that no derivative is zero."""
    basis = Basis(graded(intervals, shortest))
    straight, rng = Curve.straight(problem, basis, 0.4), np.random.default_rng(0)
    inner = np.ones((basis.size, 1))
    inner[[0, 1, -2, -1]] = 0
    legs = tuple(
        type(leg)(basis, leg.points + 0.1 * inner * rng.normal(size=leg.points.shape), 0.4 + 0.05 * k)
        for k, leg in enumerate(straight.legs)
    )
    return Curve(legs)


def spec(problem, **more):
    """The problem's own conditions only."""
    return CurveSpec(TightenedConstraints.of(Task.of(problem)), **more)
