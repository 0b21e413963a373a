"""Pinocchio's dynamics as CasADi Functions."""

from __future__ import annotations

import hashlib
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from armdyn.arguments import expect, flag, numbers
from armdyn.arrays import Array
from armdyn.errors import BridgeError, SpecError
from armdyn.locks import built_once, cached_property
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.robots.tree import Tree

_CASADI = (ca.SX, ca.MX, ca.DM)

Value = Any
"""A numpy array, list or number, or a casadi DM, SX or MX: results are of the type of the arguments."""


class Dynamics:
    """Equations of motion D(q) a + C(q, v) v + g(q) + tau_f(v) = tau, from Pinocchio's own templated algorithms.

    tau_f is the friction in the robot's joints, see `JointFriction`: none unless the robot has some.

    Every method takes numpy arrays, and returns one, or casadi DM, SX or MX, and returns that.
    Joint coordinates throughout: q has one number per joint, also for continuous joints.
    Two are equal if their Functions are: a dictionary or a cache may have them as keys.

    Attributes:
        robot: the arm.
        nv: number of joints.
        payload_frame: the frame that carries the symbolic payload, or None.
        last_body: dynamic parameters of the last joint's body, shape (10,), where they are an argument; else (0,).
    """

    def __init__(self, robot: Robot, payload_frame: str | None = None, free_last_body: bool = False):
        """Equations of a robot; they are built when they are first used.

        Args:
            robot: an arm.
            payload_frame: with a frame's name every method takes one more argument, the ten dynamic
                parameters (see `payload_parameters`) of a body fixed to that frame's joint.
            free_last_body: every method takes one more argument, the ten dynamic parameters of everything
                the last joint carries (the robot's own are in `last_body`; zeros there stay zero).
                The same Functions then serve every payload at the tip.

        Raises:
            ProblemError: robot is no Robot.
            UrdfError: its torques are unknown, see `Robot.expect_dynamics`.
            SpecError: no such frame, or it does not move; or both of the above.
        """
        self.robot = expect_robot(robot)
        robot.expect_dynamics()
        self.nv = robot.nv
        self.payload_frame = payload_frame
        self.last_body = np.empty(0)
        joint = -1
        free_last_body = flag(free_last_body, "free_last_body")
        if payload_frame is not None:
            if free_last_body:
                raise SpecError("Dynamics take payload_frame or free_last_body, not both")
            joint = robot.frame(payload_frame).parentJoint - 1
            if joint < 0:
                raise SpecError(f"frame {payload_frame!r} of {robot.source} does not move")
        if free_last_body:
            joint = robot.nv - 1
            self.last_body = np.array(robot.model.inertias[robot.model.njoints - 1].toDynamicParameters())
        self._tree = (Tree.of(robot.model, joint, without_body=free_last_body), joint)
        friction = robot.friction
        rows = (*friction.per_joint(self.nv), np.broadcast_to(friction.width, self.nv)) if friction.present else ()
        self._friction = tuple(row.tobytes() for row in rows)
        present = tuple((self.last_body != 0).tolist())
        data = repr((self._tree, self._friction, present, ca.CasadiMeta.version())).encode()
        self._digest = hashlib.sha256(data).hexdigest()

    @cached_property
    def functions(self) -> dict[str, ca.Function]:
        """The casadi Functions by name, built or from a cache: 5 s of an arm of 80 joints.

        Raises:
            BridgeError: the installed casadi is not the one the bridge was built for.
        """
        return _with_friction(self._tree, *self._friction) if self._friction else _functions(*self._tree)

    def aba(self, q: Value, v: Value, tau: Value, *payload: Value) -> Any:
        """Acceleration a [rad/s²], shape (nv,), of torque tau [N m]: the articulated-body algorithm."""
        return self._call("aba", q, v, tau, *payload)

    def rnea(self, q: Value, v: Value, a: Value, *payload: Value) -> Any:
        """Torque tau [N m], shape (nv,), of acceleration a [rad/s²]: recursive Newton-Euler."""
        return self._call("rnea", q, v, a, *payload)

    def crba(self, q: Value, *payload: Value) -> Any:
        """Joint-space inertia D(q) [kg m²], shape (nv, nv), both triangles filled."""
        return self._call("crba", q, *payload)

    def nle(self, q: Value, v: Value, *payload: Value) -> Any:
        """Coriolis, centrifugal, gravity and friction torque C(q, v) v + g(q) + tau_f(v) [N m], shape (nv,)."""
        return self._call("nle", q, v, *payload)

    def gravity(self, q: Value, *payload: Value) -> Any:
        """Gravity torque g(q) [N m], shape (nv,): it holds the arm still."""
        return self._call("gravity", q, *payload)

    def kinetic_energy(self, q: Value, v: Value, *payload: Value) -> Any:
        """½ vᵀ D(q) v [J], without the armature's share."""
        return self._call("kinetic_energy", q, v, *payload)

    def potential_energy(self, q: Value, *payload: Value) -> Any:
        """Potential energy in gravity [J], zero with all mass at the world's origin."""
        return self._call("potential_energy", q, *payload)

    def frame_placement(self, q: Value, frame: str) -> tuple[Any, Any]:
        """Rotation, shape (3, 3), and origin [m], shape (3,), of a frame in the world.

        Raises:
            SpecError: no such frame.
        """
        fixed = self.robot.frame(frame)
        rotation, origin = fixed.placement.rotation.copy(), fixed.placement.translation.copy()
        j = fixed.parentJoint - 1
        if isinstance(q, _CASADI):
            rotation, origin = type(q)(rotation), type(q)(origin)
        if j < 0:
            return rotation, origin
        all_joints = self.placements(q)
        R, p = all_joints[:, 4 * j : 4 * j + 3], all_joints[:, 4 * j + 3]
        return R @ rotation, R @ origin + p

    def placements(self, q: Value) -> Any:
        """Rotation and origin [m] of every joint's frame in the world, side by side, shape (3, 4 nv)."""
        takes_body = self.payload_frame is not None or self.last_body.size > 0
        return self._call("placements", q, *((np.zeros(10),) if takes_body else ()))

    def payload_parameters(self, inertia: pin.Inertia) -> np.ndarray:
        """The ten numbers that the payload argument takes, shape (10,).

        Args:
            inertia: of the payload, in `payload_frame`.

        Returns:
            m [kg], m c [kg m], and Ixx, Ixy, Iyy, Ixz, Iyz, Izz [kg m²] about the joint's origin.
        """
        if self.payload_frame is None:
            raise SpecError("these Dynamics have no symbolic payload; give payload_frame")
        frame = self.robot.frame(self.payload_frame)
        expect(inertia, pin.Inertia, "inertia", error=SpecError)
        return np.array(frame.placement.act(inertia).toDynamicParameters())

    def along(self, name: str, *rows: Array) -> Array:
        """A Function of vectors at many states in one call.

        Args:
            name: of the Function: "aba", "rnea", "nle" or "gravity".
            rows: its arguments in their order, each of shape (n, nv).

        Returns:
            Shape (n, nv): row k is of the arguments' rows k.
        """
        return np.array(self.functions[name](*(np.asarray(one).T for one in rows)), dtype=float).T

    def digest(self) -> str:
        """A hash of everything that the Functions depend on."""
        return self._digest

    def __hash__(self) -> int:
        return hash(self._digest)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Dynamics) and self._digest == other._digest

    def _call(self, name: str, *arguments: Value) -> Any:
        function = self.functions[name]
        if len(arguments) != function.n_in():
            raise SpecError(f"{name} takes {', '.join(function.name_in())}; got {len(arguments)} arguments")
        if any(isinstance(x, _CASADI) for x in arguments):
            return function(*arguments)
        given = [_vector(x, f"{name}: {key}") for x, key in zip(arguments, function.name_in(), strict=True)]
        for x, key in zip(given, function.name_in(), strict=True):
            if x.size != function.numel_in(key):
                raise SpecError(f"{name}: {key} has {x.size} numbers; expected {function.numel_in(key)}")
        out = np.array(function(*given), dtype=float)
        if name.endswith("energy"):
            return float(out.item())
        return out if name in ("crba", "placements") else out.reshape(-1)


def _vector(value: Value, name: str) -> Array:
    """Numbers as one row; arrays of floats, as inner loops pass, are not checked."""
    known = isinstance(value, np.ndarray) and value.dtype == float
    return np.ravel(value if known else numbers(value, name, error=SpecError))


def bridge_versions() -> str:
    """Versions that the compiled bridge was built with, in words."""
    import _armdyn_bridge as bridge

    return f"casadi {bridge.casadi_version}, pinocchio {bridge.pinocchio_version}"


@built_once(maxsize=64)
def _functions(tree: Tree, payload_joint: int) -> dict[str, ca.Function]:
    import _armdyn_bridge as bridge

    built, here = bridge.casadi_version, ca.CasadiMeta.version()
    if built.split(".")[:2] != here.split(".")[:2]:
        raise BridgeError(
            f"armdyn's bridge was built with casadi {built} but casadi {here} is installed; "
            f"serialized Functions fit one minor version only: reinstall armdyn, or casadi~={built}"
        )
    serialized = bridge.build(**tree.arguments(), payload_joint=payload_joint)
    return {name: ca.Function.deserialize(text) for name, text in serialized.items()}


@built_once(maxsize=64)
def _with_friction(tree: tuple[Tree, int], damping: bytes, coulomb: bytes, width: bytes) -> dict[str, ca.Function]:
    """Dynamics of a tree with joint friction damping v + coulomb tanh(v / width)."""
    smooth = dict(_functions(*tree))
    viscous, dry, over = (ca.DM(np.frombuffer(data)) for data in (damping, coulomb, width))
    for name in ("aba", "rnea", "nle"):
        function = smooth[name]
        names = function.name_in()
        given = [ca.SX.sym(each, function.sparsity_in(i)) for i, each in enumerate(names)]
        q, v = given[:2]
        lost = viscous * v + dry * ca.tanh(v / over)
        out = function(q, v, given[2] - lost, *given[3:]) if name == "aba" else function(*given) + lost
        smooth[name] = ca.Function(name, given, [out], names, function.name_out())
    return smooth
