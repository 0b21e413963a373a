"""Times of a schedule that are fastest: down the manifold of motions that end in the goal.

Every step goes along the tangent, as far as a quadratic model of the Lagrangian is trusted, and is brought back by
Newton's method with the least change of the times (Absil, Mahony and Sepulchre, Optimization Algorithms on Matrix
Manifolds, 2008, chapter 7). The duration falls from one motion to the next. Changes of different joints pass each
other freely: torques that act on different joints commute, so that nothing jumps where they do.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.switching.extremal.limits import BEYOND, excess, with_limits
from armdyn.optimal.switching.extremal.march import March, Setting
from armdyn.optimal.switching.extremal.model import Linear, Model, lengths_of
from armdyn.optimal.switching.extremal.schedule import Schedule
from armdyn.optimal.switching.extremal.trust import null_space

Array = NDArray[np.float64]

_CLOSED = 1e-9
"""Gaps and misses that are none, in parts of `March.unit`: the integrator's own."""
_ROUNDS = 30
"""Of Newton's method from a mesh's states, that of a heavy arm with singular arcs."""
_AGAIN = 4
"""The same from a motion beside."""
_FAR = 0.5
"""A correction of a time by more than this part of the duration says that there is nothing near."""
_STATES = 0.1
"""What a state that is moved by `March.unit` counts, beside a time that is moved by the duration."""
_SWING = 0.3
"""Of `March.unit`: states are moved by no more at once."""
_RANK = 1e-12
"""Of the largest singular value: rounding, of equations that an arm in the open answers to a millionfold."""
_KEPT = 0.2
"""Part of a segment that one correction leaves at least."""
_VANISHED = 1e-8
"""Of the duration: a segment that is none."""
_HALVES = 12
"""Of a step that goes beyond a limit of position, at most."""
_NEAR = 1e-3
"""Beyond a limit of position by so much it is near enough for a touch [rad or m]."""
_FAR_BEYOND = 0.3
"""The same for a motion as it lands first."""
_DEAR = 0.05
"""Of the duration: what touches may take at most."""
_TOUCHES = 3
"""Times that touches are put in: one may bring about another."""
_RADIUS = 0.03
"""Of the duration: how far the model is trusted at first."""
_STEPS = 30
"""Along tangents, at most; from a mesh ten do."""
_FLAT = 1e-6
"""∂t_f/∂(time of a change), beside 1 for time, that is none: a hundredth of what is certified."""
_NEARLY_FLAT = 1e-4
"""The same where the model promises nothing any more: what is certified."""
_WORTH = 1e-12
"""Of the duration: what a step must promise."""


@dataclass(frozen=True, eq=False)
class Extremal:
    """A motion whose duration no change of its times shortens.

    Attributes:
        linear: it, and how it answers to its times.
    """

    linear: Linear

    @property
    def costates(self) -> tuple[Array, Array]:
        """At the starts and ends of the steps, each of shape (steps, 2 nv)."""
        return self.linear.costates

    @property
    def multipliers(self) -> Array:
        """Of the equations."""
        return self.linear.multipliers

    @cached_property
    def switching(self) -> Array:
        """The switching functions at the starts and ends of the steps, shape (2 steps, nv)."""
        return self.march.switching(self.costates)

    @property
    def march(self) -> March:
        """The motion."""
        return self.linear.march

    @property
    def schedule(self) -> Schedule:
        """Its schedule."""
        return self.march.schedule


@dataclass(frozen=True, eq=False)
class Resisted:
    """A schedule that led to no extremal.

    Attributes:
        why: for people.
        linear: the motion that it came to; None: none.
    """

    why: str
    linear: Linear | None = None


def fastest(setting: Setting, schedule: Schedule, stop: Stop) -> Extremal | Resisted:
    """The extremal near a schedule.

    Args:
        setting: what is marched.
        schedule: times and states that need not fit each other.
        stop: asked before every step.
    """
    linear = landed(setting, schedule)
    if linear is None:
        return Resisted("no motion near the mesh's ends in the goal")
    linear = _touching(setting, linear)
    radius = _RADIUS * schedule.duration
    for _ in range(_STEPS):
        if stop:
            return Resisted(stop.word, linear)
        model = Model.of(linear)
        if not np.all(np.isfinite(model.parabola.bend)):
            return Resisted("the motion beside it leaves what numbers can hold", linear)
        if linear.slope <= _FLAT:
            return Extremal(linear)
        step = model.step(radius)
        while True:
            if step.promised < _WORTH * schedule.duration:
                if linear.slope <= _NEARLY_FLAT:
                    return Extremal(linear)
                return Resisted("no step shortens the motion any more", linear)
            after = _stepped(setting, linear, step.by)
            gained = linear.march.schedule.duration - after.march.schedule.duration if after else -np.inf
            if gained >= 0.05 * step.promised:
                break
            radius = min(radius, float(np.linalg.norm(step.by))) / 4
            step = model.step(radius)
        if gained > 0.7 * step.promised and step.bound:
            radius *= 2.5
        assert after is not None  # noqa: S101 - else nothing is gained
        linear = _without_vanished(setting, _within_limits(setting, linear, step.by, after))
    return Resisted(f"{_STEPS} steps did not reach an extremal", linear)


def _within_limits(setting: Setting, linear: Linear, by: Array, after: Linear) -> Linear:
    """The motion after a step or, if that exceeds limits of position, as far as it takes to touch them.

    Args:
        setting: what is marched.
        linear: before the step.
        by: what the unknowns change by in it.
        after: after it.
    """
    there, low, high = after, 0.0, 1.0
    for _ in range(_HALVES):
        beyond = excess(there.march)
        if BEYOND < beyond <= _NEAR or (high == 1.0 and beyond <= BEYOND):
            break
        part = (low + high) / 2
        halved = _stepped(setting, linear, part * by)
        if halved is None:
            return after
        low, high = (part, high) if excess(halved.march) <= BEYOND else (low, part)
        there = halved
    return _touching(setting, there)


def _touching(setting: Setting, linear: Linear) -> Linear:
    """The motion with touches of the limits of position that it exceeds, if one with them is near."""
    for _ in range(_TOUCHES):
        schedule = with_limits(linear.march) if excess(linear.march) <= _FAR_BEYOND else None
        touching = landed(setting, schedule) if schedule else None
        if touching is None or touching.march.schedule.duration > (1 + _DEAR) * linear.march.schedule.duration:
            return linear
        linear = touching
    return linear


def ended(extremal: Extremal, offset: Array | float = 0.0) -> Extremal:
    """The same structure in one piece, without the gaps that its arcs have by rounding.

    Args:
        extremal: whose arcs begin where the ones before end to 1e-9; an arm in the open carries that on and on.
        offset: how far beside the goal it is to end, in (q, v), shape (2 nv,).

    Returns:
        It; as it was, if nothing in one piece is near.
    """
    setting = replace(extremal.march.setting, offset=offset)
    linear = landed(setting, extremal.schedule, _AGAIN, np.ones(extremal.schedule.size, bool))
    return extremal if linear is None else Extremal(linear)


def finer(extremal: Extremal, stop: Stop) -> Extremal | None:
    """The same structure in twice the steps; None: it has the most, or nothing comes of it.

    Args:
        extremal: whose steps are too long.
        stop: asked before every step along a tangent.
    """
    setting = extremal.march.setting.finer
    found = fastest(setting, extremal.schedule, stop) if setting else None
    return found if isinstance(found, Extremal) else None


def landed(
    setting: Setting, schedule: Schedule, rounds: int = _ROUNDS, joined: NDArray[np.bool_] | None = None
) -> Linear | None:
    """A motion that ends in the goal and keeps what is held, by the least change of the times; None: none is near.

    Args:
        setting: what is marched.
        schedule: to begin with.
        rounds: of Newton's method.
        joined: its changes whose states are not theirs, see `March.of`; where all are, the motion stays in one piece.
    """
    in_one = joined is not None and bool(np.all(joined))
    for k in range(rounds + 1):
        if schedule.size + 1 > setting.most_arcs:
            return None
        march = March.of(setting, schedule, joined)
        if not march.finite:
            return None
        linear, schedule = Linear.of(march), march.schedule
        if not np.all(np.isfinite(linear.jacobian)):  # a chain of many arcs may overflow where each does not
            return None
        if linear.infeasible <= _CLOSED:
            return linear
        by, whole = _correction(linear)
        most = float(np.max(np.abs(by[: schedule.size + 1]))) / schedule.duration
        if k == rounds or most > _FAR:
            return None
        part = min(1.0, whole, 0.1 / max(most, 1e-300))
        schedule, moved = _moved(linear, part * by, part)
        joined = np.ones(schedule.size, bool) if in_one else moved
    return None


def _correction(linear: Linear) -> tuple[Array, float]:
    """What closes gaps and misses, to first order, and leaves a part of every segment; and how much of it may be.

    The least change, of the times as parts of the duration and of the states: an arm in the open answers to a time a
    millionfold, and a least change of the times alone would throw it about.
    """
    schedule, planes, now = linear.march.schedule, linear.planes, linear.planes.now
    unit, width = linear.march.unit, schedule.width
    changes = np.vstack(
        [np.eye(width) / schedule.duration, _STATES * (linear.reach[:-1] / unit[:, None]).reshape(-1, width)]
    )
    moved = np.concatenate([np.zeros(width), _STATES * (linear.gap[:-1] / unit).ravel()])
    least = np.where(planes.lengths, _KEPT * now, 0.0)
    held: list[int] = []
    while True:
        equations = np.vstack([linear.jacobian, planes.rows[held]])
        by = _least_change(equations, np.concatenate([-linear.residual, (least - now)[held]]), changes, moved)
        after = now + planes.rows @ by
        short = [k for k in np.flatnonzero(after < least - 1e-12).tolist() if k not in held]
        if not short or len(equations) >= by.size:
            break
        held.append(min(short, key=lambda k: after[k] - least[k]))
    shares = [(now[k] - least[k]) / (now[k] - after[k]) for k in short if planes.lengths[k]]
    states = (linear.reach[:-1] @ by + linear.gap[:-1]) / unit
    shares.append(_SWING / max(float(np.max(np.abs(states), initial=0.0)), 1e-300))
    return by, float(max(0.0, min([1.0, *shares])))


def _least_change(equations: Array, right: Array, changes: Array, moved: Array) -> Array:
    """The least |changes y + moved| of all y that equations let be."""
    some = np.asarray(np.linalg.lstsq(equations, right, rcond=_RANK)[0], float)
    free = null_space(equations)
    if not len(free):
        return some
    return np.asarray(some - np.linalg.lstsq(changes @ free.T, changes @ some + moved, rcond=_RANK)[0] @ free)


def _moved(linear: Linear, by: Array, part: float) -> tuple[Schedule, NDArray[np.bool_]]:
    """The schedule with other times and the states that fit them; and which changes are at other places now.

    Args:
        linear: where it stands.
        by: what the unknowns change by.
        part: of the gaps that is closed.
    """
    schedule = linear.march.schedule
    states = schedule.states + (linear.reach[:-1] @ by + part * linear.gap[:-1])
    by, m = by.copy(), schedule.size
    by[:m] = np.clip(schedule.times + by[:m], 0.0, schedule.duration + by[m]) - schedule.times
    order = np.argsort(schedule.times + by[:m], kind="stable")
    return schedule.moved(by, states), order != np.arange(schedule.size)


def _stepped(setting: Setting, linear: Linear, by: Array) -> Linear | None:
    """The motion after a step along the tangent."""
    schedule, joined = _moved(linear, by, 1.0)
    return landed(setting, schedule, _AGAIN, joined)


def _without_vanished(setting: Setting, linear: Linear) -> Linear:
    """The same motion without segments whose length has gone to nothing."""
    schedule = linear.march.schedule
    segments = list(schedule.segments())
    gone = np.flatnonzero(lengths_of(schedule) @ schedule.unknowns < _VANISHED * schedule.duration)
    if not gone.size:
        return linear
    return landed(setting, schedule.without(segments[k] for k in gone), _AGAIN) or linear
