"""Times of a structure that are fastest: down the manifold of motions that end in the goal.

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
from armdyn.optimal.switching.extremal.quadratic_model import LinearizedRollout, Model, lengths_of
from armdyn.optimal.switching.extremal.rollout import Rollout, ShootingProblem
from armdyn.optimal.switching.extremal.state_limits import BEYOND, beyond_position, excess, with_limits
from armdyn.optimal.switching.extremal.structure import SwitchingStructure

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

    linear: LinearizedRollout

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
        return self.rollout.switching(self.costates)

    @property
    def rollout(self) -> Rollout:
        """The motion."""
        return self.linear.rollout

    @property
    def structure(self) -> SwitchingStructure:
        """Its structure."""
        return self.rollout.structure


@dataclass(frozen=True, eq=False)
class NoExtremal:
    """A structure that led to no extremal.

    Attributes:
        why: for people.
        linear: the motion that it came to; None: none.
    """

    why: str
    linear: LinearizedRollout | None = None


def fastest(shooting: ShootingProblem, structure: SwitchingStructure, stop: Stop) -> Extremal | NoExtremal:
    """The extremal near a structure.

    Args:
        shooting: the shooting problem.
        structure: times and states that need not fit each other.
        stop: asked before every step.
    """
    linear = landed(shooting, structure)
    if linear is None:
        return NoExtremal("no motion near the mesh's ends in the goal")
    linear = _touching(shooting, linear)
    radius = _RADIUS * structure.duration
    for _ in range(_STEPS):
        if stop:
            return NoExtremal(stop.word, linear)
        model = Model.of(linear)
        if not np.all(np.isfinite(model.quadratic.hessian)):
            return NoExtremal("the motion beside it leaves what numbers can hold", linear)
        if linear.gradient_norm <= _FLAT:
            other = _other_order(shooting, linear)
            if other is None:
                return Extremal(linear)
            linear = other
            continue
        step = model.step(radius)
        while True:
            if step.promised < _WORTH * structure.duration or radius < _NARROW * structure.duration:
                if linear.gradient_norm <= _NEARLY_FLAT:
                    return Extremal(linear)
                return NoExtremal("no step shortens the motion any more", linear)
            after = _stepped(shooting, linear, step.by)
            gained = linear.rollout.structure.duration - after.rollout.structure.duration if after else -np.inf
            if gained >= 0.05 * step.promised:
                break
            radius = min(radius, float(np.linalg.norm(step.by))) / 4
            step = model.step(radius)
        if gained > 0.7 * step.promised and step.bound:
            radius *= 2.5
        assert after is not None  # noqa: S101 - else nothing is gained
        linear = _without_vanished(shooting, _within_limits(shooting, linear, step.by, after))
    return NoExtremal(f"{_STEPS} steps did not reach an extremal", linear)


def _other_order(shooting: ShootingProblem, linear: LinearizedRollout) -> LinearizedRollout | None:
    """The same motion with two changes at one time in the other order, if it can be shortened from there."""
    for k, after in linear.ties:
        swapped = landed(shooting, linear.rollout.structure.swapped(k, after), _AGAIN)
        longer = (
            swapped is None or swapped.rollout.structure.duration > (1 + _VANISHED) * linear.rollout.structure.duration
        )
        if swapped is not None and not longer and swapped.gradient_norm > _FLAT:
            return swapped
    return None


def _within_limits(
    shooting: ShootingProblem, linear: LinearizedRollout, by: Array, after: LinearizedRollout
) -> LinearizedRollout:
    """The motion after a step or, if that exceeds limits of position, as far as it takes to touch them.

    Args:
        shooting: the shooting problem.
        linear: before the step.
        by: what the unknowns change by in it.
        after: after it.
    """
    there, low, high = after, 0.0, 1.0
    for _ in range(_HALVES):
        beyond = excess(there.rollout)
        if BEYOND < beyond <= _NEAR or (high == 1.0 and beyond <= BEYOND):
            break
        part = (low + high) / 2
        halved = _stepped(shooting, linear, part * by)
        if halved is None:
            return after
        low, high = (part, high) if excess(halved.rollout) <= BEYOND else (low, part)
        there = halved
    return _touching(shooting, there)


def _touching(shooting: ShootingProblem, linear: LinearizedRollout) -> LinearizedRollout:
    """The motion with touches of the limits of position that it exceeds, if one with them is near."""
    for _ in range(_TOUCHES):
        structure = with_limits(linear.rollout) if beyond_position(linear.rollout) <= _FAR_BEYOND else None
        touching = landed(shooting, structure) if structure else None
        dear = _DEAR if beyond_position(linear.rollout) > BEYOND else _SLOW
        if touching is None or touching.rollout.structure.duration > (1 + dear) * linear.rollout.structure.duration:
            return linear
        linear = touching
    return linear


def in_one_piece(extremal: Extremal, offset: Array | float = 0.0) -> Extremal:
    """The same structure in one piece, without the gaps that its arcs have by rounding.

    Args:
        extremal: whose arcs begin where the ones before end to 1e-9; an arm in the open carries that on and on.
        offset: how far beside the goal it is to end, in (q, v), shape (2 nv,).

    Returns:
        It; as it was, if nothing in one piece is near.
    """
    shooting = replace(extremal.rollout.shooting, offset=offset)
    linear = landed(shooting, extremal.structure, _AGAIN, in_one=True)
    return extremal if linear is None else Extremal(linear)


def finer(extremal: Extremal, stop: Stop) -> Extremal | None:
    """The same structure in twice the steps; None: it has the most, or nothing comes of it.

    Args:
        extremal: whose steps are too long.
        stop: asked before every step along a tangent.
    """
    shooting = extremal.rollout.shooting.finer
    if shooting is not None and isinstance(stop, Budget):
        shooting = replace(shooting, budget=stop)
    found = fastest(shooting, extremal.structure, stop) if shooting else None
    return found if isinstance(found, Extremal) else None


def _stepped(shooting: ShootingProblem, linear: LinearizedRollout, by: Array) -> LinearizedRollout | None:
    """The motion after a step along the tangent."""
    structure, joined = moved_by(linear, by, 1.0)
    return landed(shooting, structure, _AGAIN, joined, tied=True)


def _without_vanished(shooting: ShootingProblem, linear: LinearizedRollout) -> LinearizedRollout:
    """The same motion without segments whose length has gone to nothing.

    On a limit of velocity they stay: a joint may have to meet it just where its torque switches.
    """
    structure = linear.rollout.structure
    lengths = lengths_of(structure) @ structure.unknowns
    short = [
        segment
        for segment, length in zip(structure.segments(), lengths, strict=True)
        if length < _VANISHED * structure.duration and structure.mode_of(segment) not in VELOCITY
    ]
    return (landed(shooting, structure.without(short), _AGAIN) or linear) if short else linear
