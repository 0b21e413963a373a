"""State that a user edits in the studio: a value, to and from JSON, and its problem."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import count
from typing import Any, Self

import numpy as np
import pinocchio as pin

from armdyn.arguments import Checked, checked, flag, number, numbers, shown, text
from armdyn.arrays import Array
from armdyn.errors import ArmdynWarning, ProblemError
from armdyn.models.presets.preset import ControllerPreset
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.obstacles import Box, Capsule, Cylinder, Obstacle, Sphere, obstacle_entry, obstacle_from
from armdyn.models.scene.shapes import primitive
from armdyn.models.values.spec import Payload
from armdyn.optimal.problem.options import MAX_CALM
from armdyn.optimal.problem.problem import MinimumTimeProblem

MOST_RESERVE = 0.9
"""Largest reserve on the page [-]: more leaves hardly a motion."""
MOST_PAYLOAD = 1e4
"""Largest payload that is taken [kg]."""
MOST_OBSTACLES = 100
"""That a saved state may have: a scene of more is a file's."""
SIZES = {
    "box": {"size x": 0.15, "size y": 0.15, "size z": 0.3},
    "sphere": {"radius": 0.1},
    "cylinder": {"length": 0.3, "radius": 0.08},
}
"""Shapes that the page adds and resizes, with the names of their sizes and their first sizes [m]."""
_UNBOUNDED = 2 * np.pi
"""A slider of a joint without position limits goes so far either way [rad or m]."""


def _positions(value: object, name: str) -> tuple[float, ...]:
    """Joint positions, all finite."""
    found = numbers(value, name)
    if not np.all(np.isfinite(found)):
        raise ProblemError(f"{name} is {shown(found.tolist())}; it must be finite")
    return tuple(found.tolist())


@dataclass(frozen=True, kw_only=True)
class StudioState(Checked):
    """State of the page.

    Attributes:
        start: joint positions at the start [rad or m], shape (nv,).
        goal: joint positions at the goal [rad or m], shape (nv,).
        payload: mass that the arm carries [kg].
        reserve: part of every torque limit that is kept for feedback [-].
        calm: part of the duration that may be given for calm joints [-].
        preset: name of the controller preset; empty: none.
        self_collision: the arm's links keep clear of each other, too.
        obstacles: in the world; their names differ.
    """

    start: tuple[float, ...] = checked(_positions)
    goal: tuple[float, ...] = checked(_positions)
    payload: float = checked(number, 0.0, sign="not negative", most=MOST_PAYLOAD)
    reserve: float = checked(number, 0.0, sign="not negative", most=MOST_RESERVE)
    calm: float = checked(number, 1e-3, sign="not negative", most=MAX_CALM)
    preset: str = checked(text, "")
    self_collision: bool = checked(flag, False)
    obstacles: tuple[Obstacle, ...] = ()

    @classmethod
    def of(cls, problem: MinimumTimeProblem, calm: float) -> Self:
        """The state that a problem begins with; of several reserves the largest becomes that of all joints."""
        payload = problem.robot.payload
        return cls(
            start=tuple(np.asarray(problem.q_start).tolist()),
            goal=tuple(np.asarray(problem.q_goal).tolist()),
            payload=0.0 if payload is None else payload.mass,
            reserve=float(np.max(problem.reserve)),
            calm=calm,
            preset="" if problem.preset is None else problem.preset.name,
            self_collision=problem.self_collision,
            obstacles=tuple(problem.obstacles),
        )

    def entry(self) -> dict[str, Any]:
        """The state as JSON values."""
        return {**vars(self), "obstacles": [obstacle_entry(one) for one in self.obstacles]}

    @classmethod
    def from_entry(cls, entry: object, joints: int) -> Self:
        """The state of JSON values, which may be untrusted.

        Args:
            entry: as `StudioState.entry` makes it.
            joints: of the arm.

        Raises:
            ProblemError: it is no state of such an arm.
        """
        names = {one.name for one in fields(cls)}
        if not isinstance(entry, Mapping) or set(entry) != names:
            raise ProblemError(f"a state has {', '.join(sorted(names))}; this one is {shown(entry)}")
        made = entry["obstacles"]
        if not isinstance(made, Sequence) or isinstance(made, str) or len(made) > MOST_OBSTACLES:
            raise ProblemError(f"obstacles are {shown(made)}; they must be a list of at most {MOST_OBSTACLES}")
        obstacles = tuple(obstacle_from(one, f"obstacle {i}") for i, one in enumerate(made, start=1))
        state = cls(**{**entry, "obstacles": obstacles})
        if not len(state.start) == len(state.goal) == joints:
            raise ProblemError(f"start and goal have {len(state.start)} and {len(state.goal)} positions, not {joints}")
        return state


def slider_limits(problem: MinimumTimeProblem) -> tuple[Array, Array]:
    """Least and greatest position of each joint on the page [rad or m], each of shape (nv,)."""
    lower, upper = problem.limits.position_lower, problem.limits.position_upper
    return (
        np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper, 0.0) - _UNBOUNDED),
        np.where(np.isfinite(upper), upper, np.where(np.isfinite(lower), lower, 0.0) + _UNBOUNDED),
    )


def fitting_presets(problem: MinimumTimeProblem) -> dict[str, ControllerPreset]:
    """Controller presets for the robot's joints by their names: the problem's own, and the built-in ones."""
    found = {} if problem.preset is None else {problem.preset.name: problem.preset}
    for name in ControllerPreset.names():
        preset = ControllerPreset.named(name)
        try:
            preset.expect_joints(problem.robot.joint_names)
        except ProblemError:
            continue
        found.setdefault(preset.name, preset)
    return found


def carrying(robot: Robot, mass: float) -> Robot:
    """The robot with another mass of its payload [kg], of the same shape at the same place.

    Raises:
        SpecError: it cannot be read again.
    """
    now = robot.payload
    if mass == (0.0 if now is None else now.mass):
        return robot
    if now is None:
        return robot.with_payload(Payload(mass=mass))
    inertia = tuple(np.multiply(now.inertia, mass / now.mass).tolist()) if now.mass else now.inertia
    return robot.with_payload(replace(now, mass=mass, inertia=inertia) if mass or now.shapes else None)


def problem_of(
    problem: MinimumTimeProblem, robot: Robot, state: StudioState, presets: Mapping[str, ControllerPreset]
) -> tuple[MinimumTimeProblem, tuple[str, ...]]:
    """The problem of a state, and its warnings.

    Args:
        problem: the studio's initial problem: conditions that the state lacks, such as limits and via points, stay.
        robot: `carrying` the state's payload.
        state: the state.
        presets: by their names.

    Raises:
        ArmdynError: the problem is ill-posed, such as where a pose is outside the limits or touches something.
    """
    if state.preset and state.preset not in presets:
        raise ProblemError(f"no preset of this robot is named {shown(state.preset)}; there are {', '.join(presets)}")
    changes: dict[str, Any] = {
        **problem.own_rates,
        "robot": robot,
        "q_start": state.start,
        "q_goal": state.goal,
        "goal_pose": None,
        "preset": presets.get(state.preset),
        "self_collision": state.self_collision,
        "obstacles": state.obstacles,
    }
    if state.reserve != float(np.max(problem.reserve)):
        changes["reserve"] = state.reserve
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        made = replace(problem, **changes)
    messages = [str(one.message) for one in caught if issubclass(one.category, ArmdynWarning)]
    return made, tuple(dict.fromkeys(messages))


def placement_of(obstacle: Obstacle) -> pin.SE3 | None:
    """Placement of the gizmo for an obstacle in the world; None: the page does not move such an obstacle."""
    one: Any = obstacle
    if hasattr(one, "placement"):
        return pin.SE3(np.array(one.placement))
    return pin.SE3(one.solid()[0]) if isinstance(one, Sphere | Cylinder | Capsule) else None


def moved(obstacle: Obstacle, to: pin.SE3) -> Obstacle:
    """Copy of an obstacle at another placement of its gizmo.

    Raises:
        ArmdynError: the placement is not finite.
    """
    one: Any = obstacle
    if isinstance(one, Sphere):
        return replace(one, center=tuple(to.translation.tolist()))
    if isinstance(one, Cylinder | Capsule):
        half = np.array([0.0, 0.0, np.linalg.norm(np.subtract(one.b, one.a)) / 2])
        return replace(one, a=tuple(to.act(-half).tolist()), b=tuple(to.act(half).tolist()))
    made: Obstacle = replace(one, placement=to.homogeneous)
    return made


def sizes_of(obstacle: Obstacle) -> tuple[float, ...] | None:
    """Sizes of a shape that the page resizes, as in `SIZES` [m]; None: it does not resize such a one."""
    one: Any = obstacle
    if isinstance(one, Box):
        return tuple(one.size)
    if isinstance(one, Sphere):
        return (one.radius,)
    if isinstance(one, Cylinder):
        return float(np.linalg.norm(np.subtract(one.b, one.a))), one.radius
    return None


def resized(obstacle: Obstacle, sizes: Sequence[float]) -> Obstacle:
    """A shape of `SIZES` with other sizes, as `sizes_of` gives them.

    Raises:
        ArmdynError: one is not positive.
    """
    pose: Any = placement_of(obstacle)
    return primitive(type(obstacle).__name__.lower(), np.asarray(sizes, dtype=float), pose.homogeneous, obstacle.name)


def new_obstacle(kind: str, at: Array, others: Sequence[Obstacle]) -> Obstacle:
    """An obstacle of a kind of `SIZES` around a point [m], shape (3,), with a name that no other has."""
    taken = {one.name for one in others}
    name = next(name for k in count(1) if (name := f"{kind} {k}") not in taken)
    return primitive(kind, np.array(list(SIZES[kind].values())), pin.SE3(np.eye(3), np.asarray(at)).homogeneous, name)
