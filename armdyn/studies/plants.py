"""Monte Carlo over plants: parameter ranges about a controller's model, samples, and the sampled arms."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Self

import numpy as np
import pinocchio as pin

from armdyn.arguments import MOST_MEMBERS, Checked, checked, interval, number, whole
from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.models.robots.arm import payload_inertia
from armdyn.models.robots.robot import Robot, expect_robot, expect_robots
from armdyn.reprs import brief, joints_of

Range = tuple[float, float]
"""Least and greatest; uniformly distributed."""

MAX_ARMS = 10**6
"""Largest study [arms]: all rows are in memory at the end."""
_range = partial(interval, widths="any")


@dataclass(frozen=True)
class PlantSample:
    """Differences of one arm from the model.

    Attributes:
        payload: its mass and inertia as a multiple of the model's payload.
        coulomb: friction of each joint [N m or N], in addition to the model's, shape (nv,).
        damping: viscous friction of each joint [N m s/rad or N s/m], likewise.
        start: distance of each joint from the reference's start [rad or m], shape (nv,).
        noise: seed of the readings' noise.
        likely: index of the arm in `Plants.likely`; None: the model.
    """

    payload: float
    coulomb: tuple[float, ...]
    damping: tuple[float, ...]
    start: tuple[float, ...]
    noise: int
    likely: int | None = None

    def arm(self, robot: Robot, likely: Sequence[Robot] = ()) -> Robot:
        """Arm of a sample: a model, or a drawn likely arm, with the sampled differences."""
        robot = robot if self.likely is None else likely[self.likely]
        damping, coulomb = robot.friction.per_joint(robot.nv)
        arm = robot if self.payload == 1 else with_payload_times(robot, self.payload)
        return arm.with_friction(damping + np.array(self.damping), coulomb + np.array(self.coulomb))


@brief
@dataclass(frozen=True, kw_only=True)
class Plants(Checked):
    """Ranges of the uncertain properties of an arm: payload, friction, start.

    Each number is uniformly distributed in its range, and each joint has its own.

    Attributes:
        payload: mass and inertia of the payload, as multiples of the model's; None: 0.8 to 1.2, of `likely` arms 1.
        coulomb: dry friction of a joint [N m or N], in addition to the model's.
        damping: viscous friction of a joint [N m s/rad or N s/m], likewise.
        start: greatest distance of a joint from the reference's start [rad or m].
        likely: arms taken in turn instead of the model, such as `Estimate.likely(200)`; the differences are added.
        seed: arm k of a seed is the same, for any number and order of draws.

    Raises:
        ProblemError: a range that is not two numbers in order; negative friction; a payload that is not positive.
    """

    payload: Range | None = checked(_range, None, unit="times its mass", sign="positive")
    coulomb: Range = checked(_range, (0.0, 0.0), unit="N m or N", sign="not negative")
    damping: Range = checked(_range, (0.0, 0.0), unit="N m s/rad or N s/m", sign="not negative")
    start: float = checked(number, 0.0, unit="rad or m", sign="not negative")
    likely: tuple[Robot, ...] = checked(expect_robots, ())
    seed: int = checked(whole, 0, least=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "payload", self.loads)

    @property
    def loads(self) -> Range:
        """Mass and inertia of the payload, as multiples."""
        if self.payload is not None:
            return self.payload
        return (1.0, 1.0) if self.likely else (0.8, 1.2)

    def sample(self, k: int, nv: int) -> PlantSample:
        """Sample number k.

        All parts are drawn, also where a range has no width: the payload does not depend on the friction.

        Args:
            k: from 0.
            nv: number of joints.
        """
        nv = whole(nv, "nv", least=1, most=MOST_MEMBERS)
        random = np.random.default_rng([self.seed, whole(k, "k", least=0)])
        parts = random.random(1 + 3 * nv)
        noise = int(random.integers(2**31))
        payload, coulomb, damping, start = np.split(parts, [1, 1 + nv, 1 + 2 * nv])
        return PlantSample(
            payload=float(_between(self.loads, payload)[0]),
            coulomb=tuple(_between(self.coulomb, coulomb).tolist()),
            damping=tuple(_between(self.damping, damping).tolist()),
            start=tuple(_between((-self.start, self.start), start).tolist()),
            noise=noise,
            likely=k % len(self.likely) if self.likely else None,
        )

    def arms(self, robot: Robot, count: int) -> tuple[Robot, ...]:
        """The first arms of the seed.

        Args:
            robot: the controller's model.
            count: of arms.

        Raises:
            ProblemError: it carries no payload that could differ.
        """
        self.check(robot)
        count = whole(count, "count", least=0, most=MOST_MEMBERS)
        return tuple(self.sample(k, robot.nv).arm(robot, self.likely) for k in range(count))

    def corners(self, robot: Robot) -> tuple[Robot, ...]:
        """The arms at the ends of the ranges, and with the payload in the middle: six, or less where one has no width.

        With likely arms, this number for each of them. Friction is the least in all joints, or the greatest.

        Args:
            robot: the controller's model.

        Raises:
            ProblemError: it carries no payload that could differ.
        """
        self.check(robot)
        least, greatest = self.loads
        loads = dict.fromkeys((least, (least + greatest) / 2, greatest))
        rubbing = dict.fromkeys(zip(self.coulomb, self.damping, strict=True))
        rest, nv = (0.0,) * robot.nv, robot.nv
        return tuple(
            PlantSample(load, (coulomb,) * nv, (damping,) * nv, rest, 0).arm(model)
            for model, (coulomb, damping), load in product(self.likely or (robot,), rubbing, loads)
        )

    def check(self, robot: Robot) -> Self:
        """Return these ranges if they are possible for an arm.

        Raises:
            ProblemError: it carries no payload that could differ, or a likely arm has another number of joints.
        """
        carries = expect_robot(robot).payload is not None and robot.payload.mass > 0  # type: ignore[union-attr]
        for i, arm in enumerate(self.likely):
            if arm.nv != robot.nv:
                raise ProblemError(f"likely[{i}] has {joints_of(arm.nv)}, {robot.name} {robot.nv}")
        if self.loads != (1.0, 1.0) and not carries:
            raise ProblemError(
                f"plants carry {self.loads[0]:g} to {self.loads[1]:g} times the payload of {robot.name}, which has "
                "none: give the robot a payload, or 1 to 1 times"
            )
        return self


def with_payload_times(robot: Robot, factor: float) -> Robot:
    """The robot with mass and inertia of its payload multiplied by a factor.

    The dynamic parameters of a joint's load are sums over its bodies, so that a part of one body's can be added.

    Args:
        robot: with a payload.
        factor: positive.

    Raises:
        ProblemError: it has no payload.
    """
    load = robot.payload
    if load is None:
        raise ProblemError(f"{robot.name} carries no payload; give it a `payload`")
    frame = robot.frame_of(load)
    model = robot.model.copy()
    body = model.inertias[frame.parentJoint].toDynamicParameters()
    more = (factor - 1) * frame.placement.act(payload_inertia(load)).toDynamicParameters()
    model.inertias[frame.parentJoint] = pin.Inertia.FromDynamicParameters(body + more)
    moments = np.multiply(factor, load.inertia)
    return replace(robot, model=model, payload=replace(load, mass=factor * load.mass, inertia=moments))


def _between(ends: Range, part: Array) -> Array:
    return np.asarray(ends[0] + (ends[1] - ends[0]) * part)
