"""Lower bound on the duration of a motion that passes regions, and stays on lines between them.

As for a leg (`proof.py`), for any multipliers w(t), continuous, and λ(t),

    ∫ λᵀ v dt = w(0)ᵀ p(0) − w(T)ᵀ p(T) + ∫ (λ + M ẇ)ᵀ v + wᵀ (τ + e) dt.

Here λ is constant between nodes at which something is known of the positions, and jumps there, so that the left side is

    λ_last ᵀ q(T) − λ_first ᵀ q(0) + Σ_k (λ_before − λ_behind)ᵀ q_k,

of which every term has its least value over the positions that its node admits. In every elastic cell w is constant and
the integrand at most some ρ. With H the sum of all fixed cells, S the integral's upper bound there, and c the time in
the elastic ones, Λ ≤ S + max ρ c. The momentum at a region that is passed counts on both its sides and cancels: no
bound of the velocity there is lost. The multipliers are those of a linear program in the cells' mean velocities, the
positions at the nodes, and the elastic cells' ways and lengths, whose sum is minimised. Any others would do.
"""

from collections.abc import Callable, Sequence

import numpy as np

from armdyn.optimal.bound.course import Course, Phase
from armdyn.optimal.bound.course_program import CourseMultipliers, relaxed_course
from armdyn.optimal.bound.enclosure.interval import Interval, down, rounding
from armdyn.optimal.bound.forces import Forces
from armdyn.optimal.bound.leg import BoundLeg, LegEnd
from armdyn.optimal.bound.reach import at_ends
from armdyn.optimal.bound.terms import terms_over


def course_bound(
    leg: BoundLeg, phases: Sequence[Phase], known: float, longest: float, stop: Callable[[], bool]
) -> float:
    """Lower bound on the duration of a leg in phases [s].

    Args:
        leg: between joint positions, or boxes of them.
        phases: of it.
        known: a bound that is proven already [s].
        longest: no motion that takes longer [s] is spoken of: the bound is no more than that.
        stop: polled now and then; once it is true, the bound that is proven so far is returned.
    """
    course = Course.of(leg, phases, longest)
    if course is None:
        return longest
    if np.all(course.elastic):
        return known  # momentum says nothing of motions that may take no time
    course = course.narrowed(leg, course.reached(leg, _forces(leg, course)))
    if course is None:
        return longest
    forces, ends = _forces(leg, course), course.ends(leg)
    by = None if stop() else relaxed_course(leg, course, forces, ends, known)
    return known if by is None else max(known, min(_proven(leg, course, forces, ends, by), longest))


def _forces(leg: BoundLeg, course: Course) -> Forces:
    actuators = leg.torque.actuators
    torque = Interval(actuators.lower, actuators.upper).spread(course.v.lower.shape)
    return Forces(terms_over(leg.dynamics, course.q), course.v, torque, leg.friction)


def _proven(
    leg: BoundLeg, course: Course, forces: Forces, ends: Sequence[LegEnd | None], by: CourseMultipliers
) -> float:
    """No motion along the course is faster than this [s]; 0 says nothing."""
    fixed, elastic = np.flatnonzero(~course.elastic), np.flatnonzero(course.elastic)
    lengths, w, way = Interval.at(course.lengths[fixed]), by.momentum, Interval.at(by.way)
    steps = (Interval.at(w[1:][fixed]) - Interval.at(w[:-1][fixed])) / lengths[:, None]
    both = np.stack([w[:-1][fixed], w[1:][fixed]], axis=2)
    rates = forces[fixed].rate(both, way[fixed][:, :, None], steps[:, :, None])
    made = (lengths * ((rates[:, 0] + rates[:, 1]) * Interval.at(0.5))).sum(0) + at_ends(leg, w)
    free = forces[elastic].rate(w[:-1][elastic][:, :, None], way[elastic][:, :, None])
    left = float((Interval.at(_least_ways(ends, by)) - made).lower)
    rate = float(np.max(free.upper))
    if left <= 0:
        return 0.0
    if rate <= 0:
        return np.inf
    return float((lengths.sum(0) + Interval.at(down(np.array(left))) / Interval.at(rate)).lower)


def _least_ways(ends: Sequence[LegEnd | None], by: CourseMultipliers) -> float:
    """Least ∫ λᵀ v dt over all positions at the nodes, rounded down."""
    none, total = np.zeros_like(by.way[:1]), Interval.at(0.0)
    jumps = np.concatenate([none, by.way]) - np.concatenate([by.way, none])
    for end, jump, combination in zip(ends, jumps, by.combinations, strict=True):
        if end is not None and np.any(jump):
            beside = rounding(2, np.abs(jump) @ end.q.magnitude)
            total = total + Interval.at(end.least(jump, combination) - beside)
    return float(total.lower)
