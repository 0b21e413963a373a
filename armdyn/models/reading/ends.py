"""Ends of an arm: the joints of its gripper, its chains, its tip."""

import re
from collections.abc import Mapping, Set

import pinocchio as pin

from armdyn.models.values.urdf import TIP

_GRIPPING = re.compile(r"finger|gripper|jaw|knuckle|thumb|claw", re.IGNORECASE)
"""Parts of names of gripper joints."""
_WRIST = re.compile(r"roll|pitch|yaw|rot|wrist", re.IGNORECASE)
"""Parts of names of joints that carry a gripper."""
_FINGER = re.compile(r"finger|jaw|knuckle|thumb|claw", re.IGNORECASE)
"""Parts of names of a gripper's links but for its palm."""
_SIDE = re.compile(r"left|right|upper|lower|inner|outer|\d+|(?<![a-z])[a-dlr](?![a-z])", re.IGNORECASE)
"""Parts of names by which alike links differ."""

BODY, POINT, FIXED, JOINT = (getattr(pin.FrameType, kind) for kind in ("BODY", "OP_FRAME", "FIXED_JOINT", "JOINT"))


def joint_numbers(model: pin.Model) -> dict[str, int]:
    """The names of a model's joints to their indices."""
    return {str(name): i for i, name in enumerate(model.names) if i}


def gripper_joints(model: pin.Model, leaders: Mapping[str, str], still: Set[str] = frozenset()) -> list[str]:
    """Joints of grippers, which are no joints of a task; none where nothing else moves.

    They have such a name, lead a joint next to them, or end next to another of their kind; behind them only others of
    the gripper move.

    Args:
        model: of all joints.
        leaders: joints that mimic others, to these; they are not returned.
        still: further joints that do not move.
    """
    joints = joint_numbers(model)
    free = [name for name in joints if name not in still and name not in leaders]
    above = {name: set(model.supports[i]) - {i} for name, i in joints.items()}
    behind = {name: {one for one, way in above.items() if joints[name] in way} for name in free}
    place = {name: (model.parents[i], model.joints[i].shortname()[10]) for name, i in joints.items()}  # P or R
    ends = [place[name] for name in free if not behind[name]]
    aside = {leader for one, leader in leaders.items() if one in joints and one not in behind.get(leader, (one,))}

    def grips(name: str) -> bool:
        paired = not behind[name] and place[name][0] > 0 and ends.count(place[name]) > 1
        return paired or name in aside or _grips(name)

    found = [name for name in free if grips(name)]
    found = [name for name in found if not behind[name] & ({*free} - {*found})]
    return found if len(found) < len(free) else []


def chains(model: pin.Model, still: Set[str] = frozenset()) -> list[tuple[str, ...]]:
    """Joints that move from the base to each end, the longest chain first, without those that do not move."""
    names = list(map(str, model.names))
    ways = {tuple(names[i] for i in support if i and names[i] not in still) for support in model.supports}
    ends = [way for way in ways if way and not any(other != way and other[: len(way)] == way for other in ways)]
    return sorted(ends, key=lambda way: (-len(way), names.index(way[-1])))


def tip_of(model: pin.Model, locked: Set[str], last: str | None) -> tuple[str, int]:
    """The frame at the end of the arm; where the last joint has none, an empty name and the joint for a new one.

    It is the body furthest from the base, in moving joints and then in all; among equals the one behind the fewest
    locked joints: a hand rather than its fingers. A gripper's joints that do not move, and links side by side of which
    several are called fingers or that differ by their side alone, end the way: of a gripper that is its palm, or a tool
    frame between the fingers. Behind a last joint that is given there is no locked one.

    Args:
        model: of all joints.
        locked: those that do not move.
        last: last joint of the arm; None: no arm was chosen, or its last link.
    """
    if last is None and any(one.name == TIP and one.type != JOINT for one in model.frames):
        return TIP, 0
    joints = joint_numbers(model)
    still = {joints[name] for name in locked}
    moving = [len(set(support) - still) for support in model.supports]
    ends = [i for i, count in enumerate(moving) if count == max(moving)] if last is None else [joints[last]]
    parents = list(model.parents)
    fingers = {i for name, i in joints.items() if i in still and (_grips(name) or _twin(i, parents, still))}
    ends = [i for i in ends if not fingers & set(model.supports[i])] or ends
    frames = list(model.frames)
    ways = _ways([frame.parentFrame for frame in frames])
    beside = _fixed_fingers(frames, ways, locked)
    there = [i for i, frame in enumerate(frames) if frame.parentJoint in ends]
    there = [i for i in there if beside.isdisjoint(ways[i])] or there

    def rank(i: int) -> tuple[int, int]:
        return len(ways[i]), -len(still & set(model.supports[frames[i].parentJoint]))

    for kind in (BODY, POINT, JOINT):
        if kept := [i for i in there if frames[i].type == kind]:
            return str(frames[max(kept, key=rank)].name), 0
    return "", max(set(model.supports[ends[0]]) - still)


def _grips(name: str) -> bool:
    """Whether a joint is called one of a gripper."""
    return bool(_GRIPPING.search(name) and not _WRIST.search(name))


def _twin(joint: int, parents: list[int], still: Set[int]) -> bool:
    return sum(parents[other] == parents[joint] for other in still) > 1


def _ways(above: list[int]) -> list[list[int]]:
    """Of each frame its number and those of the frames between it and the base, which come before it."""
    ways: list[list[int]] = []
    for i, parent in enumerate(above):
        ways.append([i, *(ways[parent] if 0 < parent < i else [])])
    return ways


def _fixed_fingers(frames: list[pin.Frame], ways: list[list[int]], locked: Set[str]) -> set[int]:
    """Frames of fixed or locked joints side by side that lead to fingers by name, or to links alike but for the side.

    Those of one place are names of one frame.
    """
    links = {frame.parentFrame: str(frame.name) for frame in frames if frame.type == BODY}
    fingers = {j for i, frame in enumerate(frames) if _FINGER.search(frame.name) for j in ways[i]}
    beside: dict[tuple[int, str], dict[int, str]] = {}
    for i, frame in enumerate(frames):
        if frame.type == FIXED or (frame.type == JOINT and frame.name in locked):
            kind = "" if i in fingers else _SIDE.sub("*", links.get(i, str(frame.name)))
            beside.setdefault((frame.parentFrame, kind), {})[i] = f"{frame.placement.translation.round(6) + 0.0}"
    return {i for (_, kind), own in beside.items() if len(own if not kind else {*own.values()}) > 1 for i in own}
