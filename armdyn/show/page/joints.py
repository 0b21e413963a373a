"""Numbers of motions: joint by joint, several motions side by side, torques over speeds of motors."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array
from armdyn.models.values.actuator_limits import TorqueSpeed
from armdyn.models.values.joint_limits import JointLimits
from armdyn.show.markup import Html, element, join
from armdyn.show.page.motions import ShownMotion, Subject, arc_lanes
from armdyn.show.page.sections import Section, stacked, td
from armdyn.show.page.verdict import Tile, seconds, verdict_of
from armdyn.trajectory import Trajectory

_DENSE = 4000


def dense(motion: Trajectory) -> tuple[Array, Array, Array, Array]:
    """Times, positions, velocities and torques of a motion, its own samples and between them.

    Returns:
        t [s], shape (n,); q [rad or m], v [rad/s or m/s] and tau [N m or N], each of shape (n, nv).
    """
    t = np.union1d(motion.t, np.linspace(motion.t[0], motion.t[-1], _DENSE))
    sample = motion(t)
    return t, sample.q, sample.v, sample.tau


def mechanical_work(motion: Trajectory) -> float:
    """∫ Σ |τ_i v_i| dt [J], by the trapezoidal rule: work given and taken by the joints, without recovery."""
    t, _, v, tau = dense(motion)
    return float(np.trapezoid(np.abs(v * tau).sum(axis=1), t))


def joint_section(move: ShownMotion, subject: Subject) -> Section:
    """Peak velocity and torque of each joint, compared with its limits."""
    limits = subject.limits
    _, q, v, tau = dense(move.motion)
    lanes = arc_lanes(move.facts, q.shape[1]) if move.facts.unresolved else []  # a mesh's own jumps are many
    switching = [len(lane) - 1 for lane in lanes] or [len(times) for times in move.motion.switch_times]
    lower, upper = (np.broadcast_to(end, tau.shape) for end in limits.actuators.range(q, v))
    heads = ("joint", "from", "to", "peak speed", "of its limit", "peak torque", "of its limit", "jumps")
    rows = []
    for j, name in enumerate(subject.joints):
        turn, force = ("m", "N") if subject.sliding[j] else ("rad", "N m")
        speed = most_used(v[:, j], -limits.velocity[j], limits.velocity[j])
        torque = most_used(tau[:, j], lower[:, j], upper[:, j])
        ends = [f"{x:z.4f} {turn}" for x in (q[0, j], q[-1, j])]
        fastest, strongest = f"{np.abs(v[:, j]).max():.4g} {turn}/s", f"{np.abs(tau[:, j]).max():.4g} {force}"
        pushed = [strongest, _share(torque)] if np.any(tau) else ["unknown", _share(None)]
        rows.append([name, *ends, fastest, _share(speed), *pushed, str(switching[j])])
    return Section("joints", "Joint by joint", stacked(heads, rows), wide=True)


@dataclass(frozen=True)
class Compared:
    """Numbers of one motion among several; the names are keys of `armdyn compare --json`.

    Attributes:
        name: in legends and tables.
        duration: of the recorded motion [s].
        there: time of arrival at the goal, by the motion's own rule [s]; None: it does not arrive.
        later: delay of the arrival against the first motion's, as a part of that; None if one does not arrive.
        work: see `mechanical_work` [J]; None of a motion without torques.
        speed: the most that a joint takes of its velocity limit; None without one.
        torque: likewise of torque limits; None of a motion without torques, too.
        verdict: in a few words.
    """

    name: str
    duration: float
    there: float | None
    later: float | None
    work: float | None
    speed: float | None
    torque: float | None
    verdict: str


def compared(moves: Sequence[ShownMotion], limits: JointLimits) -> list[Compared]:
    """Compare several motions with the first."""
    first, rows = at_the_goal(moves[0]), []
    for move in moves:
        there = at_the_goal(move)
        _, q, v, tau = dense(move.motion)
        rows.append(
            Compared(
                name=move.name,
                duration=move.motion.duration,
                there=there,
                later=None if there is None or not first else there / first - 1,
                work=mechanical_work(move.motion) if np.any(tau) else None,
                speed=move.facts.number("velocity_share") or most_used(v, -limits.velocity, limits.velocity),
                torque=most_used(tau, *limits.actuators.range(q, v)) if np.any(tau) else None,
                verdict=re.sub(" after [^,]*", "", verdict_of(move.facts).headline),  # the time is in a column
            )
        )
    return rows


def initial_span(moves: Sequence[ShownMotion], end: float | None = None) -> float | None:
    """Initially shown span [s]: a little longer than the motions take to arrive; None: all.

    Args:
        moves: the motions.
        end: they are drawn up to this time [s]; None: all of them.
    """
    longest = min(max(move.motion.duration for move in moves), np.inf if end is None else end)
    there = [time for time in map(at_the_goal, moves) if time is not None]
    seen = 1.2 * max(there, default=np.inf)
    return seen if seen < 0.8 * longest else None


def at_the_goal(move: ShownMotion) -> float | None:
    """Settled time of a closed loop by its own rule, None without one; end of any other motion [s]."""
    for name in ("settled_time", "arrival_time"):
        if name in move.facts:
            return move.facts.number(name)
    return move.motion.duration


def comparison_tiles(rows: Sequence[Compared]) -> list[Tile]:
    """Tiles of several motions: each motion's time of arrival at the goal."""
    tiles = []
    for k, row in enumerate(rows):
        later = "" if k == 0 or row.later is None else f"{_later(row)}, ".replace("-", "−")
        verdict = row.verdict[:1].lower() + row.verdict[1:] if later else row.verdict
        tiles.append(Tile(row.name, seconds(row.there), later + verdict))
    return tiles


def comparison_section(rows: Sequence[Compared]) -> Section | None:
    """Several motions side by side; empty for one motion."""
    if len(rows) < 2:
        return None
    heads = ("motion", "arrival", "against the first", "recorded", "work", "peak speed", "peak torque", "<verdict")
    body = []
    for k, one in enumerate(rows):
        times = [seconds(one.there), "–" if k == 0 else _later(one), seconds(one.duration)]
        work = "no torques" if one.work is None else f"{one.work:.4g} J"
        body.append([one.name, *times, work, _share(one.speed), _share(one.torque), one.verdict])
    note = (
        "Arrival: time at which the goal is reached; a closed loop has arrived when it stays there, by its own rule. "
        "Work is ∫ Σ |τ q̇| dt. Peak speed and torque: the largest share of a joint's limit that is used."
    )
    parts = [stacked(heads, body), element("p", note, class_="note")]
    return Section("comparison", "Side by side", join(parts), wide=True)


def most_used(x: Array, lower: Array, upper: Array) -> float | None:
    """Largest share of a limit that a joint uses; None without a limit.

    Args:
        x: numbers over time, shape (n,) of one joint or (n, nv).
        lower: their lower limits, which broadcast to them.
        upper: their upper limits.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        used = np.where(x > 0, x / upper, np.where(x < 0, x / lower, 0.0))
    known = np.isfinite(np.broadcast_to(upper, x.shape)) & np.isfinite(used)
    return float(np.max(used[known])) if np.any(known) else None


def _later(row: Compared) -> str:
    return "–" if row.later is None else f"{100 * row.later:+.1f} %"


def _share(part: float | None) -> Html:
    # A millionth beyond is rounding, and a solver's tolerance.
    return td("–") if part is None else td(f"{100 * part:.3g} %", over=part > 1 + 2e-6)


_WIDTH, _HEIGHT, _EDGE = 260.0, 170.0, 6.0
"""Width, height and edge of a picture [px]."""
_POINTS = 600
"""Approximate number of drawn points of a motion."""


def motor_section(move: ShownMotion, subject: Subject) -> Section | None:
    """Torque over speed of every joint that has a torque-speed curve, inside its limits; None: no joint has one."""
    motors, motion, joints = subject.limits.actuators, move.motion, subject.joints
    if not isinstance(motors, TorqueSpeed):
        return None
    last = [np.asarray(motors.curves[name])[-1, 0] if name in motors.curves else 0.0 for name in joints]
    fastest = np.maximum(1.05 * np.max(np.abs(motion.v), axis=0), last)
    v = np.linspace(-fastest, fastest, 201)
    lower, upper = motors.range(np.zeros_like(v), v)
    every = max(len(motion.t) // _POINTS, 1)
    pictures = []
    for j, name in enumerate(joints):
        if name not in motors.curves or subject.limits.passive[j]:
            continue
        unit = ("m/s", "N") if subject.sliding[j] else ("rad/s", "N m")
        size = np.array([fastest[j], np.max(np.abs([lower[:, j], upper[:, j]]))])
        edge = np.concatenate([np.stack([v[:, j], upper[:, j]], 1), np.stack([v[::-1, j], lower[::-1, j]], 1)])
        way = np.stack([motion.v[::every, j], motion.tau[::every, j]], 1)
        caption = f"{name}: ±{size[0]:.4g} {unit[0]} across, ±{size[1]:.4g} {unit[1]} up"
        pictures.append(
            element("figure", _picture(edge / size, way / size, caption), element("figcaption", caption, class_="note"))
        )
    note = "Torque over speed: the motion, within the motor's torque at each speed."
    body = join([element("p", note, class_="note"), element("div", *pictures, class_="motors")])
    return Section("motors", "Torque and speed", body, wide=True)


def _picture(edge: Array, way: Array, label: str) -> Html:
    """SVG of a joint's range and of its motion, each scaled to -1 … 1, shape (points, 2)."""
    middle, half = np.array([_WIDTH, _HEIGHT]) / 2, np.array([_WIDTH, -_HEIGHT]) / 2 + [-_EDGE, _EDGE]

    def points(of: Array) -> str:
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in middle + half * of)

    cross = f"M 0 {middle[1]:g} H {_WIDTH:g} M {middle[0]:g} 0 V {_HEIGHT:g}"
    return element(
        "svg",
        element("polygon", points=points(edge), fill="var(--fill)", stroke="var(--soft)", stroke_dasharray="5 4"),
        element("path", d=cross, stroke="var(--line)"),
        element("polyline", points=points(way), fill="none", stroke="var(--T)", stroke_width="1.5"),
        viewBox=f"0 0 {_WIDTH:g} {_HEIGHT:g}", width=int(_WIDTH), role="img", aria_label=label,
    )  # fmt: skip
