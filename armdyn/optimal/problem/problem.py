"""Minimum-time problem: from one pose to another within limits, as fast as possible."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import expect, flag, number, path_of, several
from armdyn.arrays import Array
from armdyn.errors import ArmdynWarning, ProblemError
from armdyn.models.presets.preset import ControllerPreset
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.scene.collision import CollisionModel, collision_model
from armdyn.models.scene.obstacles import Obstacle, check_scene, contacts
from armdyn.models.scene.reaching import GoalPose, poses_reaching
from armdyn.models.tables import robot_table
from armdyn.models.values.actuator_limits import ConstantTorque
from armdyn.models.values.joint_limits import JointLimits
from armdyn.models.values.per_joint import per_joint
from armdyn.optimal.problem.checks import (
    LANDING,
    HoldingDeficit,
    check_accelerations,
    check_every_joint_has_motor,
    check_limits,
    check_motors,
    check_path_constraints,
    check_poses,
    check_state,
    check_way,
    check_without_torques,
    clear_goals,
    holding_deficits,
)
from armdyn.optimal.problem.planning_limits import PathConstraintSpec, Reserve, rate_limit, resolved_limits
from armdyn.optimal.problem.poses import Via, check_via_regions, endless, goals_with_turns, via_positions
from armdyn.optimal.problem.tables import problem_table
from armdyn.parsing.toml import MAX_BYTES, to_toml
from armdyn.rendering import renderer
from armdyn.reprs import brief, called, several_numbers
from armdyn.trajectory import Trajectory

_IDLE = 2.0
"""Torque limits of `without_torques` over the largest acceleration: they decide nothing."""


@brief
@dataclass(frozen=True, eq=False)
class MinimumTimeProblem:
    """Bring an arm from one state to another in minimum time, or with minimum time and effort.

    Minimise J = ∫ (1 + w/2 τᵀτ) dt over the torques and the final time, subject to the equations of
    motion, the joints' friction included, and the limits. With w = 0 this is minimum time.

    Attributes:
        robot: the arm.
        q_start: joint positions at the start [rad or m], shape (nv,), or a name in `robot.poses`.
        q_goal: joint positions at the goal, likewise; with `goal_pose` the nearest solution of the inverse kinematics.
        v_start: joint velocities at the start [rad/s or m/s], shape (nv,); None: at rest.
        v_goal: joint velocities at the end, shape (nv,); None: at rest.
        effort_limit: torque limits [N m or N]: one number, one per joint, or (lower, upper); None: the robot's.
            Zero: the joint has no motor.
        velocity_limit: [rad/s or m/s]: one number or one per joint, inf for none; None: the robot's.
        position_limit: (lower, upper) [rad or m], each one number or one per joint; None: the robot's.
        reserve: part of every torque limit that is kept for feedback [-]: one number or one per joint, at least 0 and
            below 1. The motion is planned with (1 - reserve) of the lower and of the upper limit.
        velocity_reserve: likewise of every velocity limit.
        passive: names of further joints without a motor, such as a cart's pole; their torque limits are zero.
        effort_weight: w [1/(N m)²].
        relative_effort_weight: weight of the torques relative to half their ranges [-], so that small joints count,
            too; not with passive joints.
        wrap: goals of endless joints (revolute, without position limits) are meant modulo 2π: the shorter and the
            longer way round are tried. False: a joint goes to the given angle, where a cable must not be wound up: from
            0 to 6 rad is nearly a whole turn.
        goal_pose: pose of a frame at the goal, instead of q_goal; inverse kinematics give its branches.
        via: via points in order, passed at any time and velocity: poses, like q_start, or regions, `GoalPose` with
            tolerances or free directions, in which the program chooses the pose. With a via point the goal may be the
            start.
        obstacles: bodies in the world that the arm must not touch.
        self_collision: whether pairs of the arm's own links keep the clearance, too.
        clearance: least distance of bodies [m].
        allowed_contacts: pairs of names, of links, tool, payload and obstacles, that may touch: no distance is
            computed.
        end_contacts: pairs of names that may touch at the start, a via point or the goal, such as a payload and the
            table under it, with an overlap of 10 mm at most: during the motion they keep the clearance, or the least
            distance at these poses.
        acceleration_limit: [rad/s² or m/s²]: one number or one per joint; None: none.
        jerk_limit: likewise [rad/s³ or m/s³]; with one, the acceleration is zero at both ends.
        path_constraints: further constraints along the path, such as `FrameSpeedLimit(0.25)` or
            `TorqueRateLimit(50.0)`.
        preset: limits of the robot's controller, those of the preset's interface, necessary and recommended; the
            tighter of these and the limits above holds.
        kinematic: leave torques out, as for an arm whose inertias are unknown: the limits of position, velocity,
            acceleration and jerk alone count. Each joint needs a limit of its acceleration, or of velocity and jerk.
        limits: limits of the motion, less the reserves, each of shape (nv,); certificate, lower bound and sensitivities
            refer to these.
        goals: joint positions that are tried as goals [rad or m], each of shape (nv,); the first is q_goal.
        poses: start, via points and goal [rad or m], shape (legs + 1, nv); in a via region sampled joint positions.

    Raises:
        ProblemError: wrong length, not finite, a state outside the limits or in contact, start = goal without
            via points, a joint without a finite torque limit, no joint with a motor, or a goal pose out of reach.

    Warns:
        ArmdynWarning: the actuators cannot hold the goal; see `holding_deficit`.
    """

    robot: Robot
    _: KW_ONLY
    q_start: ArrayLike | str
    q_goal: ArrayLike | str | None = None
    v_start: ArrayLike | None = None
    v_goal: ArrayLike | None = None
    effort_limit: ArrayLike | tuple[ArrayLike, ArrayLike] | None = None
    velocity_limit: ArrayLike | None = None
    position_limit: tuple[ArrayLike, ArrayLike] | None = None
    reserve: ArrayLike = 0.0
    velocity_reserve: ArrayLike = 0.0
    passive: Sequence[str] = ()
    effort_weight: float = 0.0
    relative_effort_weight: float = 0.0
    wrap: bool = False
    goal_pose: GoalPose | None = None
    via: Sequence[ArrayLike | str | GoalPose] = ()
    obstacles: Sequence[Obstacle] = ()
    self_collision: bool = False
    clearance: float = 0.005
    allowed_contacts: Sequence[tuple[str, str]] = ()
    end_contacts: Sequence[tuple[str, str]] = ()
    acceleration_limit: ArrayLike | None = None
    jerk_limit: ArrayLike | None = None
    path_constraints: Sequence[PathConstraintSpec] = ()
    preset: ControllerPreset | None = None
    kinematic: bool = False
    limits: JointLimits = field(init=False, repr=False)
    goals: tuple[Array, ...] = field(init=False, repr=False)
    poses: Array = field(init=False, repr=False)
    own_rates: Mapping[str, ArrayLike | None] = field(init=False, repr=False)
    """Limits of acceleration and jerk as given, without the preset's."""

    def __post_init__(self) -> None:
        expect_robot(self.robot)
        if self.preset is not None:
            expect(self.preset, ControllerPreset, "preset", "ControllerPreset.named('franka-panda')")
            self.preset.expect_joints(self.robot.joint_names)
        if self.q_goal is None and self.goal_pose is None:
            raise ProblemError("give `q_goal` or `goal_pose`")
        self._resolve_ends()
        for name in ("effort_weight", "relative_effort_weight"):
            number(getattr(self, name), name, sign="not negative")
        for name in ("wrap", "self_collision", "kinematic"):
            flag(getattr(self, name), name)
        if self.kinematic:
            check_without_torques(self)
            self._set(preset=self.preset and self.preset.without("torque", "torque_rate"))
        else:
            self.robot.expect_dynamics()
        self._set(limits=self._resolve_limits())
        goals = [np.asarray(self.q_goal)]
        if self.goal_pose is not None:
            goals = poses_reaching(self.robot, self.goal_pose, np.asarray(self.q_start), self.limits)
        if self.wrap:
            goals = goals_with_turns(np.asarray(self.q_start), goals, self.limits, endless(self.robot, self.limits))
        self._set(q_goal=goals[0], goals=tuple(goals))
        for q, v, name in ((self.q_start, self.v_start, "start"), (self.q_goal, self.v_goal, "goal")):
            check_state(self.robot, self.limits, np.asarray(q), np.asarray(v), name, self.reserves.velocity)
        if not several(self.via, "via"):
            check_way(self.robot, self.x_start, self.x_goal)
        self._resolve_path_constraints()
        for one in self._deficits_at("goal"):
            then = "staying there is beyond this actuator" if one.beyond else "staying there takes of the reserve"
            warnings.warn(f"{one.words}: a motion to the goal may exist, {then}", ArmdynWarning, stacklevel=3)

    def _set(self, **resolved: object) -> None:
        """Store attributes as resolved; arrays become read-only."""
        for name, value in resolved.items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(self, name, value)

    def _repr_parts(self) -> list[str]:
        """Parts of the `repr`."""
        ends = [f"{name} {several_numbers(getattr(self, f'q_{name}'))}" for name in ("start", "goal")]
        constraints = ", ".join(self.path_constraint_names)
        return [called(self.robot.name), *ends, *([f"with {constraints}"] if constraints else [])]

    def _repr_html_(self) -> str:
        """A table and a picture, for notebooks."""
        return renderer().card(self)

    @property
    def reserves(self) -> Reserve:
        """Parts of the limits that are kept for feedback."""
        return Reserve(np.asarray(self.reserve), np.asarray(self.velocity_reserve))

    @property
    def path_constraint_names(self) -> tuple[str, ...]:
        """Names of the path constraints; meshes and curves satisfy them, arcs do not."""
        active = {
            "obstacles": bool(self.obstacles),
            "self-collision": self.self_collision,
            "via points": bool(self.via),
            "acceleration limits": self.acceleration_limit is not None,
            "jerk limits": self.jerk_limit is not None,
            "torque-speed curves": not self.limits.actuators.constant,
            "torque-rate limits": self._preset_limits("torque_rate"),
            "velocity limits by position": self.preset is not None and self.preset.taper is not None,
            **{constraint.name: True for constraint in self.path_constraints},
        }
        return tuple(name for name, is_active in active.items() if is_active)

    @property
    def has_clearance(self) -> bool:
        """Whether pairs of bodies must keep `clearance`: paths around obstacles and the arm itself are then planned."""
        return bool(self.obstacles) or self.self_collision

    @property
    def has_regions(self) -> bool:
        """Whether a frame passes through or stays in regions, solved by sequential convexification only."""
        return bool(self.via_regions) or any(one.curves_alone for one in self.path_constraints)

    def collision_model(self) -> CollisionModel:
        """Collision model of the arm and its obstacles, with the pairs of bodies that keep a clearance."""
        contacts = tuple(self.allowed_contacts), tuple(self.end_contacts)
        return collision_model(self.robot, tuple(self.obstacles), self.self_collision, *contacts)

    def without_obstacles(self) -> Self:
        """The problem without obstacles and self-collision."""
        return self.variant(obstacles=(), self_collision=False, allowed_contacts=(), end_contacts=())

    def without_torques(self) -> Self:
        """The problem of an arm whose torques are its accelerations, see `Robot.with_unit_inertia`."""
        robot, most = self.robot.with_unit_inertia(), _IDLE * self._largest_acceleration
        return self.variant(robot=robot, kinematic=False, effort_limit=most)

    @property
    def rates(self) -> tuple[Array, Array]:
        """Limits of acceleration and jerk [rad or m, per s² and s³], each of shape (nv,); infinite: no limit."""
        given, none = (self.acceleration_limit, self.jerk_limit), np.full(self.robot.nv, np.inf)
        acceleration, jerk = (none if limit is None else np.asarray(limit) for limit in given)
        return acceleration, jerk

    @property
    def _largest_acceleration(self) -> Array:
        """Largest acceleration within the limits of the rates [rad/s² or m/s²], shape (nv,): from -v to v by jerks."""
        acceleration, jerk = self.rates
        return np.asarray(np.minimum(acceleration, np.sqrt(2 * self.limits.velocity * jerk)))

    @property
    def continuous_torque(self) -> bool:
        """Whether jumps of the torque are forbidden."""
        rated = self.jerk_limit is not None or self._preset_limits("torque_rate")
        return rated or any(constraint.continuous_torque for constraint in self.path_constraints)

    def _preset_limits(self, limit: str) -> bool:
        return self.preset is not None and self.preset.limit(limit) is not None

    @property
    def via_regions(self) -> Mapping[int, GoalPose]:
        """Via regions by their index among the via points, the index of the leg that ends there."""
        return {i: one for i, one in enumerate(self.via) if isinstance(one, GoalPose)}

    @property
    def fixed_poses(self) -> Array:
        """`poses` without those in via regions, which the motion need not meet, shape (fixed legs + 1, nv)."""
        return np.delete(self.poses, [1 + i for i in self.via_regions], axis=0)

    @property
    def x_start(self) -> Array:
        """Start state (q, v), shape (2 nv,)."""
        return np.concatenate([np.asarray(self.q_start), np.asarray(self.v_start)])

    @property
    def x_goal(self) -> Array:
        """Goal state (q, v), shape (2 nv,)."""
        return np.concatenate([np.asarray(self.q_goal), np.asarray(self.v_goal)])

    @property
    def ends(self) -> Array:
        """Start and goal state, (q, v) of each, shape (2, 2, nv)."""
        return np.stack([self.x_start, self.x_goal]).reshape(2, 2, -1)

    @property
    def from_rest_to_rest(self) -> bool:
        """Whether the motion begins and ends at rest."""
        n = self.robot.nv
        return not (np.any(self.x_start[n:]) or np.any(self.x_goal[n:]))

    @property
    def landing(self) -> float:
        """Largest goal error that counts as landed [rad or m]; from rest to rest at most a hundredth of the way."""
        way = float(np.max(np.abs(np.diff(self.poses, axis=0)))) if self.from_rest_to_rest else np.inf
        return min(LANDING, way / 100)  # with less an arm that does not move might land on a near goal

    @property
    def pays_effort(self) -> bool:
        """Whether the cost contains more than the duration."""
        return self.effort_weight > 0 or self.relative_effort_weight > 0

    def effort_weights(self) -> Array:
        """Weights of the squared torques in J, shape (nv,) [1/(N m)²]."""
        return self.effort_weight + self.relative_effort_weight / self.limits.actuators.scale**2

    def to_toml(self, folder: str | os.PathLike[str] | None = None) -> str:
        """The problem as a TOML file for `read_problem`; docs/problem_files.md.

        Args:
            folder: folder of the file: a robot's file inside the folder is referred to by name. Else the text of the
                robot's URDF or MJCF becomes part of the problem file; its meshes do not.

        Raises:
            SpecError: the robot was made from a Pinocchio model, or was changed by hand.
            ProblemError: a path constraint has no text, see `PathConstraint.option_text`; or the file is too large.
        """
        robot = robot_table(self.robot, None if folder is None else path_of(folder, "folder"))
        text = to_toml({"robot": robot, "problem": problem_table(self)})
        if (size := len(text.encode())) > MAX_BYTES:
            raise ProblemError(
                f"the problem file would have {size} bytes, and {MAX_BYTES} are read: write large meshes and point "
                "clouds as obstacles with a file of their own (docs/obstacles.md)"
            )
        return text

    def goal_error_of(self, motion: Trajectory) -> Array:
        """Error of a motion's last state (q, v) from the goal's, shape (2 nv,)."""
        expect(motion, Trajectory, "motion")
        return np.concatenate([motion.q[-1], motion.v[-1]]) - self.x_goal

    def variant(self, **changes: Any) -> Self:
        """The problem with some fields changed, without a second warning of a goal that cannot be held."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ArmdynWarning)
            return replace(self, **{**self.own_rates, **changes})

    @property
    def holding_deficit(self) -> HoldingDeficit | None:
        """The joint whose motor is the weakest for holding the arm at the goal; None: all motors hold the arm.

        Joints without a motor do not count: feedback balances them upright.
        """
        return next((one for one in self.weak_ends if one.pose == "goal"), None)

    @property
    def weak_ends(self) -> tuple[HoldingDeficit, ...]:
        """The joint whose motor is the weakest for holding the arm, at the start and at the goal, where it rests there.

        Brakes may hold the start; a motion then begins with a fall.
        """
        weak = ([one for one in self._deficits_at(pose) if one.motor and one.beyond] for pose in ("start", "goal"))
        return tuple(each[0] for each in weak if each)

    @property
    def unstable_ends(self) -> tuple[str, ...]:
        """Joints that drift from an end at which the arm should rest, apart from `holding_deficit`, in words.

        At the start: joints with too weak motors, which brakes hold until then. At both ends: joints without a motor,
        which fall unless feedback balances them.
        """
        drifting = [one for pose in ("start", "goal") for one in self._deficits_at(pose) if one.beyond]
        return tuple(one.words for one in drifting if one.pose == "start" or not one.motor)

    def _deficits_at(self, pose: str) -> list[HoldingDeficit]:
        """Joints that cannot hold the arm at an end where it rests, the weakest first."""
        q, v = self.ends[int(pose == "goal")]
        if self.kinematic or np.any(v):
            return []
        return holding_deficits(self.robot, self.limits, q, self.reserves.effort, pose)

    def holding_torque(self) -> Array:
        """Torque that holds the arm still at the goal [N m or N], shape (nv,)."""
        return self.robot.holding_torque(np.asarray(self.q_goal))

    def duration_bound(self) -> float:
        """Lower bound on the duration by the velocity limits [s]; 0 without such limits."""
        return float(np.sum(np.max(np.abs(np.diff(self.fixed_poses, axis=0)) / self.limits.velocity, axis=1)))

    def leg_bounds(self) -> Array:
        """Lower bounds on the legs' durations, from one of `poses` to the next [s], shape (legs,); 0 at via regions."""
        bounds = np.max(np.abs(np.diff(self.poses, axis=0)) / self.limits.velocity, axis=1)
        bounds[[leg for i in self.via_regions for leg in (i, i + 1)]] = 0.0
        return np.asarray(bounds)

    def _resolve_ends(self) -> None:
        """Check the states at both ends and store them as arrays; no velocity: at rest; no pose: no goal."""
        for name in ("q_start", "q_goal", "v_start", "v_goal"):
            given = getattr(self, name)
            if name == "q_goal" and self.goal_pose is not None:
                expect(self.goal_pose, GoalPose, "goal_pose", "GoalPose(frame, placement)")
                continue
            if name in ("q_start", "q_goal"):
                array = pose_given(self.robot, given, name)
            else:
                given = np.zeros(self.robot.nv) if given is None else given
                array = per_joint(given, self.robot.joint_names, name, error=ProblemError, scalar=False)
            self._set(**{name: array})

    def _resolve_path_constraints(self) -> None:
        """Check via points, obstacles and path constraints; store them as tuples and arrays."""
        self._set(via=self._resolved_via())
        obstacles = check_scene(several(self.obstacles, "obstacles"), self.clearance)
        self._set(obstacles=obstacles)
        for name in ("allowed_contacts", "end_contacts"):
            self._set(**{name: contacts(getattr(self, name), name, self.robot, obstacles)})
        rates = {"acceleration_limit": self.acceleration_limit, "jerk_limit": self.jerk_limit}
        kept = {name: rate_limit(own, name, self.robot, self.preset) for name, own in rates.items()}
        self._set(own_rates=rates, **kept)
        if self.kinematic:
            check_accelerations(self.robot, self._largest_acceleration)
        self._resolve_poses()
        if self.has_clearance:
            goals = clear_goals(self)
            self._set(goals=goals, q_goal=goals[0], poses=np.array([*self.poses[:-1], goals[0]]))
        path_constraints = check_path_constraints(self.path_constraints)
        bound = tuple(constraint.on(self.robot, self.x_start, self.x_goal) for constraint in path_constraints)
        self._set(path_constraints=bound)
        for constraint in bound:
            constraint.fits(self)

    def _resolved_via(self) -> tuple[Via, ...]:
        """Checked via points, as arrays and regions."""
        via = list[Via]()
        for i, one in enumerate(several(self.via, "via")):
            if isinstance(one, GoalPose):
                check_every_joint_has_motor(self.robot, self.limits, f"via[{i}] is a region")
            else:
                one = pose_given(self.robot, one, f"via[{i}]")
                check_state(self.robot, self.limits, one, np.zeros_like(one), f"via[{i}]", self.reserves.velocity)
                one.setflags(write=False)
            via.append(one)
        return tuple(via)

    def _resolve_poses(self) -> None:
        """Choose joint positions in via regions; store all poses as one array."""
        model = self.collision_model() if self.has_clearance and self.via_regions else None

        def is_clear(q: Array) -> bool:
            return model is None or not model.nearer(q, self.clearance)

        start, goal = np.asarray(self.q_start), np.asarray(self.q_goal)
        inner = via_positions(self.robot, self.limits, (start, goal), self.via, is_clear)
        self._set(poses=np.array([start, *inner, goal]))
        check_via_regions(self.robot, self.via, self.poses)
        check_poses(self.poses)

    def _resolve_limits(self) -> JointLimits:
        robot, kept = self.robot, Reserve.of(self.reserve, self.velocity_reserve, self.robot.joint_names)
        self._set(reserve=kept.effort, velocity_reserve=kept.velocity)
        limits = resolved_limits(robot, self.effort_limit, self.velocity_limit, self.position_limit, self.preset)
        self._set(passive=several(self.passive, "passive"))
        if self.kinematic:
            none = np.full(robot.nv, np.inf)
            limits = replace(limits, effort_lower=-none, effort_upper=none, actuators=ConstantTorque(-none, none))
            check_limits(robot, limits, torques=False)
            return kept.left(limits, robot.joint_names)
        limits = limits.without_motors(self.passive, robot.joint_names, ProblemError)
        check_motors(robot, limits, self.relative_effort_weight)
        check_limits(robot, limits)
        left = kept.left(limits, robot.joint_names)
        if kept.any:  # which may leave almost zero velocity
            check_limits(robot, left)
        return left


def expect_problem(problem: object) -> MinimumTimeProblem:
    """Check the argument `problem`.

    Raises:
        ProblemError: the argument is something else, such as a robot.
    """
    return expect(problem, MinimumTimeProblem, "problem", "pose it: MinimumTimeProblem(robot, q_start=…, q_goal=…)")
