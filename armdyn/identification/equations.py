"""Equations of an identification: regressor columns and known torques of a robot with unknown parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pinocchio as pin

from armdyn.arrays import Array
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.identification.log import Signals
from armdyn.identification.unknowns import Unknowns, parameters_of, prior_factor
from armdyn.locks import cached_property
from armdyn.models.robots.robot import Robot
from armdyn.models.values.spec import Payload

What = Literal["all", "payload", "friction"]
WHAT: tuple[What, ...] = ("all", "payload", "friction")

_STRUCTURAL = 1e-7
"""Singular value of the regressor's scaled columns at random states, as a part of the largest, below which a
combination is not identifiable."""
_PRIOR_PART = 0.1
"""Scales of parameters that the robot's file lacks: friction and offset as a part of the torques, armature of the
joints' inertia, a payload's mass of the arm's, and its radius of gyration of the arm's length."""


@dataclass(frozen=True, kw_only=True)
class Equations:
    """Torque = known + columns · unknowns, of a robot.

    Attributes:
        robot: the prior; of a payload, the arm without it.
        what: the unknowns: "all", "payload" or "friction".
        unknowns: their layout.
        width: of the smoothed jump of Coulomb friction [rad/s or m/s], one or shape (nv,).
        replaced: the robot's dynamic parameters of the unknown bodies, shape (bodies, 10).
        widest: the same unknowns with the prior's own width as their unit: 100 % of what the robot's file says; of what
            it lacks all that the logs allow (the joint's whole torque, a payload as far off as the arm is long).
    """

    robot: Robot
    what: What
    unknowns: Unknowns
    widest: Unknowns
    width: float | Array
    replaced: Array

    @classmethod
    def of(cls, robot: Robot, what: What, signals: list[Signals], width: float | Array) -> Equations:
        """The equations of a robot; the scales of unknown friction are those of the logs' torques."""
        torque, speed, acceleration = (
            np.sqrt(np.mean(np.concatenate([getattr(one, name) for one in signals]) ** 2, axis=0)) + least
            for name, least in (("tau", 1e-9), ("v", 1e-3), ("a", 1e-3))
        )
        damping, coulomb = robot.friction.per_joint(robot.nv)
        joints: tuple[int, ...] = ()
        factors, armature, replaced = np.zeros((0, 4, 4)), np.zeros(0), np.zeros((int(what == "payload"), 10))
        wide, rotor = factors, armature
        if what == "payload":
            given, at = robot.payload or Payload(mass=0), robot.frame_of(Payload(mass=0))
            centre = np.array(given.com) if given.frame is None else np.zeros(3)
            robot = robot.with_payload(None)
            mass = given.mass or _PRIOR_PART * sum(body.mass for body in list(robot.model.inertias)[1:])
            reach = sum(np.linalg.norm(place.translation) for place in list(robot.model.jointPlacements)[2:])
            radius = _PRIOR_PART * float(reach + np.linalg.norm(at.placement.translation))
            body = np.sqrt(mass) * np.diag([radius, radius, radius, 1.0])
            body[:3, 3] = np.sqrt(mass) * centre
            joints, factors = (at.parentJoint - 1,), (at.placement.homogeneous @ body)[None]
            far = body @ np.diag([1, 1, 1, _PRIOR_PART]) / _PRIOR_PART
            wide = factors if given.mass else (at.placement.homogeneous @ far)[None]
        elif what == "all":
            bare = robot.with_payload(None) if robot.payload is not None else robot
            joints = tuple(range(robot.nv))
            bodies = list(bare.model.inertias)[1:]
            factors, replaced = (
                np.array([of(body) for body in bodies]) for of in (prior_factor, pin.Inertia.toDynamicParameters)
            )
            moved = np.diag(pin.crba(robot.model, robot.model.createData(), robot.configuration(signals[0].q[0])))
            armature, rotor = (
                np.where(robot.model.armature > 0, robot.model.armature, unknown)
                for unknown in (_PRIOR_PART * moved, torque / acceleration)
            )
            wide = factors

        def unknowns(factors: Array, armature: Array, part: float) -> Unknowns:
            return Unknowns(
                joints=joints,
                factors=factors,
                armature=armature,
                damping=np.where(damping > 0, damping, part * torque / speed),
                coulomb=np.where(coulomb > 0, coulomb, part * torque),
                offset=part * torque,
            )

        return cls(
            robot=robot,
            what=what,
            unknowns=unknowns(factors, armature, _PRIOR_PART),
            widest=unknowns(wide, rotor, 1.0),
            width=width,
            replaced=replaced,
        )

    def at(self, q: Array, v: Array, a: Array, every: int) -> tuple[Array, Array]:
        """Columns, shape (m, nv, p), and known torques [N m or N], shape (m, nv): means over `every` samples."""
        return self.with_coulomb(means_of(np.tanh(v / self.width), every), *self.without_coulomb(q, v, a, every))

    def with_coulomb(self, sign: Array, columns: Array, known: Array) -> tuple[Array, Array]:
        """Columns and known torques with Coulomb friction, of those without, and the smoothed sign, shape (m, nv)."""
        joint = np.arange(self.robot.nv)
        columns, own = columns.copy(), self.unknowns.coulomb * sign
        columns[:, joint, self.unknowns.size - 2 * self.robot.nv + joint] = own
        return columns, known + own

    def without_coulomb(self, q: Array, v: Array, a: Array, every: int) -> tuple[Array, Array]:
        """Columns and known torques as of `at`, those of Coulomb friction zero: they alone depend on its width."""
        own, nv, joint = self.unknowns, self.robot.nv, np.arange(self.robot.nv)
        columns = np.zeros((len(q) // every, nv, own.size))
        known = means_of(rigid_torques(self.robot, q, v, a) + self.unknowns.damping * v, every)
        if own.joints:
            regressor = mean_regressor(self.robot, q, v, a, every)
            prior = parameters_of(own.bodies(np.zeros(own.size)))
            for b, (j, basis) in enumerate(zip(own.joints, own.basis(), strict=True)):
                part = regressor[:, :, 10 * j : 10 * j + 10]
                columns[:, :, 10 * b : 10 * b + 10] = part @ basis
                known += part @ (prior[b] - self.replaced[b])
        start = 10 * len(own.joints)
        if own.armature.size:
            mean = means_of(a, every)
            known += (own.armature - self.robot.model.armature) * mean
            columns[:, joint, start + joint] = own.armature * mean
            start += nv
        columns[:, joint, start + joint] = own.damping * means_of(v, every)
        columns[:, joint, start + 2 * nv + joint] = own.offset
        return columns, known

    def robot_at(self, x: Array) -> Robot:
        """The robot at the unknowns x, shape (p,), without the sensors' offsets."""
        armature, damping, coulomb, _ = self.unknowns.numbers(x)
        robot, bodies = self.robot, parameters_of(self.unknowns.bodies(x))
        if self.what == "payload":
            mass, centre, tensor = self.inertia(bodies[0])
            robot = robot.with_payload(Payload(mass=mass, com=centre, inertia=(tensor + tensor.T) / 2))
        elif self.what == "all":
            own = {joint: body.tolist() for joint, body in zip(robot.joint_names, bodies, strict=True)}
            robot = robot.with_inertias(own).with_armature(armature)
        return robot.with_friction(damping, coulomb, self.width)

    def inertia(self, parameters: Array) -> tuple[float, Array, Array]:
        """Mass, centre and inertia about it, of a body's parameters; of a payload in the tip's frame."""
        body = pin.Inertia.FromDynamicParameters(parameters)
        if self.what == "payload":
            body = self.robot.frame_of(Payload(mass=0)).placement.inverse().act(body)
        return float(body.mass), np.array(body.lever), np.array(body.inertia)

    @property
    def torque_limits(self) -> Array:
        """The joints' smaller limit of torque [N m or N], shape (nv,); 0: none."""
        ranges = self.robot.limits.actuators
        limits = np.minimum(np.abs(ranges.lower), np.abs(ranges.upper))
        return np.where(np.isfinite(limits), limits, 0.0)

    @cached_property
    def own_precision(self) -> Array:
        """Information of the prior by its own width, shape (p, p)."""
        units = self.unknowns.in_units_of(self.widest)
        return np.asarray(units.T @ units)

    @cached_property
    def structural_rank(self) -> int:
        """Number of identifiable combinations of the unknowns, from the regressor at random states."""
        rng, limits = np.random.default_rng(0), self.robot.limits
        count = 3 * self.unknowns.size // self.robot.nv + 10
        lower, upper = (np.clip(one, -np.pi, np.pi) for one in (limits.position_lower, limits.position_upper))
        q = rng.uniform(lower, upper, (count, self.robot.nv))
        v, a = (rng.normal(size=q.shape) * size for size in (1.0, 5.0))
        columns = self.at(q, v, a, every=1)[0].reshape(count * self.robot.nv, -1)
        columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
        values = np.linalg.svd(columns, compute_uv=False)
        return int(np.sum(values > _STRUCTURAL * values[0]))


def rigid_torques(robot: Robot, q: Array, v: Array, a: Array) -> Array:
    """Torques without friction [N m or N], shape (n, nv), rotors included.

    Args:
        robot: the arm.
        q: positions [rad or m], shape (n, nv).
        v: velocities [rad/s or m/s], shape (n, nv).
        a: accelerations [rad/s² or m/s²], shape (n, nv).
    """
    return inverse_dynamics(robot)(q, v, a) - robot.friction.torque(v)


def mean_regressor(robot: Robot, q: Array, v: Array, a: Array, every: int) -> Array:
    """Means of the torque regressor over runs of samples, shape (n // every, nv, 10 nv); else see `rigid_torques`."""
    model, data = robot.model, robot.model.createData()
    means = np.zeros((len(q) // every, robot.nv, 10 * robot.nv))
    for i in range(len(means) * every):
        means[i // every] += pin.computeJointTorqueRegressor(model, data, robot.configuration(q[i]), v[i], a[i])
    return means / every


def means_of(values: Array, every: int) -> Array:
    """Means over runs of samples, shape (n // every, …)."""
    whole = len(values) // every * every
    return np.asarray(values[:whole].reshape(-1, every, *values.shape[1:]).mean(axis=1))
