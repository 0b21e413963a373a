"""Checks of the moving parts of a URDF: their inertias and, where it is refused, missing limits and the remedy."""

from collections.abc import Set
from xml.etree.ElementTree import Element

from armdyn.models.reading.faults import Faults, mending, repair_call
from armdyn.models.reading.nearest_inertia import inertia_repair
from armdyn.models.reading.urdf_check import MOVING, end_of
from armdyn.models.reading.urdf_xml import clipped


def check_dynamics(root: Element, source: str, locked: Set[str], faults: Faults) -> None:
    """Refuse inertias of moving links that no body has, and all other faults, with missing limits and the remedy.

    Args:
        root: of `urdf_check.parse_urdf`.
        source: name of the file or text, in messages.
        locked: the names of the joints that do not move.
        faults: of the URDF so far.

    Raises:
        UrdfError: there are faults, or principal moments are negative, or one is larger than the other two together.
    """
    moving, free = _moving(root, locked)
    by_hand, repairs = dict.fromkeys(one.element or "the file" for one in faults), []
    for link in root.findall("link"):
        repair = faults.of(inertia_repair, link, source) if link.get("name") in moving else None
        if repair is not None and repair.fault:
            repairs.append(repair)
            faults.add(repair.fault, f"link {clipped(repair.link)!r}")
    effort, velocity = (
        [name for name, joint in free.items() if not _number(joint.find("limit"), key)]
        for key in ("effort", "velocity")
    )
    faults.remedy += f"; no torque limit: {clipped(', '.join(effort))}" if effort else ""
    faults.remedy += f"; no velocity limit (none is kept): {clipped(', '.join(velocity))}" if velocity else ""
    large = [one.power_of_ten for one in repairs if one.large]
    how = f", large={'power-of-ten' if any(large) else 'nearest'!r}" if large else ""
    if mended := mending(effort, repair_call(source, how) if repairs else ""):
        first = f"first mend {clipped(', '.join(by_hand))} by hand, then" if by_hand else "to mend"
        faults.remedy += f"; {first}: {mended}"
    faults.raise_together()


def _number(limit: Element | None, key: str) -> str:
    """A limit of a joint but for its zeros; empty: it has none."""
    return "" if limit is None else limit.get(key, "").strip(" +-.0")


def _moving(root: Element, locked: Set[str]) -> tuple[Set[str | None], dict[str, Element]]:
    """Names of the links that move, and the joints, mimicking ones left out, of a URDF that may have faults."""
    joints = {str(joint.get("name")): joint for joint in root.findall("joint")}
    ways = {name: (end_of(joint, "parent"), end_of(joint, "child")) for name, joint in joints.items()}
    free = {name: joint for name, joint in joints.items() if joint.get("type") in MOVING and name not in locked}
    links = {link.get("name") for link in root.findall("link")}
    still = links - {down for _, down in ways.values()}
    while more := {down for name, (up, down) in ways.items() if name not in free and up in still} - still:
        still |= more
    return links - still, {name: joint for name, joint in free.items() if joint.find("mimic") is None}
