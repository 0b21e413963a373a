"""Which joints of a URDF move, and where the others are locked."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from armdyn.arguments import shown as told
from armdyn.errors import SpecError, UnsupportedJointError, UrdfError, did_you_mean
from armdyn.models.reading.urdf_check import LARGEST, MOVING
from armdyn.models.reading.urdf_xml import shown, to_number


@dataclass(frozen=True, kw_only=True)
class Mimic:
    """A joint that follows another: position = multiplier * leader's + offset.

    Attributes:
        leader: the other joint.
        multiplier: [1, or m/rad].
        offset: [rad or m].
    """

    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True, kw_only=True)
class Joint:
    """One joint of a URDF.

    Attributes:
        name: its name.
        moves: it is not fixed.
        parent: the link that carries it.
        child: the link that it carries.
        rest: zero, or the bound nearest to it [rad or m].
        mimic: whom it follows.
    """

    name: str
    moves: bool
    parent: str
    child: str
    rest: float
    mimic: Mimic | None


class JointPlace(NamedTuple):
    """Where a link is in the tree."""

    free: int
    """Joints between the base and it that move."""
    joints: int
    """All joints between the base and it."""
    locked: int
    """Joints between the base and it that are locked."""
    carrier: str
    """The last before it that is not fixed; empty on the base."""


@dataclass(frozen=True)
class JointTree:
    """The joints of a URDF by the link that each carries.

    Attributes:
        joints: name to joint, in the order of the file.
        source: what to call the URDF in messages.
    """

    joints: Mapping[str, Joint]
    source: str

    @classmethod
    def of(cls, root: Element, source: str) -> "JointTree":
        """The tree of a URDF that `parse_urdf` has checked.

        Raises:
            UrdfError: a `<mimic>` has no leader, or its numbers are none.
        """
        joints = [_joint(element, source) for element in root.findall("joint")]
        tree = cls({joint.name: joint for joint in joints}, source)
        for joint in joints:
            if joint.mimic is not None and joint.mimic.leader not in tree.joints:
                what = f"mimics {shown(joint.mimic.leader)!r}, which is no joint"
                raise UrdfError(source, what, f"joint {shown(joint.name)!r}")
        return tree

    @property
    def links(self) -> set[str]:
        """The names of all links that a joint holds or carries."""
        return {link for joint in self.joints.values() for link in (joint.parent, joint.child)}

    def moving(self) -> list[str]:
        """The joints that are not fixed."""
        return [joint.name for joint in self.joints.values() if joint.moves]

    def chain(self, first: str, last: str) -> list[str]:
        """The moving joints on the way from `first` to `last`, each the name of a link or of a joint.

        A first link is where the arm stands, a first joint moves already; a last link is where the arm ends,
        a last joint moves still. Where a link and a joint have one name the link is meant.

        Raises:
            SpecError: no such names, the one is not behind the other, or nothing moves between.
        """
        carriers = {joint.child: joint for joint in self.joints.values()}
        links = self.links
        for name in (first, last):
            if name not in links and name not in self.joints:
                hint = did_you_mean(name, [*links, *self.joints])
                raise SpecError(f"arm: {self.source} has no link or joint {shown(name)!r}{hint}")
        end = last if last in links else self.joints[last].child
        base = first if first in links else self.joints[first].parent
        way = []
        while end != base:
            if end not in carriers:
                raise SpecError(f"arm: {shown(last)!r} is not behind {shown(first)!r} in {self.source}")
            way.append(carriers[end])
            end = carriers[end].parent
        names = [joint.name for joint in reversed(way) if joint.moves]
        if first not in links and (not names or first not in {joint.name for joint in way}):
            raise SpecError(f"arm: {shown(last)!r} is not behind {shown(first)!r} in {self.source}")
        if not names:
            raise SpecError(f"arm: nothing moves between {shown(first)!r} and {shown(last)!r} of {self.source}")
        return names

    def locked(self, lock: Mapping[str, float], arm: tuple[str, str] | None) -> dict[str, float]:
        """Where every joint is locked that does not move [rad or m], as `Robot.from_urdf` says it.

        Raises:
            SpecError: `lock` names no moving joint or no finite position, or `arm` does not fit.
            UnsupportedJointError: a joint mimics one that moves.
        """
        for name, value in lock.items():
            if name not in self.joints or not self.joints[name].moves:
                moving, hint = ", ".join(map(shown, self.moving()[:20])), did_you_mean(str(name), self.moving())
                raise SpecError(f"cannot lock {shown(name)!r}: {self.source} has joints {moving}{hint}")
            if not in_bounds(value):
                raise SpecError(f"cannot lock {name!r} at {told(value)}: it must be one number [rad or m]")
        free = set(self.moving() if arm is None else self.chain(*arm)) - set(lock)
        locked: dict[str, float] = {}
        for joint in self.joints.values():
            if not joint.moves or (joint.name in free and joint.mimic is None):
                continue
            position = self._position(joint, lock, free)
            if position is None:
                leader = "" if joint.mimic is None else shown(joint.mimic.leader)
                what = (
                    f"mimics {leader!r}, which moves; armdyn knows no coupled joints: lock that one, and this follows, "
                    "or this one alone if it does not matter"
                )
                raise UnsupportedJointError(self.source, what, f"joint {shown(joint.name)!r}")
            if not abs(position) <= LARGEST:
                raise UrdfError(self.source, f"would be locked at {position:g}", f"joint {shown(joint.name)!r}")
            locked[joint.name] = position
        return locked

    def _position(self, joint: Joint, lock: Mapping[str, float], free: set[str]) -> float | None:
        """Where a joint is locked; None if it follows one that moves."""
        scale, offset, seen = 1.0, 0.0, {joint.name}
        while True:
            if joint.name in lock:
                return scale * float(lock[joint.name]) + offset
            if joint.mimic is None:
                return None if joint.name in free else scale * joint.rest + offset
            offset += scale * joint.mimic.offset
            scale *= joint.mimic.multiplier
            joint = self.joints[joint.mimic.leader]
            if joint.name in seen:
                raise UrdfError(self.source, "mimics itself in the end", f"joint {shown(joint.name)!r}")
            seen.add(joint.name)

    def places(self, locked: Mapping[str, float]) -> dict[str, JointPlace]:
        """Where every link is in the tree, the nearer to the base the earlier."""
        children: dict[str, list[Joint]] = {}
        for joint in self.joints.values():
            children.setdefault(joint.parent, []).append(joint)
        carried = {joint.child for joint in self.joints.values()}
        places = {link: JointPlace(0, 0, 0, "") for link in children if link not in carried}
        stack = list(places)
        while stack:
            link = stack.pop()
            free, joints, behind_locked, carrier = places[link]
            for joint in children.get(link, []):
                still = joint.name in locked
                places[joint.child] = JointPlace(
                    free + (joint.moves and not still),
                    joints + 1,
                    behind_locked + still,
                    joint.name if joint.moves else carrier,
                )
                stack.append(joint.child)
        return places


def in_bounds(position: Any) -> bool:
    """It is a number, and one that a joint may be at [rad or m]."""
    known = isinstance(position, int | float | np.integer | np.floating) and not isinstance(position, bool)
    return known and bool(abs(position) <= LARGEST)


def _joint(element: Element, source: str) -> Joint:
    name = str(element.get("name"))
    parent, child = (str(element.find(tag).get("link")) for tag in ("parent", "child"))  # type: ignore[union-attr]
    limit, mimic = element.find("limit"), element.find("mimic")
    kind = element.get("type")
    rest = 0.0
    if limit is not None and kind in MOVING and kind != "continuous":
        lower, upper = (to_number(limit.get(key, "0")) for key in ("lower", "upper"))
        rest = float(np.clip(0.0, lower, upper))
    follows = None
    if mimic is not None and kind in MOVING:
        numbers = {}
        for key, default in (("multiplier", "1"), ("offset", "0")):
            text = mimic.get(key, default)
            try:
                numbers[key] = to_number(text)
            except ValueError:
                numbers[key] = float("nan")
            if not np.isfinite(numbers[key]):
                what = f"<mimic> {key}={shown(text)!r} is not a finite number"
                raise UrdfError(source, what, f"joint {shown(name)!r}")
        follows = Mimic(leader=str(mimic.get("joint", "")), **numbers)
    return Joint(name=name, moves=kind in MOVING, parent=parent, child=child, rest=rest, mimic=follows)
