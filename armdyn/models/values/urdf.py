"""From an `ArmSpec` to a URDF."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import expect
from armdyn.errors import SpecError
from armdyn.models.values.spec import ArmSpec, LinkSpec, Payload

if TYPE_CHECKING:
    from lxml.etree import _Element

TIP = "tip"
POINT_INERTIA = 1e-12
"""Stands for zero in a point mass's tensor [kg m²]: positive definite, and without an effect on durations."""

_ROD_RADIUS = 0.012
_JOINT_RADIUS = 0.019
_NONE = (0.0, 0.0, 0.0)
"""No translation [m], or no rotation [rad]."""
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


def positive_tensor(payload: Payload) -> np.ndarray:
    """A payload's inertia about its centre of mass [kg m²], shape (3, 3), a point's made positive."""
    return np.asarray(payload.tensor + np.diag(np.maximum(POINT_INERTIA - np.diag(payload.tensor), 0.0)))


def urdf_from_spec(spec: ArmSpec, payload: Payload | None = None) -> str:
    """A URDF of a planar arm in the world's x-z plane, its payload on a fixed joint.

    The same input gives the same bytes.

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
    from lxml import etree

    robot = etree.Element("robot", name=spec.name)
    _add_base(robot)
    for i, link in enumerate(spec.links, start=1):
        _add_link(robot, link, f"link{i}")
    links = [f"link{i}" for i in range(1, len(spec.links) + 1)]
    _add(robot, "link", name=TIP)
    load = payload if payload is not None and payload.mass > 0 else None
    if load and (load.frame or TIP) not in (*links, TIP):
        there = ", ".join((*links, TIP))
        raise SpecError(f"no moving link {load.frame!r} in ArmSpec {spec.name!r} for the payload: {there}")
    if load:
        _add_load(robot, load)
    parent, reach = "base", 0.0
    for i, link in enumerate(spec.links, start=1):
        joint = _add_joint(robot, f"joint{i}", "revolute", (parent, f"link{i}"), np.round([reach, 0.0, 0.0], 12))
        _add(joint, "axis", xyz=(0.0, -1.0, 0.0))  # positive turns up
        bound = spec.position_limit
        _add(joint, "limit", effort=spec.effort_limit, velocity=spec.velocity_limit, lower=-bound, upper=bound)
        parent, reach = f"link{i}", link.length
    _add_joint(robot, f"{TIP}_joint", "fixed", (parent, TIP), np.round([reach, 0.0, 0.0], 12))
    if load:
        _add_joint(robot, "payload_joint", "fixed", (load.frame or TIP, "payload"), load.com)
    return str(etree.tostring(robot, pretty_print=True, encoding="unicode"))


def _text(value: ArrayLike) -> str:
    """An attribute's text: numbers in full, without negative zeros."""
    if isinstance(value, str):
        return value
    return " ".join(str(float(number) + 0.0) for number in np.ravel(value))


def _add(parent: _Element, tag: str, **attributes: ArrayLike) -> _Element:
    """Add an element with attributes."""
    from lxml import etree

    return etree.SubElement(parent, tag, {name: _text(value) for name, value in attributes.items()})


def _add_visual(
    link: _Element,
    names: tuple[str, str],
    shape: tuple[str, Mapping[str, ArrayLike]],
    xyz: tuple[float, float, float] = _NONE,
    rpy: tuple[float, float, float] = _NONE,
) -> None:
    """Add a visual; names: its own and its colour's."""
    name, color = names
    visual = _add(link, "visual", name=name)
    _add(_add(visual, "geometry"), shape[0], **shape[1])
    _add(visual, "origin", xyz=np.round(xyz, 12), rpy=rpy)
    _add(_add(visual, "material", name=color), "color", rgba=_COLORS[color if color in _COLORS else "link1"])


def _add_inertial(link: _Element, mass: float, inertia: np.ndarray, com: float = 0.0) -> None:
    inertial = _add(link, "inertial")
    _add(inertial, "origin", xyz=np.round([com, 0.0, 0.0], 12), rpy=_NONE)
    _add(inertial, "mass", value=mass)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
    _add(inertial, "inertia", ixx=xx, ixy=xy, ixz=xz, iyy=yy, iyz=yz, izz=zz)


def _add_joint(robot: _Element, name: str, kind: str, links: tuple[str, str], xyz: ArrayLike) -> _Element:
    """Add a joint; links: parent and child."""
    joint = _add(robot, "joint", name=name, type=kind)
    _add(joint, "parent", link=links[0])
    _add(joint, "child", link=links[1])
    _add(joint, "origin", xyz=xyz, rpy=_NONE)
    return joint


def _add_base(robot: _Element) -> None:
    """The fixed link."""
    base = _add(robot, "link", name="base")
    _add_visual(base, ("foot", "base"), ("cylinder", {"radius": 0.045, "length": 0.03}), (0.0, 0.0, -0.035))
    _add_visual(base, ("post", "base"), ("box", {"size": (0.03, 0.05, 0.04)}), (0.0, 0.0, -0.01))


def _add_link(robot: _Element, link: LinkSpec, name: str) -> None:
    """A rod and its joint's hub."""
    body = _add(robot, "link", name=name)
    # A rod about its own axis; across it the given inertia, in both directions.
    axial = min(0.5 * link.mass * _ROD_RADIUS**2, link.inertia)
    _add_inertial(body, link.mass, np.diag([axial, link.inertia, link.inertia]), link.com)
    rod = {"radius": _ROD_RADIUS, "length": link.length}
    _add_visual(body, ("rod", name), ("cylinder", rod), (link.length / 2, 0.0, 0.0), (0.0, np.pi / 2, 0.0))
    hub = {"radius": _JOINT_RADIUS, "length": 0.042}
    _add_visual(body, ("hub", "joint"), ("cylinder", hub), rpy=(np.pi / 2, 0.0, 0.0))


def _add_load(robot: _Element, payload: Payload) -> None:
    """The payload as a ball of its mass, unless it has shapes."""
    load = _add(robot, "link", name="payload")
    _add_inertial(load, payload.mass, positive_tensor(payload))
    if not payload.shapes:
        radius = float(np.cbrt(payload.mass / _DENSITY * 3 / (4 * np.pi)))
        _add_visual(load, ("ball", "payload"), ("sphere", {"radius": round(max(radius, 0.016), 4)}))
