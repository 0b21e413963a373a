"""From an `ArmSpec` to a URDF."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree

import numpy as np

from armdyn.arguments import expect
from armdyn.errors import SpecError
from armdyn.models.values.spec import ArmSpec, LinkSpec, Payload

TIP = "tip"
POINT_INERTIA = 1e-12
"""Stands for zero in a point mass's tensor [kg m²]: positive definite, and without an effect on durations."""

_ZERO = (0.0, 0.0, 0.0)
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
    robot = ElementTree.Element("robot", name=spec.name)
    _add_base(robot)
    for i, link in enumerate(spec.links, start=1):
        _add_body(robot, link, f"link{i}")
    _add(robot, "link", name=TIP)
    load = payload if payload is not None and payload.mass > 0 else None
    frame = load.frame or TIP if load is not None else TIP
    if load is not None:
        links = [link.attrib["name"] for link in robot[1:]]
        if frame not in links:
            raise SpecError(f"no moving link {frame!r} in ArmSpec {spec.name!r} for the payload: {', '.join(links)}")
        _add_load(robot, load)
    parent, reach = "base", 0.0
    for i, link in enumerate(spec.links, start=1):
        joint = _add_joint(robot, f"joint{i}", "revolute", parent, f"link{i}", (_rounded(reach), 0.0, 0.0))
        _add(joint, "axis", xyz=(0.0, -1.0, 0.0))  # positive turns up
        most = spec.position_limit
        _add(joint, "limit", effort=spec.effort_limit, velocity=spec.velocity_limit, lower=-most, upper=most)
        parent, reach = f"link{i}", link.length
    _add_joint(robot, f"{TIP}_joint", "fixed", parent, TIP, (_rounded(reach), 0.0, 0.0))
    if load is not None:
        _add_joint(robot, "payload_joint", "fixed", frame, "payload", load.com)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode").replace(" />", "/>") + "\n"


def _add(parent: ElementTree.Element, tag: str, **attributes: str | float | tuple[float, ...]) -> ElementTree.Element:
    """Add an element; numbers with all their digits, and no -0.0."""

    def text(value: str | float | tuple[float, ...]) -> str:
        if isinstance(value, str):
            return value
        return " ".join(str(float(x) + 0.0) for x in (value if isinstance(value, tuple) else [value]))

    return ElementTree.SubElement(parent, tag, {name: text(value) for name, value in attributes.items()})


def _rounded(length: float) -> float:
    """A length without the digits that sums have got wrong [m]."""
    return float(np.round(length, 12))


def _add_joint(
    robot: ElementTree.Element, name: str, kind: str, parent: str, child: str, place: tuple[float, ...]
) -> ElementTree.Element:
    joint = _add(robot, "joint", name=name, type=kind)
    _add(joint, "parent", link=parent)
    _add(joint, "child", link=child)
    _add(joint, "origin", xyz=place, rpy=_ZERO)
    return joint


def _add_inertial(link: ElementTree.Element, com: tuple[float, ...], mass: float, tensor: np.ndarray) -> None:
    inertial = _add(link, "inertial")
    _add(inertial, "origin", xyz=com, rpy=_ZERO)
    _add(inertial, "mass", value=mass)
    upper = {f"i{'xyz'[i]}{'xyz'[j]}": tensor[i, j] for i in range(3) for j in range(i, 3)}
    _add(inertial, "inertia", **upper)


def _add_visual(
    link: ElementTree.Element,
    name: str,
    shape: tuple[str, Mapping[str, float | tuple[float, ...]]],
    xyz: tuple[float, ...] = _ZERO,
    rpy: tuple[float, ...] = _ZERO,
    color: str = "link1",
) -> None:
    visual = _add(link, "visual", name=name)
    _add(_add(visual, "geometry"), shape[0], **shape[1])
    _add(visual, "origin", xyz=xyz, rpy=rpy)
    _add(_add(visual, "material", name=color), "color", rgba=_COLORS.get(color, _COLORS["link1"]))


def _add_base(robot: ElementTree.Element) -> None:
    """The fixed link."""
    base = _add(robot, "link", name="base")
    _add_visual(base, "foot", ("cylinder", {"radius": 0.045, "length": 0.03}), (0.0, 0.0, -0.035), color="base")
    _add_visual(base, "post", ("box", {"size": (0.03, 0.05, 0.04)}), (0.0, 0.0, -0.01), color="base")


def _add_body(robot: ElementTree.Element, link: LinkSpec, name: str) -> None:
    """A rod and its joint's hub."""
    body = _add(robot, "link", name=name)
    # A rod about its own axis; across it the given inertia, in both directions.
    axial = min(0.5 * link.mass * _ROD_RADIUS**2, link.inertia)
    _add_inertial(body, (_rounded(link.com), 0.0, 0.0), link.mass, np.diag([axial, link.inertia, link.inertia]))
    rod = ("cylinder", {"radius": _ROD_RADIUS, "length": link.length})
    _add_visual(body, "rod", rod, (_rounded(link.length / 2), 0.0, 0.0), (0.0, np.pi / 2, 0.0), color=name)
    hub = ("cylinder", {"radius": _JOINT_RADIUS, "length": 0.042})
    _add_visual(body, "hub", hub, rpy=(np.pi / 2, 0.0, 0.0), color="joint")


def _add_load(robot: ElementTree.Element, payload: Payload) -> None:
    """The payload as a ball of its mass, unless it has shapes."""
    load = _add(robot, "link", name="payload")
    _add_inertial(load, _ZERO, payload.mass, positive_tensor(payload))
    if not payload.shapes:
        radius = float(np.cbrt(payload.mass / _DENSITY * 3 / (4 * np.pi)))
        _add_visual(load, "ball", ("sphere", {"radius": round(max(radius, 0.016), 4)}), color="payload")
