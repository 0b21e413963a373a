"""A controller's law along a reference, to be run on any arm."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.arguments import expect, number
from armdyn.control.loop.law import Controller, Law, expect_controller, expect_motors
from armdyn.control.loop.loop import Loop, expect_loop
from armdyn.control.loop.ticks import Ticks
from armdyn.control.tracking.run import Run, run_of
from armdyn.dynamics.driven import Driven, Tables, drive, limited, plant_of
from armdyn.errors import ProblemError
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.values.per_joint import per_joint
from armdyn.trajectory import Trajectory
from armdyn.trajectory.value import Hold as TorqueHold

Array = NDArray[np.float64]

_TOLERANCE = 1e-8
"""Largest change of a tick's positions when its steps are halved [rad or m]; of velocities a thousand times that."""
_LONGER = 1.0
"""Simulated time after a reference that takes longer than the requested duration [s]."""
MOST_ROWS = 5_000_000
"""Ticks of a run times joints: 160 MB."""
_POSITION_BOUND, _VELOCITY_BOUND = 100.0, 1000.0
"""Distance from the goal [rad or m] and speed [rad/s or m/s] beyond which a run counts as diverged:
sixteen turns and ten times the fastest robot. A start beyond a tenth of them moves them out."""


@dataclass(frozen=True, eq=False)
class Setup:
    """A controller's law along a reference, and how it is joined to an arm.

    Attributes:
        robot: the controller's model of the arm.
        ticks: the reference.
        law: the controller's.
        loop: connection of controller and arm.
        start: of the arm, (q, v), shape (2 nv,).
        duration: simulated time [s].
        tolerance: of a joint's distance from the goal [rad or m].
    """

    robot: Robot
    ticks: Ticks
    law: Law
    loop: Loop
    start: Array
    duration: float
    tolerance: float

    @classmethod
    def of(
        cls,
        robot: Robot,
        reference: Trajectory,
        controller: Controller,
        loop: Loop,
        *,
        duration: float,
        tolerance: float,
        q_start: ArrayLike | None = None,
        v_start: ArrayLike | None = None,
    ) -> Self:
        """Check the arguments and make the law; see `track`."""
        expect_robot(robot)
        expect_motors(robot, "a controller")
        expect(reference, Trajectory, "reference", "a Trajectory, such as solution.trajectory or ramp(…)")
        expect_controller(controller)
        expect_loop(loop)
        ticks = Ticks.of(robot, reference, loop.rate)
        start = np.concatenate([reference.q[0], reference.v[0]])
        if q_start is not None:
            rest = np.zeros(robot.nv)
            v = (
                rest
                if v_start is None
                else per_joint(v_start, robot.joint_names, "v_start", error=ProblemError, scalar=False)
            )
            start = np.concatenate([pose_given(robot, q_start, "q_start"), v])
        duration = number(duration, "duration", unit="s", sign="positive")
        duration = duration if duration >= ticks.duration else ticks.duration + _LONGER
        if duration * loop.rate * robot.nv > MOST_ROWS:
            raise ProblemError(
                f"{duration:g} s at {loop.rate:g} Hz are too many samples of {robot.nv} joints; expected at most "
                f"{MOST_ROWS / robot.nv:.0f} ticks"
            )
        tolerance = number(tolerance, "tolerance", unit="rad", sign="positive")
        return cls(robot, ticks, controller.law(robot, ticks, loop), loop, start, duration, tolerance)

    def run(self, plant: Robot, seed: int | None = None, name: str = "") -> Run:
        """Simulate and judge a run on an arm; threads may call it concurrently.

        Args:
            plant: the arm that moves.
            seed: of the readings' noise; None: the loop's own.
            name: of the trajectory.
        """
        hold: TorqueHold = "zero-order" if self.loop.hold == "zoh" else "linear"
        return run_of(plant, self.drive(plant, seed), self.ticks, self.tolerance, name, hold)

    def drive(self, plant: Robot, seed: int | None = None) -> Driven:
        """Simulate the motion on an arm.

        Raises:
            ProblemError: the arm has another number of joints.
        """
        nv, loop = self.robot.nv, self.loop
        if expect_robot(plant, "plant").nv != nv:
            raise ProblemError(f"the plant, {plant.name}, has {plant.nv} joints; {self.robot.name} has {nv}")
        falling = [own for own in (self.robot.limits.actuators, plant.limits.actuators) if not own.constant]
        falling = falling if loop.saturate else []
        body = limited(plant_of(plant), falling)
        model = plant_of(self.robot) if loop.velocity == "observer" else None
        lower, upper = self._limits(plant)
        count = max(int(np.ceil(self.duration * loop.rate - 1e-9)), 1)
        noise: Array = np.empty(0)
        if loop.noise:
            noise = np.random.default_rng(loop.seed if seed is None else seed).normal(0.0, loop.noise, (count, nv))
        first = np.clip(self.ticks.ahead(0)[np.minimum(np.arange(loop.delay), len(self.ticks.tau) - 1)], lower, upper)
        tables = Tables(
            plant_parameters=body.parameters,
            model_parameters=np.empty(0) if model is None else model.parameters,
            rows=self.law.rows,
            q_reference=self.ticks.q,
            start=np.concatenate([self.start, np.zeros(nv)]) if loop.hold == "continuous" else self.start,
            first=first,
            lower=lower,
            upper=upper,
            integral_gain=self.law.integral_gain,
            noise=noise,
        )
        observer = None if model is None else model.function
        driven = drive(body.function, self.law.function, observer, tables, self._scalars(count))
        for own in falling:
            tau = own.clip(driven.tau, driven.q, driven.v)
            clipped = driven.clipped | (tau[: len(driven.clipped)] != driven.tau[: len(driven.clipped)])
            driven = driven._replace(tau=tau, clipped=clipped)
        return driven

    def _limits(self, plant: Robot) -> tuple[Array, Array]:
        """Torque limits in any state [N m or N]: the tighter ones of model and plant."""
        if not self.loop.saturate:
            return np.full(plant.nv, -np.inf), np.full(plant.nv, np.inf)
        own, its = self.robot.limits.actuators, plant.limits.actuators
        return np.maximum(own.lower, its.lower), np.minimum(own.upper, its.upper)

    def _scalars(self, count: int) -> dict[str, Any]:
        loop = self.loop
        far = 10 * float(np.abs(self.start - np.concatenate([self.ticks.goal, np.zeros(self.robot.nv)])).max())
        return {
            "period": loop.period,
            "encoder": loop.encoder,
            "pole": loop.pole,
            "integrate_from": self.law.integrate_from,
            "away": max(_POSITION_BOUND, far),
            "fast": max(_VELOCITY_BOUND, far),
            "tolerance": _TOLERANCE,
            "ticks": count,
            "row_size": self.law.rows.shape[1],
            "delay": loop.delay,
            "continuous": loop.hold == "continuous",
            "velocity": loop.velocity,
            "antiwindup": loop.antiwindup,
        }
