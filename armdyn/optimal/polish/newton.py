"""Newton's method on the conditions of a fastest motion of given bang arcs.

Unknowns are the arcs' lengths and the segments' first states; the duration is least while all segments meet. Each step
solves for the least duration of the quadratic model where the linear equations hold (sequential quadratic programming;
Nocedal and Wright, Numerical Optimization, chapter 18), with the reduced Hessian made positive definite.
"""

from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.polish.shooting import BangShooting, Ends
from armdyn.optimal.problem.status import Stop
from armdyn.optimal.verify.certificate import OPTIMALITY_TOLERANCE


@dataclass(frozen=True, eq=False)
class BangMotion:
    """Segments of a motion of bang arcs, not necessarily meeting; all values are scaled as in `BangShooting`.

    Attributes:
        shooting: the segments.
        lengths: of the arcs, shape (K,).
        x: first states of the segments, shape (S, 2 nv).
        goal: the last state, shape (2 nv,).
        ends: ends of the segments.
        costate: multipliers of the segments' ends, shape (S, 2 nv): costates where they meet.
    """

    shooting: BangShooting
    lengths: Array
    x: Array
    goal: Array
    ends: Ends
    costate: Array

    @property
    def gaps(self) -> Array:
        """Distances of the segments' ends from the next first states, shape (S, 2 nv)."""
        return np.asarray(self.ends.x - np.vstack([self.x[1:], self.goal]))

    @property
    def by_lengths(self) -> Array:
        """H of each arc, shape (K,): the Lagrangian's derivative by its length."""
        rates = np.sum(self.ends.rate * self.costate, axis=1) * self.shooting.share
        return np.asarray(1 + np.bincount(self.shooting.arc_of, rates, self.lengths.size), float)

    @property
    def by_states(self) -> Array:
        """Errors of the adjoint equations: the Lagrangian's derivatives by inner first states, shape (S - 1, 2 nv)."""
        return np.asarray(np.einsum("sab,sa->sb", self.ends.by_start[1:], self.costate[1:]) - self.costate[:-1])

    @property
    def errors(self) -> tuple[float, float]:
        """The largest gap, and the largest derivative of the Lagrangian."""
        stationary = max(np.max(np.abs(self.by_lengths)), np.max(np.abs(self.by_states), initial=0.0))
        return float(np.max(np.abs(self.gaps))), float(stationary)

    @property
    def jacobian(self) -> Array:
        """Derivatives of the gaps by lengths and inner first states, shape (S 2 nv, K + (S - 1) 2 nv)."""
        (S, m), K = self.x.shape, self.lengths.size
        rows = np.zeros((S, m, K + m * (S - 1)))
        rows[np.arange(S), :, self.shooting.arc_of] = self.ends.rate * self.shooting.share[:, None]
        for k in range(1, S):
            rows[k, :, K + m * (k - 1) : K + m * k] = self.ends.by_start[k]
            rows[k - 1, :, K + m * (k - 1) : K + m * k] = -np.eye(m)
        return rows.reshape(S * m, -1)

    @property
    def hessian(self) -> Array:
        """Second derivatives of the Lagrangian by lengths and inner first states."""
        (S, m), K = self.x.shape, self.lengths.size
        own = self.shooting.hessian(self.lengths, self.ends, self.costate)
        found = np.zeros((K + m * (S - 1), K + m * (S - 1)))
        for k, (arc, share) in enumerate(zip(self.shooting.arc_of, self.shooting.share, strict=True)):
            found[arc, arc] += own[k, m, m] * share**2
            if k:
                at = slice(K + m * (k - 1), K + m * k)
                found[at, at] = own[k, :m, :m]
                found[at, arc] = found[arc, at] = own[k, :m, m] * share
        return found

    def moved(self, change: Array, costate: Array) -> "BangMotion | None":
        """The motion after a change of lengths and inner first states; None without positive lengths or finite ends."""
        K = self.lengths.size
        lengths, x = self.lengths + change[:K], self.x.copy()
        x[1:] += change[K:].reshape(x[1:].shape)
        if np.min(lengths) <= 0:
            return None
        ends = self.shooting.ends(lengths, x)
        return replace(self, lengths=lengths, x=x, ends=ends, costate=costate) if ends.finite else None


def bang_motion(shooting: BangShooting, lengths: Array, x: Array, goal: Array) -> BangMotion | None:
    """A motion with the multipliers that violate the conditions least; None if it was not integrated.

    Args:
        shooting: the segments.
        lengths: of the arcs, shape (K,).
        x: first states of the segments, shape (S, 2 nv).
        goal: the last state, shape (2 nv,). All are scaled.
    """
    ends = shooting.ends(lengths, x)
    if not ends.finite:
        return None
    motion = BangMotion(shooting, lengths, x, goal, ends, np.zeros_like(x))
    jacobian = motion.jacobian
    least = np.asarray(np.linalg.lstsq(jacobian.T, -_objective(motion), rcond=None)[0])
    return replace(motion, costate=least.reshape(x.shape))


def fastest(motion: BangMotion, stop: Stop) -> tuple[BangMotion, Array | None]:
    """The fastest motion of the same arcs near a motion.

    Args:
        motion: motion near it.
        stop: whether the time is up.

    Returns:
        The motion, and None if it is the fastest. Else the last one, and the lengths of the arcs that Newton's method
        proposed, shape (K,); without arcs of negative length there, it failed.
    """
    policy, before = motion.shooting.policy, np.inf
    for _ in range(policy.polish.rounds):
        gap, _ = motion.errors
        if stop or (_settled(motion) and (gap <= policy.shooting.closed / 10 or gap > before / 2)):
            break
        before = gap
        if (found := _step(motion)) is None:
            break
        change, costate = found
        if (better := _accepted(motion, change, costate)) is None:
            return motion, None if _settled(motion) else motion.lengths + change[: motion.lengths.size]
        motion = better
    return motion, None if _settled(motion) else motion.lengths


def _settled(motion: BangMotion) -> bool:
    """Whether the segments meet, and the conditions of the fastest motion hold."""
    gap, stationary = motion.errors
    return gap <= motion.shooting.policy.shooting.closed and stationary <= OPTIMALITY_TOLERANCE / 100


def _objective(motion: BangMotion) -> Array:
    """Gradient of the duration."""
    return np.append(np.ones(motion.lengths.size), np.zeros(motion.x[1:].size))


def _step(motion: BangMotion) -> tuple[Array, Array] | None:
    """Change of lengths and states, and the new costates; None if there are fewer unknowns than equations."""
    jacobian, hessian, gradient = motion.jacobian, motion.hessian, _objective(motion)
    size, unknowns = jacobian.shape
    if unknowns < size:
        return None
    basis, upper = np.linalg.qr(jacobian.T, mode="complete")
    own, null, upper = basis[:, :size], basis[:, size:], upper[:size]
    closed = motion.shooting.policy.shooting.closed
    if np.min(np.abs(np.diag(upper))) <= closed / 10:  # equations that depend on each other, up to rounding
        return None
    change = own @ np.linalg.solve(upper.T, -motion.gaps.ravel())
    if null.size:
        curvature, axes = np.linalg.eigh(null.T @ hessian @ null)
        slope = axes.T @ (null.T @ (gradient + hessian @ change))
        change = change - null @ (axes @ (slope / np.maximum(np.abs(curvature), closed)))
    costate = np.linalg.solve(upper, -own.T @ (gradient + hessian @ change))
    return change, costate.reshape(motion.x.shape)


def _accepted(motion: BangMotion, change: Array, costate: Array) -> BangMotion | None:
    """Line search: the motion after the largest part 1, 1/2, 1/4, … of a step that lowers the merit or the errors.

    The merit is the duration plus an exact penalty of the gaps. None: no part lowers either.
    """
    price = 2 * np.max(np.abs(costate))

    def merit(one: BangMotion) -> float:
        return float(np.sum(one.lengths) + price * np.sum(np.abs(one.gaps)))

    numbers, before = motion.shooting.policy.polish, merit(motion)
    for k in range(numbers.halves):
        part = 0.5**k
        found = motion.moved(part * change, motion.costate + part * (costate - motion.costate))
        if found is not None and (merit(found) < before or max(found.errors) < (1 - part / 10) * max(motion.errors)):
            return found
    return None
