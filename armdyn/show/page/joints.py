"""Numbers of motions: what each joint does, and several motions side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armdyn.models.values.limits import JointLimits
from armdyn.show.markup import Html, table
from armdyn.show.page.course import Move
from armdyn.show.page.sections import Section, td, th
from armdyn.show.page.verdict import verdict_of
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

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
    """∫ Σ |τ_i v_i| dt [J], by the trapezoidal rule: what joints give and take, without recovery."""
    t, _, v, tau = dense(motion)
    return float(np.trapezoid(np.abs(v * tau).sum(axis=1), t))


def joint_section(move: Move, joints: Sequence[str], limits: JointLimits, sliding: Sequence[bool]) -> Section:
    """What each joint does in a motion, beside its limits."""
    _, q, v, tau = dense(move.motion)
    switching = [len(times) for times in move.motion.switch_times]
    head = [
        [th(text) for text in ("joint", "from", "to", "fastest", "of its limit", "strongest", "of its limit", "jumps")]
    ]
    rows = []
    for j, name in enumerate(joints):
        turn, force = ("m", "N") if sliding[j] else ("rad", "N m")
        rows.append([
            th(name, "row"), td(f"{q[0, j]:.4f} {turn}"), td(f"{q[-1, j]:.4f} {turn}"),
            td(f"{np.abs(v[:, j]).max():.4g} {turn}/s"), _share(v[:, j], -limits.velocity[j], limits.velocity[j]),
            td(f"{np.abs(tau[:, j]).max():.4g} {force}"),
            _share(tau[:, j], limits.effort_lower[j], limits.effort_upper[j]), td(str(switching[j])),
        ])  # fmt: skip
    return Section("joints", "Joint by joint", table(head, rows), wide=True)


def comparison_section(moves: Sequence[Move], limits: JointLimits) -> Section | None:
    """Several motions side by side, the first the one that the others are measured by."""
    if len(moves) < 2:
        return None
    first = moves[0].motion.duration
    head = [
        [th(text) for text in ("motion", "duration", "beside the first", "work", "fastest", "strongest", "verdict")]
    ]
    rows = []
    for move in moves:
        _, _, v, tau = dense(move.motion)
        rows.append([
            th(move.name, "row"), td(f"{move.motion.duration:.4f} s"),
            td("–" if move is moves[0] else f"{100 * (move.motion.duration / first - 1):+.1f} %"),
            td(f"{mechanical_work(move.motion):.4g} J"),
            _share(v, -limits.velocity, limits.velocity), _share(tau, limits.effort_lower, limits.effort_upper),
            td(verdict_of(move.facts).headline),
        ])  # fmt: skip
    return Section("comparison", "Side by side", table(head, rows), wide=True)


def _share(x: Array, lower: Array, upper: Array) -> Html:
    """The most of its limit that something takes; of several joints, which are columns, the one that takes most."""
    with np.errstate(divide="ignore", invalid="ignore"):
        used = np.where(x > 0, x / upper, np.where(x < 0, x / lower, 0.0))
    known = np.isfinite(np.broadcast_to(upper, x.shape)) & np.isfinite(used)
    if not np.any(known):
        return td("–")
    share = float(np.max(used[known]))
    # A millionth beyond is rounding, and what a solver's tolerance allows.
    return td(f"{100 * share:.3g} %", class_="over") if share > 1 + 2e-6 else td(f"{100 * share:.3g} %")
