"""Simulation of an arm under a controller along a reference."""

from __future__ import annotations

import re

from numpy.typing import ArrayLike

from armdyn.control.laws.lqr import Lqr
from armdyn.control.loop.law import Controller
from armdyn.control.loop.loop import Loop
from armdyn.control.stability.rate import sampled_stability
from armdyn.control.tracking.run import Run
from armdyn.control.tracking.setup import Setup
from armdyn.models.robots.robot import Robot
from armdyn.trajectory import Trajectory

_LOOP = Loop()
_CONTROLLER = Lqr()


def track(
    robot: Robot,
    reference: Trajectory,
    controller: Controller = _CONTROLLER,
    plant: Robot | None = None,
    loop: Loop = _LOOP,
    duration: float = 2.0,
    *,
    tolerance: float = 0.005,
    q_start: ArrayLike | None = None,
) -> Run:
    """Simulate a controller that moves an arm along a reference and holds it at the end.

    Args:
        robot: the controller's model of the arm.
        reference: the motion to follow, such as a minimum-time solution's trajectory.
        controller: `Lqr`, `ComputedTorque` or `Pid`.
        plant: the arm that moves: another payload, friction; None: the model itself.
        loop: connection of controller and arm.
        duration: simulated time [s]; if the reference takes longer, its duration and a second.
        tolerance: of a joint's distance from the goal, to be settled [rad or m].
        q_start: where the arm stands at the beginning [rad or m], shape (nv,); None: where the reference begins.

    Returns:
        The run. The message of a run that did not settle says whether the loop is stable at its goal, and
        whether its sampling is to blame.

    Raises:
        ProblemError: robot, plant, reference or controller do not fit each other; not finite; too many samples.
    """
    setup = Setup.of(robot, reference, controller, loop, duration=duration, tolerance=tolerance, q_start=q_start)
    plant = robot if plant is None else plant
    run = setup.run(plant, name=f"tracked by {_called(controller)}")
    if run.settled:
        return run
    return run.with_stability(sampled_stability(robot, setup.ticks.goal, controller, loop, plant))


def _called(controller: Controller) -> str:
    """A controller's name in a sentence: LQR, PID, computed torque."""
    words = re.findall(r"[A-Z][a-z0-9]*", type(controller).__name__) or [type(controller).__name__]
    return " ".join(word.upper() if len(word) <= 3 else word.lower() for word in words)
