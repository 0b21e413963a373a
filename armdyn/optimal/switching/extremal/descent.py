"""Optimisation of a structure's times: descent on the manifold of motions that reach the goal.

Every step goes along the tangent, as far as a quadratic model of the Lagrangian is trusted, and is projected back by
Newton's method with the least change (Absil, Mahony and Sepulchre, Optimization Algorithms on Matrix
Manifolds, 2008, chapter 7), which also finds the first motion from a structure with gaps. The duration falls from one
motion to the next. Changes of different joints pass each other freely: torques of different joints commute, so that
nothing jumps when changes pass.
"""

from dataclasses import replace

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.optimal.arcs.arc import VELOCITY
from armdyn.optimal.problem.status import Budget
from armdyn.optimal.switching.extremal.quadratic_model import LinearRollout, lengths_of
from armdyn.optimal.switching.extremal.rollout import Rollout, ShootingProblem
from armdyn.optimal.switching.extremal.state_limits import beyond_position, excess, with_limits, within_limits
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.extremal.trust_region import null_space

_RANK = 1e-12
"""Relative tolerance of singular values: rounding, in equations that an unstable arm amplifies a millionfold."""


def landed(
    shooting: ShootingProblem,
    structure: SwitchingStructure,
    rounds: int | None = None,
    joined: Flags | None = None,
    in_one: bool = False,
) -> LinearRollout | None:
    """Nearest motion that reaches the goal and satisfies its active state limits; None if none is near.

    Args:
        shooting: the shooting problem.
        structure: initial structure.
        rounds: rounds of Newton's method; None: as many as from a mesh's states.
        joined: changes with states from the arc before, see `Rollout.of`.
        in_one: whether the motion has no gaps throughout.
    """
    numbers, joined = shooting.policy.descent, np.ones(structure.size, bool) if in_one else joined
    rounds = numbers.rounds if rounds is None else rounds
    for k in range(rounds + 1):
        if structure.size + 1 > shooting.most_arcs:
            return None
        rollout = Rollout.of(shooting, structure, joined)
        if not rollout.finite:
            return None
        linear, structure = LinearRollout.of(rollout), rollout.structure
        if not np.all(np.isfinite(linear.jacobian)):  # a chain of many arcs may overflow even if no arc does
            return None
        if linear.infeasible <= numbers.closed:
            return linear
        if shooting.budget.left < -numbers.budget_excess:
            return None
        by, whole = _correction(linear)
        most = float(np.max(np.abs(by[: structure.size + 1]))) / structure.duration
        if k == rounds or most > numbers.far:
            return None
        part = min(1.0, whole, numbers.time_step / max(most, 1e-300))
        structure, moved = moved_by(linear, part * by, part)
        joined = np.ones(structure.size, bool) if in_one else moved
    return None


def _correction(linear: LinearRollout) -> tuple[Array, float]:
    """First-order correction of gaps and misses, and the fraction of it that keeps every segment's length positive.

    The least change, of the times as parts of the duration and of the states: an unstable arm amplifies a time a
    millionfold, and a least change of the times alone would be erratic.
    """
    structure, planes, now = linear.structure, linear.planes, linear.planes.now
    numbers = linear.shooting.policy.descent
    unit, width = linear.rollout.unit, structure.width
    changes = np.vstack(
        [np.eye(width) / structure.duration, numbers.states * (linear.reach[:-1] / unit[:, None]).reshape(-1, width)]
    )
    moved = np.concatenate([np.zeros(width), numbers.states * (linear.gap[:-1] / unit).ravel()])
    least = np.where(planes.lengths, numbers.kept * now, 0.0)
    held: list[int] = []
    while True:
        linear.shooting.budget.spend(numbers.cubic * width**3)
        equations = np.vstack([linear.jacobian, planes.rows[held]])
        by = _least_change(equations, np.concatenate([-linear.residual, (least - now)[held]]), changes, moved)
        after = now + planes.rows @ by
        short = [k for k in np.flatnonzero(after < least - 1e-12).tolist() if k not in held]
        if not short or len(equations) >= by.size:
            break
        held.append(min(short, key=lambda k: after[k] - least[k]))
    shares = [(now[k] - least[k]) / (now[k] - after[k]) for k in short if planes.lengths[k]]
    states = (linear.reach[:-1] @ by + linear.gap[:-1]) / unit
    shares.append(numbers.state_step / max(float(np.max(np.abs(states), initial=0.0)), 1e-300))
    return by, float(max(0.0, min([1.0, *shares])))


def _least_change(equations: Array, right: Array, changes: Array, moved: Array) -> Array:
    """Smallest |changes y + moved| over all y that satisfy the equations."""
    some = np.asarray(np.linalg.lstsq(equations, right, rcond=_RANK)[0], float)
    free = null_space(equations)
    if not len(free):
        return some
    return np.asarray(some - np.linalg.lstsq(changes @ free.T, changes @ some + moved, rcond=_RANK)[0] @ free)


def moved_by(linear: LinearRollout, by: Array, part: float) -> tuple[SwitchingStructure, Flags]:
    """Structure with shifted times and matching states, and the changes whose order has changed.

    Args:
        linear: the linearised motion.
        by: step of the unknowns.
        part: part of the gaps to close.
    """
    structure = linear.structure
    states = structure.states + (linear.reach[:-1] @ by + part * linear.gap[:-1])
    by, m = by.copy(), structure.size
    times = np.clip(structure.times + by[:m], 0.0, structure.duration + by[m])
    by[:m] = times - structure.times
    order = np.argsort(times, kind="stable")
    return structure.moved(by, states), order != np.arange(structure.size)


def fastest(shooting: ShootingProblem, structure: SwitchingStructure) -> tuple[LinearRollout | None, str]:
    """Find the extremal near a structure: a stationary motion, which no small change of its times shortens.

    Args:
        shooting: the shooting problem.
        structure: initial structure; times and states may be inconsistent.

    Returns:
        The last motion, None without any, and the reason, in words, why it is no extremal; "": it is one.
    """
    linear = landed(shooting, structure)
    if linear is None:
        return None, "no motion near the mesh's ends in the goal"
    linear = _touching(linear)
    numbers = shooting.policy.descent
    radius = numbers.radius * structure.duration
    for _ in range(numbers.steps):
        if shooting.budget:
            return linear, shooting.budget.word
        if not np.all(np.isfinite(linear.quadratic.hessian)):
            return linear, "the motion next to it overflows"
        if linear.gradient_norm <= numbers.flat:
            return linear, ""
        step = linear.step(radius)
        while True:
            if step.promised < numbers.worth * structure.duration or radius < numbers.narrow * structure.duration:
                if linear.gradient_norm <= numbers.nearly_flat:
                    return linear, ""
                return linear, "no step shortens the motion any more"
            after = _stepped(linear, step.by)
            gained = linear.structure.duration - after.structure.duration if after else -np.inf
            if gained >= 0.05 * step.promised:
                break
            radius = min(radius, float(np.linalg.norm(step.by))) / 4
            step = linear.step(radius)
        if gained > 0.7 * step.promised and step.bound:
            radius *= 2.5
        assert after is not None  # noqa: S101 - otherwise there was no gain
        linear = _without_vanished(_within_limits(linear, step.by, after))
    return linear, f"{numbers.steps} steps did not reach an extremal"


def _within_limits(linear: LinearRollout, by: Array, after: LinearRollout) -> LinearRollout:
    """The motion after a step, shortened to touch position limits if the motion exceeds these.

    Args:
        linear: motion before the step.
        by: step of the unknowns.
        after: motion after the step.
    """
    there, low, high, numbers = after, 0.0, 1.0, linear.shooting.policy.descent
    for _ in range(numbers.halves):
        kept = within_limits(there.rollout)
        if (kept and high == 1.0) or (not kept and excess(there.rollout) <= numbers.near):
            break
        part = (low + high) / 2
        halved = _stepped(linear, part * by)
        if halved is None:
            return after
        low, high = (part, high) if within_limits(halved.rollout) else (low, part)
        there = halved
    return _touching(there)


def _touching(linear: LinearRollout) -> LinearRollout:
    """The motion with touches of the position limits that it exceeds, if there is one nearby."""
    numbers, overlooked = linear.shooting.policy.descent, linear.shooting.policy.rollout.beyond
    for _ in range(numbers.touches):
        beyond = beyond_position(linear.rollout)
        structure = with_limits(linear.rollout) if beyond <= numbers.far_beyond else None
        touching = landed(linear.shooting, structure) if structure else None
        most_cost = numbers.touch_cost if beyond > overlooked else numbers.arc_cost
        if touching is None or touching.structure.duration > (1 + most_cost) * linear.structure.duration:
            return linear
        linear = touching
    return linear


def in_one_piece(extremal: LinearRollout, offset: Array | float = 0.0) -> LinearRollout:
    """Close the gaps between a structure's arcs that rounding leaves.

    Args:
        extremal: extremal whose arcs join to 1e-9, an error that an unstable arm amplifies.
        offset: offset of the end state from the goal, (q, v), shape (2 nv,).

    Returns:
        The extremal; unchanged if no motion without gaps is near.
    """
    shooting = replace(extremal.shooting, offset=offset)
    linear = landed(shooting, extremal.structure, shooting.policy.descent.near_rounds, in_one=True)
    return extremal if linear is None else linear


def finer(extremal: LinearRollout, budget: Budget) -> LinearRollout | None:
    """Solve the same structure with twice the steps; None at the largest number of steps, or without an extremal.

    Args:
        extremal: extremal with too long steps.
        budget: budget of its integrator steps.
    """
    shooting = extremal.shooting.finer(extremal.rollout)
    found, why = fastest(replace(shooting, budget=budget), extremal.structure) if shooting else (None, "")
    return None if why else found


def _stepped(linear: LinearRollout, by: Array) -> LinearRollout | None:
    """The motion after a step along the tangents."""
    structure, joined = moved_by(linear, by, 1.0)
    return landed(linear.shooting, structure, linear.shooting.policy.descent.near_rounds, joined)


def _without_vanished(linear: LinearRollout) -> LinearRollout:
    """The motion without segments of zero length, and without touches within contacts.

    On velocity limits they stay: a joint may have to reach the limit just as its torque switches.
    """
    structure, numbers = linear.structure, linear.shooting.policy.descent
    lengths = lengths_of(structure) @ structure.unknowns
    short = [
        segment
        for segment, length in zip(structure.segments(), lengths, strict=True)
        if length < numbers.vanished * structure.duration and structure.mode_of(segment) not in VELOCITY
    ]
    left = structure.without(short) if short else structure
    left = left.without_changes(left.idle_touches)
    return linear if left.size == structure.size else landed(linear.shooting, left, numbers.near_rounds) or linear
