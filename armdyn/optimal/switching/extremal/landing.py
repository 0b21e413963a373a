"""Newton's method from a structure with gaps to a motion that ends in the goal."""

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.optimal.switching.extremal.quadratic_model import LinearizedRollout
from armdyn.optimal.switching.extremal.rollout import Rollout, ShootingProblem
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.extremal.trust_region import null_space

_RANK = 1e-12
"""Relative tolerance of singular values: rounding, in equations that an unstable arm amplifies a millionfold."""
_TIED = 1e-12
"""Relative time by which a change may precede the one before by rounding, without having passed it."""


def landed(
    shooting: ShootingProblem,
    structure: SwitchingStructure,
    rounds: int | None = None,
    joined: Flags | None = None,
    in_one: bool = False,
    tied: bool = False,
) -> LinearizedRollout | None:
    """Nearest motion that reaches the goal and satisfies its active state limits; None if none is near.

    Args:
        shooting: the shooting problem.
        structure: initial structure.
        rounds: rounds of Newton's method; None: as many as from a mesh's states.
        joined: changes with states from the arc before, see `Rollout.of`.
        in_one: whether the motion has no gaps throughout.
        tied: whether simultaneous changes stay so.
    """
    numbers, joined = shooting.policy.descent, np.ones(structure.size, bool) if in_one else joined
    rounds = numbers.rounds if rounds is None else rounds
    for k in range(rounds + 1):
        if structure.size + 1 > shooting.most_arcs:
            return None
        rollout = Rollout.of(shooting, structure, joined)
        if not rollout.finite:
            return None
        linear, structure = LinearizedRollout.of(rollout), rollout.structure
        if not np.all(np.isfinite(linear.jacobian)):  # a chain of many arcs may overflow even if no arc does
            return None
        if linear.infeasible <= numbers.closed:
            return linear
        if shooting.budget.left < -numbers.budget_excess:
            return None
        by, whole = _correction(linear, tied)
        most = float(np.max(np.abs(by[: structure.size + 1]))) / structure.duration
        if k == rounds or most > numbers.far:
            return None
        part = min(1.0, whole, numbers.time_step / max(most, 1e-300))
        structure, moved = moved_by(linear, part * by, part)
        joined = np.ones(structure.size, bool) if in_one else moved
    return None


def _correction(linear: LinearizedRollout, tied: bool) -> tuple[Array, float]:
    """First-order correction of gaps and misses, and the fraction of it that keeps every segment's length positive.

    The least change, of the times as parts of the duration and of the states: an unstable arm amplifies a time a
    millionfold, and a least change of the times alone would be erratic.
    """
    structure, planes, now = linear.rollout.structure, linear.planes, linear.planes.now
    numbers = linear.rollout.shooting.policy.descent
    unit, width = linear.rollout.unit, structure.width
    changes = np.vstack(
        [np.eye(width) / structure.duration, numbers.states * (linear.reach[:-1] / unit[:, None]).reshape(-1, width)]
    )
    moved = np.concatenate([np.zeros(width), numbers.states * (linear.gap[:-1] / unit).ravel()])
    least = np.where(planes.lengths, numbers.kept * now, 0.0)
    held: list[int] = []
    first = now.size - len(planes.orders)
    least[first:] = -np.inf  # the equations determine the order of changes
    if tied:
        held += [first + int(k) for k in np.flatnonzero(np.abs(now[first:]) <= _TIED * structure.duration)]
        least[held] = 0.0
    while True:
        linear.rollout.shooting.budget.spend(numbers.cubic * width**3)
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


def moved_by(linear: LinearizedRollout, by: Array, part: float) -> tuple[SwitchingStructure, Flags]:
    """Structure with shifted times and matching states, and the changes whose order has changed.

    Args:
        linear: the linearised motion.
        by: step of the unknowns.
        part: part of the gaps to close.
    """
    structure = linear.rollout.structure
    states = structure.states + (linear.reach[:-1] @ by + part * linear.gap[:-1])
    by, m = by.copy(), structure.size
    times = np.clip(structure.times + by[:m], 0.0, structure.duration + by[m])
    later = np.maximum.accumulate(times)
    times = np.where(later - times <= _TIED * structure.duration, later, times)
    by[:m] = times - structure.times
    order = np.argsort(times, kind="stable")
    return structure.moved(by, states), order != np.arange(structure.size)
