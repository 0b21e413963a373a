"""Optimisation of a structure's times: descent on the manifold of motions that reach the goal.

Every step goes along the tangent, as far as a quadratic model of the Lagrangian is trusted, and is projected back by
Newton's method with the least change (Absil, Mahony and Sepulchre, Optimization Algorithms on Matrix
Manifolds, 2008, chapter 7). The duration falls from one motion to the next. Changes of different joints pass each
other freely: torques of different joints commute, so that nothing jumps when changes pass.
"""

from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array
from armdyn.locks import cached_property
from armdyn.optimal.arcs.arc import VELOCITY
from armdyn.optimal.problem.status import Budget
from armdyn.optimal.switching.extremal.landing import landed, moved_by
from armdyn.optimal.switching.extremal.quadratic_model import LinearizedRollout, Model, lengths_of
from armdyn.optimal.switching.extremal.rollout import Rollout, ShootingProblem
from armdyn.optimal.switching.extremal.state_limits import beyond_position, excess, with_limits, within_limits
from armdyn.optimal.switching.extremal.structure import SwitchingStructure


@dataclass(frozen=True, eq=False)
class Extremal:
    """Stationary motion: no small change of its switching times shortens it.

    Attributes:
        linear: the rollout with its derivatives in the times.
    """

    linear: LinearizedRollout

    @property
    def costates(self) -> tuple[Array, Array]:
        """Costates at the starts and ends of the steps, each of shape (steps, 2 nv)."""
        return self.linear.costates

    @property
    def multipliers(self) -> Array:
        """Multipliers of the equations."""
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
    def shooting(self) -> ShootingProblem:
        """The shooting problem: limits, dynamics, tuned numbers."""
        return self.linear.rollout.shooting

    @property
    def structure(self) -> SwitchingStructure:
        """Structure of the extremal."""
        return self.rollout.structure


@dataclass(frozen=True, eq=False)
class NoExtremal:
    """A structure without an extremal.

    Attributes:
        why: the reason, in words.
        linear: the last motion; None: no motion.
    """

    why: str
    linear: LinearizedRollout | None = None


def fastest(shooting: ShootingProblem, structure: SwitchingStructure) -> Extremal | NoExtremal:
    """Find the extremal near a structure.

    Args:
        shooting: the shooting problem.
        structure: initial structure; times and states may be inconsistent.
    """
    linear = landed(shooting, structure)
    if linear is None:
        return NoExtremal("no motion near the mesh's ends in the goal")
    linear = _touching(shooting, linear)
    numbers = shooting.policy.descent
    radius = numbers.radius * structure.duration
    for _ in range(numbers.steps):
        if shooting.budget:
            return NoExtremal(shooting.budget.word, linear)
        model = Model.of(linear)
        if not np.all(np.isfinite(model.quadratic.hessian)):
            return NoExtremal("the motion next to it overflows", linear)
        if linear.gradient_norm <= numbers.flat:
            return Extremal(linear)
        step = model.step(radius)
        while True:
            if step.promised < numbers.worth * structure.duration or radius < numbers.narrow * structure.duration:
                if linear.gradient_norm <= numbers.nearly_flat:
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
        assert after is not None  # noqa: S101 - otherwise there was no gain
        linear = _without_vanished(shooting, _within_limits(shooting, linear, step.by, after))
    return NoExtremal(f"{numbers.steps} steps did not reach an extremal", linear)


def _within_limits(
    shooting: ShootingProblem, linear: LinearizedRollout, by: Array, after: LinearizedRollout
) -> LinearizedRollout:
    """The motion after a step, shortened to touch position limits if the motion exceeds these.

    Args:
        shooting: the shooting problem.
        linear: motion before the step.
        by: step of the unknowns.
        after: motion after the step.
    """
    there, low, high, numbers = after, 0.0, 1.0, shooting.policy.descent
    for _ in range(numbers.halves):
        kept = within_limits(there.rollout)
        if (kept and high == 1.0) or (not kept and excess(there.rollout) <= numbers.near):
            break
        part = (low + high) / 2
        halved = _stepped(shooting, linear, part * by)
        if halved is None:
            return after
        low, high = (part, high) if within_limits(halved.rollout) else (low, part)
        there = halved
    return _touching(shooting, there)


def _touching(shooting: ShootingProblem, linear: LinearizedRollout) -> LinearizedRollout:
    """The motion with touches of the position limits that it exceeds, if there is one nearby."""
    numbers, overlooked = shooting.policy.descent, shooting.policy.rollout.beyond
    for _ in range(numbers.touches):
        beyond = beyond_position(linear.rollout)
        structure = with_limits(linear.rollout) if beyond <= numbers.far_beyond else None
        touching = landed(shooting, structure) if structure else None
        most_cost = numbers.touch_cost if beyond > overlooked else numbers.arc_cost
        if (
            touching is None
            or touching.rollout.structure.duration > (1 + most_cost) * linear.rollout.structure.duration
        ):
            return linear
        linear = touching
    return linear


def in_one_piece(extremal: Extremal, offset: Array | float = 0.0) -> Extremal:
    """Close the gaps between a structure's arcs that rounding leaves.

    Args:
        extremal: extremal whose arcs join to 1e-9, an error that an unstable arm amplifies.
        offset: offset of the end state from the goal, (q, v), shape (2 nv,).

    Returns:
        The extremal; unchanged if no motion without gaps is near.
    """
    shooting = replace(extremal.rollout.shooting, offset=offset)
    linear = landed(shooting, extremal.structure, shooting.policy.descent.near_rounds, in_one=True)
    return extremal if linear is None else Extremal(linear)


def finer(extremal: Extremal, budget: Budget) -> Extremal | None:
    """Solve the same structure with twice the steps; None at the largest number of steps, or without an extremal.

    Args:
        extremal: extremal with too long steps.
        budget: budget of its integrator steps.
    """
    shooting = extremal.rollout.shooting.finer(extremal.rollout)
    found = fastest(replace(shooting, budget=budget), extremal.structure) if shooting else None
    return found if isinstance(found, Extremal) else None


def _stepped(shooting: ShootingProblem, linear: LinearizedRollout, by: Array) -> LinearizedRollout | None:
    """The motion after a step along the tangents."""
    structure, joined = moved_by(linear, by, 1.0)
    return landed(shooting, structure, shooting.policy.descent.near_rounds, joined, tied=True)


def _without_vanished(shooting: ShootingProblem, linear: LinearizedRollout) -> LinearizedRollout:
    """The motion without segments of zero length, and without touches within contacts.

    On velocity limits they stay: a joint may have to reach the limit just as its torque switches.
    """
    structure, numbers = linear.rollout.structure, shooting.policy.descent
    lengths = lengths_of(structure) @ structure.unknowns
    short = [
        segment
        for segment, length in zip(structure.segments(), lengths, strict=True)
        if length < numbers.vanished * structure.duration and structure.mode_of(segment) not in VELOCITY
    ]
    left = structure.without(short) if short else structure
    left = left.without_changes(left.idle_touches)
    return linear if left.size == structure.size else landed(shooting, left, numbers.near_rounds) or linear
