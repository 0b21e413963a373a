"""Times of a schedule that are fastest: down the manifold of motions that end in the goal.

Every step goes along the tangent, as far as a quadratic model of the Lagrangian is trusted, and is brought back by
Newton's method with the least change (Absil, Mahony and Sepulchre, Optimization Algorithms on Matrix
Manifolds, 2008, chapter 7). The duration falls from one motion to the next. Changes of different joints pass each
other freely: torques that act on different joints commute, so that nothing jumps where they do.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.arcs.arc import VELOCITY
from armdyn.optimal.problem.stop import Budget, Stop
from armdyn.optimal.switching.extremal.landing import landed, moved_by
from armdyn.optimal.switching.extremal.limits import BEYOND, beyond_position, excess, with_limits
from armdyn.optimal.switching.extremal.march import March, Setting
from armdyn.optimal.switching.extremal.model import Linear, Model, lengths_of
from armdyn.optimal.switching.extremal.schedule import Schedule

Array = NDArray[np.float64]

_AGAIN = 4
"""Rounds of Newton's method from a motion beside."""
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
_SLOW = 0.5
"""The same for velocity limits alone, which the motion was beyond for long."""
_TOUCHES = 3
"""Times that touches are put in: one may bring about another."""
_RADIUS = 0.03
"""Of the duration: how far the model is trusted at first."""
_STEPS = 20
"""Along tangents, at most: of random pairs of RRR those that came to an extremal took 13 at most."""
_NARROW = 1e-6
"""Of the duration: a model that is not to be trusted so far is none."""
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
            other = _other_order(setting, linear)
            if other is None:
                return Extremal(linear)
            linear = other
            continue
        step = model.step(radius)
        while True:
            if step.promised < _WORTH * schedule.duration or radius < _NARROW * schedule.duration:
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


def _other_order(setting: Setting, linear: Linear) -> Linear | None:
    """The same motion with two changes at one time in the other order, if it can be shortened from there."""
    for k, after in linear.ties:
        swapped = landed(setting, linear.march.schedule.swapped(k, after), _AGAIN)
        longer = swapped is None or swapped.march.schedule.duration > (1 + _VANISHED) * linear.march.schedule.duration
        if swapped is not None and not longer and swapped.slope > _FLAT:
            return swapped
    return None


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
        schedule = with_limits(linear.march) if beyond_position(linear.march) <= _FAR_BEYOND else None
        touching = landed(setting, schedule) if schedule else None
        dear = _DEAR if beyond_position(linear.march) > BEYOND else _SLOW
        if touching is None or touching.march.schedule.duration > (1 + dear) * linear.march.schedule.duration:
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
    linear = landed(setting, extremal.schedule, _AGAIN, in_one=True)
    return extremal if linear is None else Extremal(linear)


def finer(extremal: Extremal, stop: Stop) -> Extremal | None:
    """The same structure in twice the steps; None: it has the most, or nothing comes of it.

    Args:
        extremal: whose steps are too long.
        stop: asked before every step along a tangent.
    """
    setting = extremal.march.setting.finer
    if setting is not None and isinstance(stop, Budget):
        setting = replace(setting, budget=stop)
    found = fastest(setting, extremal.schedule, stop) if setting else None
    return found if isinstance(found, Extremal) else None


def _stepped(setting: Setting, linear: Linear, by: Array) -> Linear | None:
    """The motion after a step along the tangent."""
    schedule, joined = moved_by(linear, by, 1.0)
    return landed(setting, schedule, _AGAIN, joined, tied=True)


def _without_vanished(setting: Setting, linear: Linear) -> Linear:
    """The same motion without segments whose length has gone to nothing.

    On a limit of velocity they stay: a joint may have to meet it just where its torque switches.
    """
    schedule = linear.march.schedule
    lengths = lengths_of(schedule) @ schedule.unknowns
    short = [
        segment
        for segment, length in zip(schedule.segments(), lengths, strict=True)
        if length < _VANISHED * schedule.duration and schedule.mode_of(segment) not in VELOCITY
    ]
    return (landed(setting, schedule.without(short), _AGAIN) or linear) if short else linear
