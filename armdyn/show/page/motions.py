"""Curves of the report's plots: positions, velocities and torques over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Any

import numpy as np

from armdyn.arrays import Array
from armdyn.files import as_json
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.obstacles import Obstacle
from armdyn.models.values.joint_limits import JointLimits, scaled_limits
from armdyn.show.page.facts import Facts
from armdyn.show.page.scene import packed
from armdyn.trajectory import Trajectory
from armdyn.trajectory.value import Sample

NEAR_LIMIT = 0.005
"""Largest distance of a sample from an active limit, as a part of the limit, where arcs are unknown."""

_DENSE = 500
_OWN = 1500
_TICKS = 60
_SEGMENTS = 400
_MODES = {
    "torque upper": "T+", "torque lower": "T-", "velocity upper": "V+", "velocity lower": "V-",
    "position upper": "Q+", "position lower": "Q-", "free": "", "passive": "P",
}  # fmt: skip
"""An arc's mode as `assets/report.js` writes it."""

Segment = tuple[float, float, str]
"""Begin and end [s], and the active limit."""


@dataclass(frozen=True, eq=False)
class ShownMotion:
    """A motion with its name and facts.

    Attributes:
        name: in legends and tables.
        motion: its samples.
        facts: of its run; none of a bare motion.
    """

    name: str
    motion: Trajectory
    facts: Facts


@dataclass(frozen=True, eq=False)
class Subject:
    """The arm of a report; its model may be missing.

    Attributes:
        name: of the robot.
        joints: their names.
        limits: of the joints.
        sliding: which slide instead of turning.
        robot: drawn in three dimensions; None: it is not at hand.
        obstacles: drawn where they stand.
        touching: names of links, tool, payload and obstacles that are drawn in red.
    """

    name: str
    joints: tuple[str, ...]
    limits: JointLimits
    sliding: tuple[bool, ...]
    robot: Robot | None = None
    obstacles: tuple[Obstacle, ...] = ()
    touching: frozenset[str] = frozenset()

    @classmethod
    def of(cls, robot: Robot, obstacles: Sequence[Obstacle] = ()) -> Subject:
        """Describe a robot for a report."""
        sliding = tuple(robot.slides.tolist())
        return cls(robot.name, tuple(robot.joint_names), robot.limits, sliding, robot, tuple(obstacles))


def until(motion: Trajectory, end: float | None) -> Trajectory:
    """A motion up to a time [s] from its start; None: all of it."""
    if end is None or end >= motion.duration:
        return motion
    return motion.slice(end=float(motion.t[0]) + end)


def motions_data(moves: Sequence[ShownMotion], subject: Subject) -> dict[str, Any]:
    """All curves at common times from 0 on, with limits, each joint's active limit, and switching instants.

    Args:
        moves: one or more, of the same joints.
        subject: the arm.
    """
    limits, sliding = subject.limits, subject.sliding
    times = np.unique(np.concatenate([_times(move.motion) for move in moves]))
    return {
        "t": packed(times, "<f8"),
        "sliding": list(sliding),
        "limits": as_json(
            {
                "q": np.column_stack([limits.position_lower, limits.position_upper]),
                "v": np.column_stack([-limits.velocity, limits.velocity]),
                "tau": np.column_stack([limits.effort_lower, limits.effort_upper]),
            }
        ),
        "kept": _reserves(moves[0].facts, len(sliding)),
        "moves": [_curves(move, times, limits) for move in moves],
    }


def _times(motion: Trajectory) -> Array:
    """Times at which a motion is drawn [s], from 0 on: dense for its curves, on both sides of each jump."""
    own = motion.t
    if own.size > _OWN:
        jump = np.flatnonzero(motion.jumps)[:_OWN]
        own = np.union1d(own[jump], own[jump + 1])
    even = np.linspace(motion.t[0], motion.t[-1], _DENSE if motion.t.size <= _OWN else _OWN)
    return np.asarray(np.union1d(own, even) - motion.t[0])


def _curves(move: ShownMotion, times: Array, limits: JointLimits) -> dict[str, Any]:
    """Curves of one motion, NaN after its end, and where it has no torques."""
    motion = move.motion
    sample = motion(motion.t[0] + times)
    beyond = times > motion.duration
    lanes = arc_lanes(move.facts, limits.velocity.size)
    resolved = bool(lanes)
    if not resolved:
        lanes = sampled_lanes(
            times[~beyond], Sample(*(x[~beyond] for x in sample)), _reduced_limits(limits, move.facts)
        )
    curves = {}
    for name, values in zip(("q", "v", "tau"), sample, strict=True):
        values[beyond | (name == "tau" and not np.any(motion.tau))] = np.nan
        curves[name] = packed(values.T)
    return {
        "name": move.name,
        "duration": motion.duration,
        **curves,
        "lanes": lanes,
        "resolved": resolved,
        "exact": not move.facts.unresolved,
        "switches": switches(move, lanes, resolved=resolved),
    }


def arc_lanes(facts: Facts, joints: int) -> list[list[Segment]]:
    """Active limit of every joint over time, from arcs; empty without these."""
    arcs = facts.parts("arcs")
    lengths = [arc.number("duration") for arc in arcs]
    modes = [arc.texts("modes") for arc in arcs]
    if not arcs or any(length is None or length < 0 for length in lengths) or any(len(m) != joints for m in modes):
        return []
    edges = np.concatenate([[0.0], np.cumsum([float(length or 0.0) for length in lengths])]).tolist()
    codes = [[_MODES.get(mode, "") for mode in each] for each in modes]
    return [
        _merged([(a, b, code[j]) for (a, b), code in zip(pairwise(edges), codes, strict=True)]) for j in range(joints)
    ]


def sampled_lanes(t: Array, sample: Sample, limits: JointLimits) -> list[list[Segment]]:
    """Active limit of every joint over time, from samples near a limit: torque before velocity before position.

    Args:
        t: times [s], shape (n,).
        sample: positions, velocities and torques then, each of shape (n, nv).
        limits: of the joints.
    """
    q, v, tau = sample
    weakest, strongest = (np.broadcast_to(end, tau.shape) for end in limits.actuators.range(q, v))
    lanes = []
    for j in range(q.shape[1]):
        if limits.passive[j]:
            lanes.append([(0.0, float(t[-1]), "P")])
            continue
        codes = np.full(t.size, "", dtype="<U2")
        low, high = float(limits.position_lower[j]), float(limits.position_upper[j])
        margin = NEAR_LIMIT * (high - low)
        if np.isfinite(margin):
            codes[q[:, j] >= high - margin], codes[q[:, j] <= low + margin] = "Q+", "Q-"
        fastest = np.full(t.size, limits.velocity[j])
        for x, least, most, kind in (
            (v[:, j], -fastest, fastest, "V"),
            (tau[:, j], weakest[:, j], strongest[:, j], "T"),
        ):
            codes[np.isfinite(most) & (most > 0) & (x >= (1 - NEAR_LIMIT) * most)] = f"{kind}+"
            codes[np.isfinite(least) & (least < 0) & (x <= (1 - NEAR_LIMIT) * least)] = f"{kind}-"
        pieces = [(float(a), float(b), str(code)) for (a, b), code in zip(pairwise(t), codes[:-1], strict=True)]
        lanes.append(_merged(pieces))
    return lanes


def switches(move: ShownMotion, lanes: Sequence[Sequence[Segment]], *, resolved: bool) -> list[dict[str, Any]]:
    """Switching instants of a motion, and of which joints [s from the start]; at most `_TICKS`.

    Of arcs their ends; of a motion whose arcs were looked for and not resolved none, for its jumps are a mesh's;
    of any other where its torques jump.

    Args:
        move: the motion.
        lanes: which limit every joint is on.
        resolved: the lanes are arcs.
    """
    start, duration = float(move.motion.t[0]), move.motion.duration
    if resolved:
        times = [[begun for begun, _, _ in lane if 0 < begun < duration] for lane in lanes]
    elif "arcs" in move.facts:
        times = []
    else:
        times = [[time - start for time in each[: _TICKS + 1]] for each in move.motion.switch_times]
    found: dict[float, list[int]] = {}
    for joint, each in enumerate(times):
        for time in each:
            found.setdefault(time, []).append(joint)
    return [{"t": time, "joints": found[time]} for time in sorted(found)][:_TICKS]


def _merged(pieces: Sequence[Segment]) -> list[Segment]:
    """Neighbours of the same mode as one."""
    runs = (list(run) for _, run in groupby(pieces, key=lambda piece: piece[2]))
    return [(run[0][0], run[-1][1], run[0][2]) for run in runs][:_SEGMENTS]


def _reserves(facts: Facts, joints: int) -> dict[str, list[float]] | None:
    """Reserves for feedback as parts of the velocity and torque limits; None without reserves."""
    reserve = facts.part("reserve")
    parts = {name: reserve.numbers(given) for name, given in (("v", "velocity"), ("tau", "effort"))}
    if any(len(each) != joints for each in parts.values()):
        return None
    return {name: [min(max(x or 0.0, 0.0), 1.0) for x in each] for name, each in parts.items()}


def _reduced_limits(limits: JointLimits, facts: Facts) -> JointLimits:
    """The limits less the reserve for feedback."""
    kept = _reserves(facts, limits.velocity.size)
    return limits if kept is None else scaled_limits(limits, *(1 - np.array(kept[name]) for name in ("tau", "v")))
