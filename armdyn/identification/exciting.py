"""Exciting motions: their regressor is as well conditioned as the limits allow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from armdyn.arguments import Checked, checked, expect, number, one_of, several, whole
from armdyn.arrays import Array
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.errors import ProblemError
from armdyn.identification.equations import WHAT, Equations, What
from armdyn.identification.log import Signals
from armdyn.locks import cached_property
from armdyn.models.presets.preset import ControllerPreset
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.scene.collision import CollisionModel
from armdyn.models.scene.obstacles import Obstacle, check_scene, contacts
from armdyn.models.scene.proof_of_clearance import prove_clearance
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory

_DEGREE = 5
_CHECKED = 0.01
"""Step at which limits are checked [s]."""
_SPARSE = 5
"""Steps from one check of the clearance to the next; a motion that is better than the best one is proven clear."""
_STARTS = 100
"""Poses that are drawn for a start clear of obstacles."""
_SMALLER = 0.85
"""Factor of a motion's size from one trial to the next until it is within torque limits and clear."""
_TRIALS = 25
_SPEED = 2.0
"""Speed in motions of joints without a velocity limit [rad/s or m/s]."""


@brief
@dataclass(frozen=True, kw_only=True)
class ExcitingOptions(Checked):
    """Options of `exciting_motion`.

    Attributes:
        what: the unknowns, as of `identify`: the condition number is theirs.
        margin: part of position, velocity and torque limits that the motion uses.
        knots: coefficients of each joint's spline per second [1/s].
        candidates: random motions, the best of which is improved.
        generations: changes of the best one that are tried.
        seed: of the candidates and the changes.
        obstacles: in the world, of which the arm is kept clear.
        self_collision: whether links are kept clear of each other.
        allowed_contacts: pairs of names of links and obstacles that may touch.
        clearance: least distance at all times [m].
        preset: of the robot's controller, which must accept the motion; None: any.

    Raises:
        ProblemError: one is wrong.
    """

    what: What = checked(one_of, "all", known=WHAT)
    margin: float = checked(number, 0.8, sign="positive", most=1.0)
    knots: float = checked(number, 1.5, unit="1/s", sign="positive")
    candidates: int = checked(whole, 10, least=1, most=10_000)
    generations: int = checked(whole, 150, least=0, most=100_000)
    seed: int = checked(whole, 0, least=0)
    obstacles: tuple[Obstacle, ...] = ()
    self_collision: bool = False
    allowed_contacts: tuple[tuple[str, str], ...] = ()
    clearance: float = 0.005
    preset: ControllerPreset | None = checked(
        expect, None, kind=ControllerPreset, hint='ControllerPreset.named("ur5e")'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "obstacles", check_scene(several(self.obstacles, "obstacles"), self.clearance))


def exciting_motion(robot: Robot, duration: float = 10.0, options: ExcitingOptions | None = None) -> Trajectory:
    """A motion from rest to rest, within limits, whose log identifies the arm well.

    Quintic B-splines, whose first and last coefficients are equal: the arm rests at both ends. The best conditioned of
    random ones is improved by an evolution strategy (Rechenberg's rule of one fifth).

    Args:
        robot: the arm, approximately.
        duration: of the motion [s], 1 to 600.
        options: unknowns, margins and obstacles.

    Raises:
        ProblemError: an argument is wrong, or no candidate is within the limits and clear.
    """
    expect_robot(robot)
    options = ExcitingOptions() if options is None else expect(options, ExcitingOptions, "options")
    search = _Search(robot, number(duration, "duration", unit="s", least=1.0, most=600.0), options)
    rng = np.random.default_rng(options.seed)
    tried = (search.fitted(search.random(rng)) for _ in range(options.candidates))
    found = [one for one in tried if one is not None and search.clear(one)]
    if not found:
        raise ProblemError(
            f"none of {options.candidates} motions of {robot.name} in {duration:g} s is within margin × limits and "
            "clear of obstacles: give more time, a larger margin or a smaller clearance"
        )
    best = min(found, key=search.condition)
    least, size = search.condition(best), 0.3
    for _ in range(options.generations):
        trial = search.fitted(best + size * np.std(best, axis=0) * rng.normal(size=best.shape))
        better = trial is not None and (value := search.condition(trial)) < least and search.clear(trial)
        if better and trial is not None:
            best, least = trial, value
        size *= 1.5 if better else 1.5**-0.25
    return search.motion(best)


@dataclass(frozen=True)
class _Search:
    """Motions of an arm as coefficients of splines, shape (k, nv).

    Attributes:
        robot: the arm.
        duration: of the motions [s].
        options: of the search.
    """

    robot: Robot
    duration: float
    options: ExcitingOptions

    @cached_property
    def equations(self) -> Equations:
        """Equations of the unknowns, for joints that move at unit speed under their largest torques."""
        most, none = self.robot.limits.effort_upper, np.zeros((2, self.robot.nv))
        tau = none + np.where(most < np.inf, most, 1.0)
        unit = Signals(t=np.arange(2.0), q=none, v=none + 1, a=none, tau=tau, width=1)
        return Equations.of(self.robot, self.options.what, [unit], self.robot.friction.width)

    @cached_property
    def t(self) -> Array:
        """Checked times [s], shape (n,)."""
        return np.linspace(0, self.duration, round(self.duration / _CHECKED) + 1)

    @cached_property
    def spline(self) -> tuple[Array, Array, Array]:
        """Values and two derivatives at these times of a clamped spline for unit coefficients, each of shape (n, k).

        The first and the last three coefficients are equal: the joints are at rest there.
        """
        free = max(4, round(self.options.knots * self.duration))
        inner = np.linspace(0, self.duration, free + 4 - _DEGREE + 1)
        knots = np.concatenate([np.zeros(_DEGREE), inner, np.full(_DEGREE, self.duration)])
        basis = BSpline(knots, np.repeat(np.eye(free), [3, *[1] * (free - 2), 3], axis=0), _DEGREE)
        return basis(self.t), basis(self.t, nu=1), basis(self.t, nu=2)

    @cached_property
    def ends(self) -> tuple[Array, Array]:
        """Least and largest positions [rad or m], each of shape (nv,)."""
        ends = np.stack([self.robot.limits.position_lower, self.robot.limits.position_upper])
        lower, upper = np.where(np.isfinite(ends).all(axis=0), ends, [[-np.pi], [np.pi]])
        idle = (1 - self.options.margin) / 2 * (upper - lower)
        return lower + idle, upper - idle

    @cached_property
    def collision(self) -> CollisionModel | None:
        """Distances; None: there are no obstacles."""
        robot, own = self.robot, self.options
        allowed = contacts(own.allowed_contacts, "allowed_contacts", robot, own.obstacles)
        kept = own.obstacles or own.self_collision
        return CollisionModel(robot, own.obstacles, own.self_collision, allowed) if kept else None

    def random(self, rng: np.random.Generator) -> Array:
        """Coefficients of a random motion, which starts clear of obstacles."""
        coefficients = rng.uniform(*self.ends, (self.spline[0].shape[1], self.robot.nv))
        for _ in range(_STARTS):
            if self._keeps_clearance(coefficients[:1]):
                break
            coefficients[0] = rng.uniform(*self.ends)
        return coefficients

    def states(self, coefficients: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations at the checked times, each of shape (n, nv)."""
        q, v, a = (one @ coefficients for one in self.spline)
        return q, v, a

    def fitted(self, coefficients: Array) -> Array | None:
        """Coefficients scaled about the first pose into the limits; None: they cannot be."""
        coefficients = np.clip(coefficients, *self.ends)
        start, margin = coefficients[:1], self.options.margin
        speed = np.where(np.isfinite(self.robot.limits.velocity), margin * self.robot.limits.velocity, _SPEED)
        fast = np.max(np.abs(self.spline[1] @ coefficients), axis=0) / speed
        coefficients = start + (coefficients - start) / np.maximum(1.0, fast)
        for _ in range(_TRIALS):
            if self._accepted(coefficients):
                return coefficients
            coefficients = start + _SMALLER * (coefficients - start)
        return None

    def _accepted(self, coefficients: Array) -> bool:
        motion, limits, margin = self.motion(coefficients), self.robot.limits, self.options.margin
        beyond = (motion.tau > margin * limits.effort_upper) | (motion.tau < margin * limits.effort_lower)
        if np.any(beyond[:, ~limits.passive]) or not self._keeps_clearance(motion.q[::_SPARSE]):
            return False
        return self.options.preset is None or self.options.preset.check(motion).ok

    def _keeps_clearance(self, poses: Array) -> bool:
        """Whether the clearance is kept in poses, shape (m, nv)."""
        least = self.options.clearance
        return self.collision is None or not np.any(self.collision.distances(poses, least) < least)

    def clear(self, coefficients: Array) -> bool:
        """Whether the motion is proven to keep the clearance, between the checked times, too."""
        least = self.options.clearance
        return self.collision is None or prove_clearance(self.collision, self.motion(coefficients), least)[0].sure

    def condition(self, coefficients: Array) -> float:
        """Condition number of the scaled regressor, restricted to the identifiable combinations."""
        every = max(1, self.t.size // 150)
        q, v, a = (one[::every] for one in self.states(coefficients))
        columns, _ = self.equations.at(q, v, a, every=1)
        columns = columns / self.equations.unknowns.offset[:, None]
        values = np.linalg.svd(columns.reshape(-1, columns.shape[-1]), compute_uv=False)
        rank = self.equations.structural_rank
        return float(values[0] / max(values[rank - 1], 1e-300))

    def motion(self, coefficients: Array) -> Trajectory:
        """The motion, with torques by inverse dynamics."""
        q, v, a = self.states(coefficients)
        tau = inverse_dynamics(self.robot)(q, v, a)
        name, robot = f"exciting motion of {self.robot.name}", self.robot
        return Trajectory(self.t, q, v, tau, joint_names=robot.joint_names, name=name, model_hash=robot.model_hash)
