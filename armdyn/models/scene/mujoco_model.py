"""MuJoCo's model of an arm as armdyn moves it: the same bodies, locked joints, friction and payload."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from armdyn.arguments import expect, flag
from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.models.reading.nearest_inertia import nearest_physical
from armdyn.models.reading.urdf_check import POINT_MASS
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.scene.bodies import Body, bodies, sizes_of
from armdyn.reprs import joints_of
from armdyn.trajectory.formats.mujoco import Mujoco, xml_name
from armdyn.trajectory.samples import Samples

_LEAST_MASS = 1e-9
"""Mass that a moving body without one gets [kg]: MuJoCo refuses zero."""

_FEEDBACK = 20.0
"""Natural frequency of the feedback of a joint by itself [rad/s], critically damped: above the 8 rad/s at which the
least stable motions of nine library arms diverge; up to 100 their errors at the end hardly differ."""

_INERTIAS = 50
"""Samples of a motion at which the joints' inertias are looked up for the gains of the feedback."""


def mujoco_model(
    robot: Robot,
    samples: Samples | None = None,
    *,
    geometry: bool = True,
    motors: bool = True,
    feedback: bool = True,
) -> str:
    """MuJoCo's XML of an arm, complete in one file: bodies, joints, motors, keyframes, convex geometry.

    Locked joints are welded, tool and payload are in the bodies, damping and dry friction are those of the robot, not
    those of its file. Dry friction is MuJoCo's `frictionloss`, which has no width. Geometry touches nothing. Inertias
    that a file rounds to just beyond physical are the nearest physical ones, as MuJoCo refuses others.

    Args:
        robot: the arm.
        samples: a motion, whose stamps become keyframes with its torques as ctrl; None: no keyframes.
        geometry: write the solids of the arm, convex parts of its meshes with their vertices; False: none.
        motors: write a motor of unit gear per joint.
        feedback: write servos of position and velocity, too, which hold the played motion on the planned one. Their
            targets are activations, whose rates over the step follow the torques in ctrl. False: torques alone, open
            loop. Without motors, or without a motion, there are none.

    Raises:
        ProblemError: the motion has other joints, or the arm lacks requested geometry.
        TrajectoryError: a name has characters that XML cannot have.
        UrdfError: the arm's inertias are unknown, see `Robot.expect_dynamics`.
    """
    expect_robot(robot).expect_dynamics()
    model = robot.model
    solids = _solids(robot) if flag(geometry, "geometry") else ()
    root = Element("mujoco", model=xml_name(robot.name))
    SubElement(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false", balanceinertia="false")
    SubElement(root, "option", gravity=_words(model.gravity.linear), integrator="RK4", timestep="0.0005")
    asset, world = SubElement(root, "asset"), SubElement(root, "worldbody")
    places = {0: world}
    for joint in range(1, model.njoints):
        places[joint] = _body(places[int(model.parents[joint])], robot, joint)
    for k, solid in enumerate(solids):
        _geometry(places[solid.joint], asset, f"part{k}", solid)
    tip = robot.frame(robot.tip)
    SubElement(places[int(tip.parentJoint)], "site", {"name": xml_name(robot.tip), **_pose(tip.placement.homogeneous)})
    actuators = SubElement(root, "actuator")
    if flag(motors, "motors"):
        for name, ends in zip(robot.joint_names, _torque_ranges(robot), strict=True):
            limited = {} if ends is None else {"ctrlrange": _words(ends)}
            SubElement(actuators, "motor", {"name": xml_name(name), "joint": xml_name(name), **limited})
    if samples is not None:
        if expect(samples, Samples, "samples", "motion.resample(1000)").q.shape[1] != robot.nv:
            raise ProblemError(f"the motion has {joints_of(samples.q.shape[1])}; {robot.name} has {robot.nv}")
        targets = _servos(actuators, robot, samples) if flag(feedback, "feedback") and motors else None
        root.append(_keyframes(samples, motors, targets))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _torque_ranges(robot: Robot) -> list[Array | None]:
    """Least and largest torque of each joint [N m or N]; None: MuJoCo has no such range."""
    ends = np.column_stack([robot.limits.effort_lower, robot.limits.effort_upper])
    return [row if np.all(np.isfinite(row)) and row[0] < row[1] else None for row in ends]


def _servos(actuators: Element, robot: Robot, samples: Samples) -> Array:
    """Write servos of position, then of velocity; return their targets at every sample, shape (n, 2 nv).

    Targets move evenly within a step. Where a torque is on its limit, errors from targets that are held would be cut
    off on one side: a planar RRR arm ended 8e-3 rad off at 4 kHz, instead of 8e-5.
    """
    some = samples.q[np.unique(np.linspace(0, len(samples.q) - 1, _INERTIAS).astype(int))]
    data = robot.model.createData()
    inertia = np.max([np.diag(pin.crba(robot.model, data, robot.configuration(q))) for q in some], axis=0)
    kinds = (("position", inertia * _FEEDBACK**2, "0 -{} 0"), ("velocity", 2 * inertia * _FEEDBACK, "0 0 -{}"))
    for kind, gains, bias in kinds:
        for joint, gain in zip(map(xml_name, robot.joint_names), gains, strict=True):
            servo = {"name": f"{joint} {kind}", "joint": joint, "dyntype": "integrator", "biastype": "affine"}
            SubElement(actuators, "general", servo, gainprm=_words([gain]), biasprm=bias.format(_words([gain])))
    return np.hstack([samples.q, samples.v])


def _keyframes(samples: Samples, motors: bool, targets: Array | None) -> Element:
    """Keyframes of samples; ctrl has the torques, then the rates of servos' targets; without motors there is none."""
    keys = ElementTree.fromstring(Mujoco(motors=False).text(samples)).find("keyframe")  # noqa: S314  # our own text
    assert keys is not None  # noqa: S101  # `Mujoco` writes it
    for k, key in enumerate(keys):
        if not motors:
            del key.attrib["ctrl"]
        elif targets is not None:
            after = min(k + 1, len(targets) - 1)
            rates = (targets[after] - targets[k]) / (samples.t[after] - samples.t[k] or 1.0)
            key.set("ctrl", f"{key.get('ctrl')} {_words(rates)}")
            key.set("act", _words(targets[k]))
    return keys


def _body(parent: Element, robot: Robot, joint: int) -> Element:
    """The body that a joint moves, with its joint and inertia."""
    model, i = robot.model, joint - 1
    name, inertia = xml_name(str(model.names[joint])), model.inertias[joint]
    body = SubElement(parent, "body", {"name": name, **_pose(model.jointPlacements[joint].homogeneous)})
    subspace = np.ravel(model.joints[joint].createData().S)
    damping, coulomb = robot.friction.per_joint(robot.nv)
    ends = np.array([robot.limits.position_lower[i], robot.limits.position_upper[i]])
    numbers: dict[str, Array] = {
        "axis": subspace[:3] if robot.slides[i] else subspace[3:],
        "damping": damping[i : i + 1],
        "frictionloss": coulomb[i : i + 1],
        "armature": np.array([model.armature[i]]),
    }
    if np.all(np.isfinite(ends)):
        numbers["range"] = ends
    if (torques := _torque_ranges(robot)[i]) is not None:
        numbers["actuatorfrcrange"] = torques
    written = {key: _words(values) for key, values in numbers.items()}
    SubElement(body, "joint", {"name": name, "type": "slide" if robot.slides[i] else "hinge", **written})
    tensor = np.array(inertia.inertia)
    if np.max(np.abs(tensor)) >= POINT_MASS and inertia.mass > 0:
        tensor = nearest_physical(inertia.mass, tensor, thinnest=0.0)
    tensor = tensor + POINT_MASS * np.eye(3)
    full = [*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]]
    mass = _words([max(inertia.mass, _LEAST_MASS)])
    SubElement(body, "inertial", pos=_words(inertia.lever), mass=mass, fullinertia=_words(full))
    return body


def _solids(robot: Robot) -> tuple[Body, ...]:
    """Solids of the arm.

    Raises:
        ProblemError: it has none; the message names the option that does without.
    """
    try:
        return bodies(robot)
    except ProblemError as error:
        raise ProblemError(f"{error}; with `geometry` False the model has none") from None


def _geometry(body: Element, asset: Element, name: str, solid: Body) -> None:
    """A solid that only shows; a mesh has its vertices in the file, and MuJoCo takes their convex hull."""
    kind, sizes = sizes_of(solid.geometry)
    what = {"type": kind, "size": _words(sizes.ravel())}
    if kind == "convex":
        SubElement(asset, "mesh", name=name, vertex=_words(sizes.ravel(), digits=6))
        what = {"type": "mesh", "mesh": name}
    SubElement(body, "geom", {**what, **_pose(solid.placement), "contype": "0", "conaffinity": "0", "group": "2"})


def _pose(placement: Array) -> dict[str, str]:
    """Position and quaternion, w first, of a placement, shape (4, 4)."""
    x, y, z, w = pin.Quaternion(placement[:3, :3]).coeffs()
    return {"pos": _words(placement[:3, 3]), "quat": _words([w, x, y, z])}


def _words(values: Iterable[float], digits: int = 17) -> str:
    return " ".join(f"{float(value):.{digits}g}" for value in values)
