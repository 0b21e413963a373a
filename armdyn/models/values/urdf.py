"""From an `ArmSpec` to a URDF, written by yourdfpy."""

from __future__ import annotations

import re
import sys
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from armdyn.arguments import expect
from armdyn.codegen.cache import stored
from armdyn.errors import SpecError
from armdyn.models.values.spec import ArmSpec, LinkSpec, Payload

if TYPE_CHECKING:
    import yourdfpy as yp

TIP = "tip"
POINT_INERTIA = 1e-12
"""Stands for zero in a point mass's tensor [kg m²]: positive definite, and without an effect on durations."""
_POINT_SIZE = 1e-9
"""Largest such moment over the mass [m²], for payloads of less than a gram."""

_ROD_RADIUS = 0.012
_JOINT_RADIUS = 0.019
_DENSITY = 2700.0  # [kg/m³], aluminium: how large a payload looks
_COLORS = {
    "base": (0.20, 0.22, 0.25, 1.0),
    "joint": (0.20, 0.22, 0.25, 1.0),
    "link1": (0.16, 0.44, 0.72, 1.0),
    "link2": (0.93, 0.54, 0.14, 1.0),
    "link3": (0.20, 0.62, 0.36, 1.0),
    "payload": (0.80, 0.15, 0.18, 1.0),
}


def urdf_file_name(spec: ArmSpec, payload: Payload | None = None) -> str:
    """Name of a generated file: rr.urdf, rr_100.6g.urdf."""
    load = f"_{1000 * payload.mass:g}g" if payload is not None and payload.mass > 0 else ""
    return f"{spec.name}{load}.urdf"


def _pose(x: float = 0.0, z: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> np.ndarray:
    pose = pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, 0.0), np.array([x, 0.0, z]))
    return np.asarray(np.round(pose.homogeneous, 12) + 0.0)  # no 6e-17 and no -0.0 in the file


def positive_tensor(payload: Payload) -> np.ndarray:
    """A payload's inertia about its centre of mass [kg m²], shape (3, 3); zero moments become small ones."""
    least = min(POINT_INERTIA, _POINT_SIZE * payload.mass)
    return np.asarray(payload.tensor + np.diag(np.maximum(least - np.diag(payload.tensor), 0.0)))


def urdf_from_spec(spec: ArmSpec, payload: Payload | None = None) -> str:
    """A URDF of a planar arm in the world's x-z plane, its payload on a fixed joint.

    The same input gives the same bytes. The first arm of a process may come from the cache folder: yourdfpy, which
    writes it, takes a quarter of a second to import.

    Args:
        spec: the arm.
        payload: at the tip, or at the link of `payload.frame`; None or zero mass: none.

    Returns:
        The URDF's text.

    Raises:
        SpecError: the payload is for a frame that is not there or does not move.
    """
    expect(spec, ArmSpec, "spec", 'such as ArmSpec.paper("rr")', error=SpecError)
    if payload is not None:
        expect(payload, Payload, "payload", "Payload(mass=…)", error=SpecError)
    if "yourdfpy" in sys.modules:
        return _written(spec, payload)
    load = payload and (payload.mass, tuple(payload.com), payload.tensor.tolist(), payload.frame, bool(payload.shapes))
    content = repr((Path(__file__).read_bytes(), version("yourdfpy"), asdict(spec), load)).encode()
    return stored("urdf", content, lambda: _written(spec, payload).encode()).decode()


def _written(spec: ArmSpec, payload: Payload | None) -> str:
    import yourdfpy as yp
    from lxml import etree

    robot = yp.Robot(name=spec.name)
    robot.links, robot.joints = [_base()], []
    parent, reach = "base", 0.0
    for i, link in enumerate(spec.links, start=1):
        robot.links.append(_body(link, f"link{i}"))
        limit = yp.Limit(
            effort=spec.effort_limit,
            velocity=spec.velocity_limit,
            lower=-spec.position_limit,
            upper=spec.position_limit,
        )
        turns = {"axis": np.array([0.0, -1.0, 0.0]), "limit": limit}  # positive turns up
        robot.joints.append(yp.Joint(f"joint{i}", "revolute", parent, f"link{i}", _pose(x=reach), **turns))
        parent, reach = f"link{i}", link.length
    robot.links.append(yp.Link(name=TIP))
    robot.joints.append(yp.Joint(f"{TIP}_joint", "fixed", parent, TIP, _pose(x=reach)))
    if payload is not None and payload.mass > 0:
        links = [link.name for link in robot.links[1:]]
        if (frame := payload.frame or TIP) not in links:
            raise SpecError(f"no moving link {frame!r} in ArmSpec {spec.name!r} for the payload: {', '.join(links)}")
        place = np.eye(4)
        place[:3, 3] = payload.com
        robot.links.append(_load(payload))
        robot.joints.append(yp.Joint("payload_joint", "fixed", frame, "payload", place))
    tree = yp.URDF(robot=robot, build_scene_graph=False, load_meshes=False).write_xml()
    text = etree.tostring(tree, pretty_print=True, encoding="unicode")
    return re.sub(r'(?<=[" ])-0\.0(?=[" ])', "0.0", text)


def _visual(name: str, origin: np.ndarray, color: str, **shape: object) -> yp.Visual:
    import yourdfpy as yp

    own = color if color in _COLORS else "link1"
    material = yp.Material(name=color, color=yp.Color(rgba=np.array(_COLORS[own])))
    return yp.Visual(name=name, origin=origin, geometry=yp.Geometry(**shape), material=material)


def _base() -> yp.Link:
    """The fixed link."""
    import yourdfpy as yp

    base = yp.Link(name="base")
    base.visuals = [
        _visual("foot", _pose(z=-0.035), "base", cylinder=yp.Cylinder(radius=0.045, length=0.03)),
        _visual("post", _pose(z=-0.01), "base", box=yp.Box(size=np.array([0.03, 0.05, 0.04]))),
    ]
    return base


def _body(link: LinkSpec, name: str) -> yp.Link:
    """A rod and its joint's hub."""
    import yourdfpy as yp

    # A rod about its own axis; across it the given inertia, in both directions.
    axial = min(0.5 * link.mass * _ROD_RADIUS**2, link.inertia)
    inertia = np.diag([axial, link.inertia, link.inertia])
    body = yp.Link(name=name, inertial=yp.Inertial(origin=_pose(x=link.com), mass=link.mass, inertia=inertia))
    rod = yp.Cylinder(radius=_ROD_RADIUS, length=link.length)
    hub = yp.Cylinder(radius=_JOINT_RADIUS, length=0.042)
    body.visuals = [
        _visual("rod", _pose(x=link.length / 2, pitch=np.pi / 2), name, cylinder=rod),
        _visual("hub", _pose(roll=np.pi / 2), "joint", cylinder=hub),
    ]
    return body


def _load(payload: Payload) -> yp.Link:
    """The payload as a ball of its mass, unless it has shapes."""
    import yourdfpy as yp

    own = yp.Inertial(origin=np.eye(4), mass=payload.mass, inertia=positive_tensor(payload))
    load = yp.Link(name="payload", inertial=own)
    radius = float(np.cbrt(payload.mass / _DENSITY * 3 / (4 * np.pi)))
    load.visuals = (
        []
        if payload.shapes
        else [_visual("ball", np.eye(4), "payload", sphere=yp.Sphere(radius=round(max(radius, 0.016), 4)))]
    )
    return load
