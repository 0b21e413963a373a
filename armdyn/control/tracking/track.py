"""Simulation of an arm under a controller along a reference; `Setup` is its law, to be run on any arm."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import expect, number
from armdyn.arrays import Array
from armdyn.control.laws.lqr import Lqr
from armdyn.control.loop.loop import Controller, Law, Loop, expect_controller, expect_loop, expect_motors, law_of
from armdyn.control.loop.references import Ticks
from armdyn.control.stability.rate import sampled_stability
from armdyn.control.tracking.loads import ChangingLoad, Loaded
from armdyn.control.tracking.run import Run, run_of
from armdyn.dynamics.driven import Driven, Tables, limited, plant_of
from armdyn.errors import ProblemError
from armdyn.models.robots.loads import load_of, robots_of
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import Robot, expect_robot, expect_robots
from armdyn.models.values.actuator_limits import ActuatorLimits
from armdyn.models.values.per_joint import per_joint
from armdyn.parallel import one_blas_thread
from armdyn.trajectory import Piece, Trajectory
from armdyn.trajectory.value import Hold as TorqueHold

_TOLERANCE = 1e-8
"""Largest change of a tick's positions when its steps are halved [rad or m]; of velocities a thousand times that."""
LONGER = 1.0
"""Simulated time after a reference that takes longer than the requested duration [s]."""
MOST_ROWS = 5_000_000
"""Ticks of a run times joints: 160 MB."""
_POSITION_BOUND, _VELOCITY_BOUND = 100.0, 1000.0
"""Distance from the goal [rad or m] and speed [rad/s or m/s] beyond which a run counts as diverged:
sixteen turns and ten times the fastest robot. A start beyond a tenth of them moves them out."""


_HELD = "; the arm starts at the goal, so that it is held there and does not move to it: q_start is where it starts"


@dataclass(frozen=True, eq=False)
class Setup:
    """A controller's law along a reference, and its connection to an arm.

    Attributes:
        robots: the controller's model of the arm in each piece of the reference.
        ticks: the reference.
        laws: the controller's in each piece.
        pieces: of the reference.
        starts: first tick of each piece.
        loop: connection of controller and arm.
        start: of the arm, (q, v), shape (2 nv,).
        duration: simulated time [s].
        tolerance: of a joint's distance from the goal [rad or m].
    """

    robots: tuple[Robot, ...]
    ticks: Ticks
    laws: tuple[Law, ...]
    pieces: tuple[Piece, ...]
    starts: tuple[int, ...]
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
        expect(reference, Trajectory, "reference", "such as solution.trajectory or ramp(…)")
        expect_controller(controller)
        expect_loop(loop)
        robots = robots_of(robot, reference)
        ticks = Ticks.of(robots[-1], reference, loop.rate)
        start = np.concatenate([reference.q[0], reference.v[0]])
        if q_start is not None:
            v = np.zeros(robot.nv) if v_start is None else v_start
            v = per_joint(v, robot.joint_names, "v_start", error=ProblemError, scalar=False)
            start = np.concatenate([pose_given(robot, q_start, "q_start"), v])
        duration = number(duration, "duration", unit="s", sign="positive")
        duration = duration if duration >= ticks.duration else ticks.duration + LONGER
        if duration * loop.rate * robot.nv > MOST_ROWS:
            raise ProblemError(
                f"{duration:g} s at {loop.rate:g} Hz are too many samples of {robot.nv} joints; expected at most "
                f"{MOST_ROWS / robot.nv:.0f} ticks"
            )
        tolerance = number(tolerance, "tolerance", unit="rad or m", sign="positive")
        with one_blas_thread():  # a regulator's solves many small systems
            made = {id(one): law_of(controller, one, ticks, loop) for one in robots}
        laws = tuple(made[id(one)] for one in robots)
        begins = (one.start - reference.t[0] for one in reference.own_pieces)
        starts = tuple(int(np.ceil(begin * loop.rate - 1e-9)) for begin in begins)
        return cls(robots, ticks, laws, reference.pieces, starts, loop, start, duration, tolerance)

    @property
    def robot(self) -> Robot:
        """The controller's model of the arm at the end."""
        return self.robots[-1]

    @property
    def law(self) -> Law:
        """The controller's at the end."""
        return self.laws[-1]

    def run(self, plant: Robot | Sequence[Robot], seed: int | None = None, name: str = "") -> Run:
        """Simulate and judge a run on an arm; threads may call it concurrently.

        Args:
            plant: the arm that moves; one per piece where the payload changes.
            seed: of the readings' noise; None: the loop's own.
            name: of the trajectory.
        """
        hold: TorqueHold = "zero-order" if self.loop.hold == "zoh" else "linear"
        plants = self._plants(plant)
        run = run_of(plants[-1], self.drive(plants, seed), self.ticks, self.tolerance, name, hold)
        if not self.pieces:
            return run
        return replace(run, trajectory=replace(run.trajectory, pieces=self._followed(plants, run.trajectory.t)))

    def _plants(self, plant: Robot | Sequence[Robot]) -> tuple[Robot, ...]:
        """The arm that moves in each piece.

        Raises:
            ProblemError: an arm has another number of joints; or the payload changes, and there is not one per piece.
        """
        count = len(self.robots)
        if isinstance(plant, Robot) and len(set(map(id, self.robots))) > 1:
            raise ProblemError(
                f"the payload changes along the reference of {count} pieces, and plant is one arm: give one per piece"
            )
        plants = (plant,) * count if isinstance(plant, Robot) else expect_robots(plant, "plant")
        if len(plants) != count:
            raise ProblemError(
                f"plant has {len(plants)} arms; the reference has {count} pieces: give one arm per piece"
            )
        for one in plants:
            if one.nv != self.robot.nv:
                raise ProblemError(f"the plant, {one.name}, has {one.nv} joints; {self.robot.name} has {self.robot.nv}")
        return plants

    def _followed(self, plants: Sequence[Robot], t: Array) -> tuple[Piece, ...]:
        """Pieces of a run, from tick to tick, with the loads that were there; without those shorter than a tick."""
        ends = [*self.starts[1:], len(t) - 1]
        return tuple(
            replace(piece, start=float(t[k]), model_hash=plant.model_hash, load=load_of(plant))
            for piece, plant, k, end in zip(self.pieces, plants, self.starts, ends, strict=True)
            if k < min(end, len(t) - 1)
        )

    def drive(self, plants: Sequence[Robot], seed: int | None = None) -> Driven:
        """Simulate the motion on an arm, one per piece."""
        nv, loop, plant = self.robot.nv, self.loop, plants[-1]
        limits = (self.robot.limits.actuators, plant.limits.actuators) if loop.saturate else ()
        falling = [own for own in limits if not own.constant]
        lower = np.max([np.full(nv, -np.inf), *(own.lower for own in limits)], axis=0)
        upper = np.min([np.full(nv, np.inf), *(own.upper for own in limits)], axis=0)
        count = max(int(np.ceil(self.duration * loop.rate - 1e-9)), 1)
        noise: Array = np.empty(0)
        if loop.noise:
            noise = np.random.default_rng(loop.seed if seed is None else seed).normal(0.0, loop.noise, (count, nv))
        first = np.clip(self.ticks.ahead(0)[np.minimum(np.arange(loop.delay), len(self.ticks.tau) - 1)], lower, upper)
        tables = Tables(
            rows=self.law.rows,
            q_reference=self.ticks.q,
            start=np.concatenate([self.start, np.zeros(nv)]) if loop.hold == "continuous" else self.start,
            first=first,
            lower=lower,
            upper=upper,
            integral_gain=self.law.integral_gain,
            noise=noise,
        )
        far = 10 * float(np.abs(self.start - np.concatenate([self.ticks.goal, np.zeros(nv)])).max())
        scalars = {
            **{name: getattr(loop, name) for name in ("period", "encoder", "pole", "delay", "velocity", "antiwindup")},
            "integrate_from": self.law.integrate_from,
            "away": max(_POSITION_BOUND, far),
            "fast": max(_VELOCITY_BOUND, far),
            "tolerance": _TOLERANCE,
            "ticks": count,
            "continuous": loop.hold == "continuous",
        }
        driven = self._changing(plants, falling).drive(tables, scalars)
        for own in falling:
            tau = own.clip(driven.tau, driven.q, driven.v)
            clipped = driven.clipped | (tau[: len(driven.clipped)] != driven.tau[: len(driven.clipped)])
            driven = driven._replace(tau=tau, clipped=clipped)
        return driven

    def _changing(self, plants: Sequence[Robot], falling: Sequence[ActuatorLimits]) -> ChangingLoad:
        """The distinct pairs of model and plant, and the ticks of each.

        Args:
            plants: the arm that moves in each piece.
            falling: torque limits that depend on the state.
        """
        pairs = [(id(model), id(plant)) for model, plant in zip(self.robots, plants, strict=True)]
        distinct = list(dict.fromkeys(pairs))
        observed = self.loop.velocity == "observer"
        loads = [
            Loaded(limited(plant_of(plants[k]), falling), plant_of(self.robots[k]) if observed else None, self.laws[k])
            for k in map(pairs.index, distinct)
        ]
        which = np.repeat([distinct.index(pair) for pair in pairs], np.diff([*self.starts, self.starts[-1] + 1]))
        return ChangingLoad(loads, which, self.loop.delay)


def expect_own_payload(robot: Robot, reference: Trajectory) -> None:
    """Refuse a reference whose pieces have other loads than the robot, for arms that are drawn with its payload.

    Raises:
        ProblemError: a piece has.
    """
    if any(one is not robot for one in robots_of(expect_robot(robot), reference)):
        raise ProblemError(
            f"pieces of the reference have other loads than {robot.name}, and the arms are drawn with its payload: "
            "give one of reference.split(), and the robot that carries its load"
        )


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
            model, its feedforward and the arm have the piece's load; the controller's memory continues over a change,
            which takes effect at the first tick of the piece.
        controller: `Lqr`, `ComputedTorque` or `Pid`.
        plant: the arm that moves: another payload, friction; None: the model itself. Of a reference whose pieces have
            loads an arm without a payload of its own, which carries these loads, or one arm per piece.
        loop: connection of controller and arm.
        duration: simulated time [s]; if the reference takes longer, its duration and a second.
        tolerance: of a joint's distance from the goal, to be settled [rad or m].
        q_start: where the arm stands at the beginning [rad or m], shape (nv,); None: where the reference begins. Of a
            `set_point` that is the goal: the arm is held there, and the message says so.

    Returns:
        The run. Its message names the velocity and position limits that it exceeded; of a run that did not settle also
        whether the loop is stable at its goal, and whether its sampling is to blame.

    Raises:
        ProblemError: robot, plant, reference or controller do not fit each other; not finite; too many samples.
    """
    setup = Setup.of(robot, reference, controller, loop, duration=duration, tolerance=tolerance, q_start=q_start)
    plants = _plants(setup.robots, reference, robot, plant)
    run = setup.run(plants, name=f"tracked by {_called(controller)}")
    if run.settled:
        poses = np.vstack([reference.q, setup.start[: robot.nv]])
        return replace(run, message=run.message + (_HELD if np.all(abs(poses - setup.ticks.goal) <= tolerance) else ""))
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
