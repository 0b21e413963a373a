"""An MJCF reduced to the elements that dynamics need: Pinocchio reads nothing that was not checked here."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from armdyn.errors import UnsupportedJointError, UrdfError
from armdyn.models.mjcf.attributes import ROTATIONS, Classes, Compiler, Values, place
from armdyn.models.reading.urdf_check import MAX_LINKS, MAX_MOVING
from armdyn.models.reading.urdf_xml import clipped

WORLD = "world"
"""MuJoCo's name of the fixed body."""

_JOINTS = ("hinge", "slide", "ball", "free")
_WIDTHS = {"ball": 4, "free": 7}
"""Numbers of qpos that a joint has if not one."""
_SOLIDS = {"sphere": 1, "capsule": 2, "ellipsoid": 3, "cylinder": 2, "box": 3}
"""Shapes whose inertia Pinocchio computes, and their numbers of sizes."""
_MASSLESS = ("plane", "hfield")
_MESHES = ("mesh", "sdf")
_MACROS = ("frame", "replicate", "composite", "flexcomp", "attach")


@dataclass
class Bare:
    """Rewrites the bodies of an MJCF for Pinocchio, with every default class resolved.

    Attributes:
        classes: of the MJCF.
        compiler: its settings of `<compiler>`.
        fixed: free joints that stand still where their body is; None: all of them do.
        joints: name to attributes of every joint written.
        free: the free joints that stand still.
        widths: count of MuJoCo's qpos numbers of each joint, locked ones included, in qpos' order.
        new_names: of bodies, joints and sites, each kind apart: from their names to the written ones, since pin 4.1
            crashes at some names, such as "universe".
    """

    classes: Classes
    compiler: Compiler
    fixed: Set[str] | None
    joints: dict[str, Values] = field(default_factory=dict)
    free: set[str] = field(default_factory=set)
    widths: dict[str, int] = field(default_factory=dict)
    new_names: dict[str, dict[str, str]] = field(default_factory=dict)

    def text(self, root: Element) -> str:
        """The MJCF that Pinocchio is given.

        Args:
            root: of the whole MJCF.

        Raises:
            UnsupportedJointError: a joint is free.
            UrdfError: a body, a joint or a geometry makes no sense, with its name and the remedy.
        """
        bare = Element("mujoco", model="arm")
        SubElement(bare, "compiler", angle="radian")
        top = SubElement(SubElement(bare, "worldbody"), "body", name=self._named("body", WORLD))
        for world in root.findall("worldbody"):
            for body in self._child_bodies(world, WORLD):
                self._body(body, top, world.get("childclass"), moves=False)
        return ElementTree.tostring(bare, encoding="unicode")

    def _child_bodies(self, parent: Element, name: str) -> list[Element]:
        """Elements of the bodies directly inside a body; refuses MuJoCo's macros."""
        for macro in _MACROS:
            if parent.find(macro) is not None:
                what = f"has a <{macro}>, which MuJoCo's compiler expands; save the compiled model and give that"
                raise UrdfError(self.classes.source, what, f"body {clipped(name)!r}")
        return parent.findall("body")

    def _named(self, kind: str, name: str) -> str:
        """New name of an element; its own name must be new among its kind."""
        taken = self.new_names.setdefault(kind, {})
        if name in taken:
            raise UrdfError(self.classes.source, "is defined twice", f"{kind} {clipped(name)!r}")
        if len(taken) == MAX_LINKS:
            many = "bodies" if kind == "body" else f"{kind}s"
            raise UrdfError(self.classes.source, f"has more than {MAX_LINKS} {many}")
        taken[name] = f"{kind}{len(taken)}"
        return taken[name]

    def _body(self, body: Element, to: Element, inherited: str | None, moves: bool) -> None:
        """Write a body, its joints and all bodies below it; a body with several joints becomes that many bodies."""
        name = body.get("name") or f"(body {len(self.new_names['body'])})"
        written = self._named("body", name)
        values = Values(body.attrib, self.classes.source, f"body {clipped(name)!r}")
        inherited = body.get("childclass") or inherited
        joints = self._joints(body, name, inherited)
        copy = SubElement(to, "body", name=written)
        place(values, self.compiler, copy)
        for i, joint in enumerate(joints):
            if i:  # at zero both are in one place
                copy = SubElement(copy, "body", name=written)
            if i < len(joints) - 1:
                copy.set("name", self._named("body", f"{name} ({i + 1} of {len(joints)})"))
            copy.append(joint)
        moves = moves or bool(joints)
        inertial = body.find("inertial")
        if inertial is not None and self.compiler.inertia_from != "true":
            self._inertial(inertial, copy, values.where)
        elif moves:
            if self.compiler.inertia_from == "false" or self.compiler.least_mass + self.compiler.least_inertia:
                raise values.error(
                    "has no <inertial>, which inertiafromgeom, boundmass or boundinertia of <compiler> calls for"
                )
            for geom in body.findall("geom"):
                self._geom(geom, copy, inherited, values.where)
        for site in body.findall("site"):
            if called := site.get("name"):
                own = Values(self.classes.attributes(site, inherited), self.classes.source, f"site {clipped(called)!r}")
                place(own, self.compiler, SubElement(copy, "site", name=self._named("site", called)))
        for inside in self._child_bodies(body, name):
            self._body(inside, copy, inherited, moves)

    def _joints(self, body: Element, name: str, inherited: str | None) -> list[Element]:
        written: list[Element] = []
        for joint in body:
            if joint.tag not in ("joint", "freejoint"):
                continue
            free = joint.tag == "freejoint"
            given = joint.attrib | {"type": "free"} if free else self.classes.attributes(joint, inherited)
            called = given.get("name") or f"{name}_joint{len(written) or ''}"
            values = Values(given, self.classes.source, f"joint {clipped(called)!r}")
            kind = values.word("type", _JOINTS)
            self.widths[called] = _WIDTHS.get(kind, 1)
            if kind == "free":
                if self.fixed is None or called in self.fixed:
                    self.free.add(called)
                    continue
                what = "is free; armdyn supports arms on a fixed base: lock it, at 0, to let its body stand where it is"
                raise UnsupportedJointError(self.classes.source, what, values.where)
            self.joints[called] = values
            if len(self.joints) > MAX_MOVING:
                raise UrdfError(self.classes.source, f"has more than {MAX_MOVING} joints that move")
            written.append(self._joint(values, self._named("joint", called)))
        return written

    def _joint(self, values: Values, written: str) -> Element:
        joint = Element("joint", name=written, type=values.word("type", _JOINTS))
        values.copy(joint, "pos", 3)
        if joint.get("type") == "ball":
            return joint
        axis = values.copy(joint, "axis", 3)
        if axis and not 1e-6 < np.linalg.norm(axis) < 1e6:
            raise values.error(f"axis is {axis}; its length should be 1")
        if pair := values.bounds("range", "limited", self.compiler.automatic):
            unit = self.compiler.radians if joint.get("type") == "hinge" else 1.0
            joint.set("range", " ".join(repr(unit * bound) for bound in pair))
        for key in ("damping", "frictionloss", "armature"):
            joint.set(key, repr(values.positive(key)))
        return joint

    def _inertial(self, inertial: Element, to: Element, where: str) -> None:
        values = Values(inertial.attrib, self.classes.source, where)
        if "mass" not in values.given or not {"diaginertia", "fullinertia"} & values.given.keys():
            raise values.error("<inertial> needs a mass, and diaginertia or fullinertia")
        if "fullinertia" in values.given and ROTATIONS.keys() & values.given.keys():
            raise values.error("<inertial> has a fullinertia and is turned; one is enough")
        least = self.compiler.least_inertia
        copy = SubElement(to, "inertial", mass=repr(max(values.positive("mass"), self.compiler.least_mass)))
        place(values, self.compiler, copy)
        if full := values.numbers("fullinertia", 6):
            xx, yy, zz, xy, xz, yz = full
            moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            if least > moments[0]:
                tensor = axes @ np.diag(np.maximum(moments, least)) @ axes.T
                full = [*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]]
            copy.set("fullinertia", " ".join(repr(float(x)) for x in full))
        else:
            diagonal = values.numbers("diaginertia", 3)
            copy.set("diaginertia", " ".join(repr(max(x, least)) for x in diagonal))

    def _geom(self, geom: Element, to: Element, inherited: str | None, where: str) -> None:
        """Write a shape that gives its body an inertia."""
        values = Values(self.classes.attributes(geom, inherited), self.classes.source, where)
        kind = values.word("type", ("sphere", *_SOLIDS, *_MASSLESS, *_MESHES))
        first, last = self.compiler.groups
        weightless = values.number("mass", values.number("density", 1.0)) == 0
        if kind in _MASSLESS or weightless or not first <= values.number("group", 0.0) <= last:
            return
        if kind in _MESHES or "mesh" in values.given or values.given.get("shellinertia") == "true":
            raise values.error("its inertia would come from a mesh or a shell: give it an <inertial>")
        copy = SubElement(to, "geom", type=kind)
        ends = values.copy(copy, "fromto", 6)
        sizes = values.copy(copy, "size", 1, 3)
        if len(sizes) < _SOLIDS[kind] - bool(ends) or min(sizes) <= 0:
            raise values.error(f"a {kind} needs {_SOLIDS[kind]} positive sizes")
        if ends and (kind == "sphere" or np.linalg.norm(np.subtract(ends[3:], ends[:3])) < 1e-9):
            raise values.error(f"fromto of a {kind} is no direction")
        if not ends:
            place(values, self.compiler, copy)
        if key := next((key for key in ("mass", "density") if key in values.given), None):
            copy.set(key, repr(values.positive(key)))


def check_moving(joints: Mapping[str, Values], moving: Sequence[str], root: Element, source: str) -> None:
    """Refuse moving joints with springs, offset zeros or couplings.

    Args:
        joints: of `Bare`.
        moving: names of those that are not locked.
        root: of the whole MJCF.
        source: name of the file or text, in messages.

    Raises:
        UnsupportedJointError: one has a spring, counts from elsewhere than zero, or is coupled with another.
    """
    for name in moving:
        values = joints[name]
        if values.number("stiffness", 0.0):
            raise UnsupportedJointError(source, "has a spring (stiffness), which armdyn does not support", values.where)
        if values.number("ref", 0.0):
            what = "counts from elsewhere (ref); armdyn supports joints that are zero where the file draws them"
            raise UnsupportedJointError(source, what, values.where)
    for coupling in root.findall("equality/joint"):
        follower = str(coupling.get("joint1"))
        if coupling.get("active") != "false" and follower in moving:
            what = "is coupled by <equality>; armdyn supports no coupled joints: lock it"
            raise UnsupportedJointError(source, what, f"joint {clipped(follower)!r}")
