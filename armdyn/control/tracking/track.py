"""Simulation of an arm under a controller along a reference."""

from __future__ import annotations

import re
from collections.abc import Sequence

from numpy.typing import ArrayLike

from armdyn.control.laws.lqr import Lqr
from armdyn.control.loop.law import Controller
from armdyn.control.loop.loop import Loop
from armdyn.control.stability.rate import sampled_stability
from armdyn.control.tracking.run import Run
from armdyn.control.tracking.setup import Setup
from armdyn.errors import ProblemError
from armdyn.models.robots.loads import robots_of
from armdyn.models.robots.robot import Robot, expect_robots
from armdyn.trajectory import Trajectory


def track(
    robot: Robot,
    reference: Trajectory,
    controller: Controller = Lqr(),
    plant: Robot | Sequence[Robot] | None = None,
    loop: Loop = Loop(),
    duration: float = 2.0,
    *,
    tolerance: float = 0.005,
    q_start: ArrayLike | None = None,
) -> Run:
    """Simulate a controller that moves an arm along a reference and holds it at the end.

    Args:
        robot: the controller's model of the arm.
        reference: the motion to follow, such as a minimum-time solution's trajectory. In each piece the controller's
            model, its feedforward and the arm have the piece's load; the controller's memory goes on over a change,
            which takes effect at the first tick of the piece.
        controller: `Lqr`, `ComputedTorque` or `Pid`.
        plant: the arm that moves: another payload, friction; None: the model itself. Of a reference whose pieces have
            loads an arm without a payload of its own, which carries these loads, or one arm per piece.
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
    plants = _plants(setup.robots, reference, robot, plant)
    run = setup.run(plants, name=f"tracked by {_called(controller)}")
    if run.settled:
        return run
    return run.with_stability(sampled_stability(setup.robot, setup.ticks.goal, controller, loop, plants[-1]))


def _plants(
    models: Sequence[Robot], reference: Trajectory, robot: Robot, plant: Robot | Sequence[Robot] | None
) -> Sequence[Robot]:
    """The arm that moves in each piece.

    Raises:
        ProblemError: it has a payload of its own, and so have the pieces.
    """
    if plant is None:
        return models
    if not isinstance(plant, Robot):
        return expect_robots(plant, "plant")
    loads = {piece.load for piece in reference.pieces} - {None}
    if not loads:
        return [plant] * len(models)
    if plant.payload is not None and plant.payload != robot.payload:
        raise ProblemError(
            f"plant carries {plant.payload.mass:g} kg, and the pieces of the reference have loads of their own: give "
            "an arm without a payload, or one arm per piece"
        )
    return robots_of(plant, reference)


def _called(controller: Controller) -> str:
    """A controller's name in a sentence: LQR, PID, computed torque."""
    words = re.findall(r"[A-Z][a-z0-9]*", type(controller).__name__) or [type(controller).__name__]
    return " ".join(word.upper() if len(word) <= 3 else word.lower() for word in words)
