"""A motion of bang arcs in segments, and Newton's method on the conditions of the fastest one.

Every segment is integrated from its own first state (multiple shooting; Bock and Plitt, IFAC World Congress 1984).
Unknowns are the arcs' lengths and the segments' first states; the duration is least while all segments meet. Each step
solves for the least duration of the quadratic model where the linear equations hold (sequential quadratic programming;
Nocedal and Wright, Numerical Optimization, chapter 18), with the reduced Hessian made positive definite.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.dynamics.numeric import forward_dynamics, forward_dynamics_derivatives
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import OPTIMALITY_TOLERANCE
from armdyn.optimal.verify.rollout import gauss_steps


def carried(flow: Array, costate: Array) -> Array:
    """Costates within segments from those at their starts.

    Args:
        flow: derivatives of the states there by the first states, shape (Q, S, 2 nv, 2 nv).
        costate: at the starts, shape (S, 2 nv).

    Returns:
        Shape (Q, S, 2 nv).
    """
    each = np.broadcast_to(costate[..., None], (*flow.shape[:3], 1))
    return np.asarray(np.linalg.solve(flow.swapaxes(2, 3), each)[..., 0])


@dataclass(frozen=True, eq=False)
class BangMotion:
    """Segments of a motion of bang arcs, not necessarily meeting.

    Values are scaled: states by the joints' ways and speeds, times by the duration.

    Attributes:
        task: the minimum-time problem, with constant torque limits, and its settings.
        tau: torques of the segments [N m or N], shape (S, nv).
        arc_of: arc of each segment, shape (S,).
        share: each segment's part of its arc, shape (S,).
        size: scales of the states, shape (2 nv,).
        unit: scale of times [s].
        lengths: of the arcs, shape (K,).
        x: first states of the segments, shape (S, 2 nv).
        goal: the last state, shape (2 nv,).
        costate: multipliers of the segments' ends, shape (S, 2 nv): costates where they meet.
        states: of each step, from the segments' starts to their ends, shape (Q, S, 2 nv).
        flow: their derivatives by the segments' first states, shape (Q, S, 2 nv, 2 nv).
        rate: rates of the state at the ends, shape (S, 2 nv).
    """

    task: Task
    tau: Array
    arc_of: Index
    share: Array
    size: Array
    unit: float
    lengths: Array
    x: Array
    goal: Array
    costate: Array
    states: Array
    flow: Array
    rate: Array

    @classmethod
    def of(cls, task: Task, signs: Array, arcs: Array, near: tuple[Array, Array], size: Array) -> Self:
        """Divide arcs into segments of about the same length, without costates.

        Args:
            task: the problem and its settings.
            signs: signs of the arcs' torques, shape (K, nv).
            arcs: lengths of the arcs [s], shape (K,).
            near: a motion near it: parts of its duration, shape (samples,), and (q, v), shape (samples, 2 nv).
            size: scales of the states, shape (2 nv,).
        """
        problem, duration = task.problem, float(np.sum(arcs))
        lengths = arcs / duration
        counts = np.maximum(np.ceil(task.policy.polish.segments * lengths).astype(int), 1)
        arc_of = np.repeat(np.arange(counts.size), counts)
        begins = np.append(0.0, np.cumsum(lengths[arc_of] / counts[arc_of])[:-1])
        x = np.stack([np.interp(begins, near[0], each) for each in near[1].T], axis=1)
        x[0] = problem.x_start
        tau = problem.limits.actuators.extreme(signs)[arc_of]
        own = (tau, arc_of, 1 / counts[arc_of], size, duration, lengths, x / size, problem.x_goal / size)
        return cls(task, *own, *np.zeros((4, *x.shape))).integrated(lengths, x / size)

    @property
    def seconds(self) -> Array:
        """Lengths of the segments [s], shape (S,)."""
        return np.asarray(self.lengths[self.arc_of] * self.share * self.unit)

    def integrated(self, lengths: Array, x: Array) -> Self:
        """The motion with other lengths and first states, integrated."""
        count, step, n = self.task.policy.polish.steps, gauss_steps(self.task.problem.robot), self.task.problem.robot.nv
        own, torques = replace(self, lengths=lengths, x=x), np.stack([self.tau, self.tau], axis=1)
        states, flows = [x * self.size], [np.tile(np.eye(2 * n), (len(x), 1, 1))]
        for _ in range(count):
            end, flow, _ = step(own.seconds / count, states[-1], torques)
            states.append(end)
            flows.append((flow * self.size / self.size[:, None]) @ flows[-1])
        a = forward_dynamics(self.task.problem.robot)(end[:, :n], end[:, n:], self.tau)
        rate = np.concatenate([end[:, n:], a], axis=1) * self.unit / self.size
        return replace(own, states=np.array(states) / self.size, flow=np.array(flows), rate=rate)

    @property
    def finite(self) -> bool:
        """Whether all segments were integrated."""
        return all(np.all(np.isfinite(each)) for each in (self.states, self.flow, self.rate))

    @property
    def gaps(self) -> Array:
        """Distances of the segments' ends from the next first states, shape (S, 2 nv)."""
        return np.asarray(self.states[-1] - np.vstack([self.x[1:], self.goal]))

    @property
    def errors(self) -> tuple[float, float]:
        """The largest gap, and the largest derivative of the Lagrangian.

        Its derivatives by the arcs' lengths are their H, those by inner first states the errors of the adjoint
        equations.
        """
        rates = np.sum(self.rate * self.costate, axis=1) * self.share
        by_lengths = 1 + np.bincount(self.arc_of, rates, self.lengths.size)
        by_states = np.einsum("sab,sa->sb", self.flow[-1, 1:], self.costate[1:]) - self.costate[:-1]
        stationary = max(np.max(np.abs(by_lengths)), np.max(np.abs(by_states), initial=0.0))
        return float(np.max(np.abs(self.gaps))), float(stationary)

    @property
    def settled(self) -> bool:
        """Whether the segments meet, and the conditions of the fastest motion hold."""
        gap, stationary = self.errors
        return gap <= self.task.policy.shooting.closed and stationary <= OPTIMALITY_TOLERANCE / 100

    @property
    def objective(self) -> Array:
        """Gradient of the duration by lengths and inner first states."""
        return np.append(np.ones(self.lengths.size), np.zeros(self.x[1:].size))

    @property
    def jacobian(self) -> Array:
        """Derivatives of the gaps by lengths and inner first states, shape (S 2 nv, K + (S - 1) 2 nv)."""
        (S, m), K = self.x.shape, self.lengths.size
        rows = np.zeros((S, m, K + m * (S - 1)))
        rows[np.arange(S), :, self.arc_of] = self.rate * self.share[:, None]
        for k in range(1, S):
            rows[k, :, K + m * (k - 1) : K + m * k] = self.flow[-1, k]
            rows[k - 1, :, K + m * (k - 1) : K + m * k] = -np.eye(m)
        return rows.reshape(S * m, -1)

    @property
    def hessian(self) -> Array:
        """Second derivatives of the Lagrangian by lengths and inner first states."""
        (S, m), K, own = self.x.shape, self.lengths.size, self.curvature
        found = np.zeros((K + m * (S - 1), K + m * (S - 1)))
        for k, (arc, share) in enumerate(zip(self.arc_of, self.share, strict=True)):
            found[arc, arc] += own[k, m, m] * share**2
            if k:
                at = slice(K + m * (k - 1), K + m * k)
                found[at, at] = own[k, :m, :m]
                found[at, arc] = found[arc, at] = own[k, :m, m] * share
        return found

    @property
    def curvature(self) -> Array:
        """Second derivatives of costateᵀ(end) by first state and length, shape (S, 2 nv + 1, 2 nv + 1).

        By the first states ∫ Φᵀ (∂²H/∂x²) Φ dt, with the costates along the segment and the sensitivities Φ there, by
        Simpson's rule; ∂²H/∂x² by central differences of the Jacobian of the dynamics.
        """
        count, m, h, flow = self.task.policy.polish.steps, self.size.size, self.seconds, self.flow
        x, difference = self.states * self.size, self.task.policy.polish.difference
        along = carried(flow, np.einsum("sab,sa->sb", flow[-1], self.costate))
        moved = difference * np.diag(self.size)[:, None, None, :]
        both = np.stack([x + moved, x - moved])
        upward, downward = np.einsum("diqsab,qsa->diqsb", self._jacobian(both), along)
        by_x = np.moveaxis((upward - downward) / (2 * difference), 0, -2) * h[:, None, None]
        weights = np.array([1.0, *[4.0, 2.0] * (count // 2 - 1), 4.0, 1.0]) / (3 * count)
        found = np.zeros((h.size, m + 1, m + 1))
        bent = (by_x + by_x.swapaxes(-1, -2)) / 2
        found[:, :m, :m] = np.einsum("q,qsab->sab", weights, flow.swapaxes(2, 3) @ bent @ flow)
        rate = np.einsum("sab,sa->sb", self._jacobian(x[-1]), self.costate) * self.unit
        found[:, :m, m] = found[:, m, :m] = np.einsum("sab,sa->sb", flow[-1], rate)
        found[:, m, m] = np.sum(rate * self.rate, axis=1)
        return found

    def _jacobian(self, x: Array) -> Array:
        """∂ẋ/∂x per second, scaled, shape (…, S, 2 nv, 2 nv), at states of the segments [SI], shape (…, S, 2 nv)."""
        n, m = self.tau.shape[1], self.size.size
        flat, tau = x.reshape(-1, m), np.tile(self.tau, (x.size // self.x.size, 1))
        _, by_q, by_v, _ = forward_dynamics_derivatives(self.task.problem.robot)(flat[:, :n], flat[:, n:], tau)
        upper = np.broadcast_to(np.eye(n, m, n), (len(flat), n, m))
        found = np.concatenate([upper, np.concatenate([by_q, by_v], axis=-1)], axis=-2)
        return np.asarray(found.reshape(*x.shape, m) * self.size / self.size[:, None])

    def moved(self, change: Array, costate: Array) -> "BangMotion | None":
        """The motion after a change of lengths and inner first states; None without positive lengths or finite ends."""
        K = self.lengths.size
        lengths, x = self.lengths + change[:K], self.x.copy()
        x[1:] += change[K:].reshape(x[1:].shape)
        if np.min(lengths) <= 0:
            return None
        found = replace(self.integrated(lengths, x), costate=costate)
        return found if found.finite else None

    def with_costates(self) -> "BangMotion | None":
        """The motion with the multipliers that violate the conditions least; None if it was not integrated."""
        if not self.finite:
            return None
        least = np.asarray(np.linalg.lstsq(self.jacobian.T, -self.objective, rcond=None)[0])
        return replace(self, costate=least.reshape(self.x.shape))


def fastest(motion: BangMotion) -> tuple[BangMotion, Array | None]:
    """The fastest motion of the same arcs near a motion.

    Returns:
        The motion, and None if it is the fastest. Else the last one, and the lengths of the arcs that Newton's method
        proposed, shape (K,); without arcs of negative length there, it failed.
    """
    before = np.inf
    for _ in range(motion.task.policy.polish.rounds):
        gap, _ = motion.errors
        if motion.task.stop or (
            motion.settled and (gap <= motion.task.policy.shooting.closed / 10 or gap > before / 2)
        ):
            break
        before = gap
        if (found := _step(motion)) is None:
            break
        change, costate = found
        if (better := _accepted(motion, change, costate)) is None:
            return motion, None if motion.settled else motion.lengths + change[: motion.lengths.size]
        motion = better
    return motion, None if motion.settled else motion.lengths


def _step(motion: BangMotion) -> tuple[Array, Array] | None:
    """Change of lengths and states, and the new costates; None if there are fewer unknowns than equations."""
    jacobian, hessian, gradient = motion.jacobian, motion.hessian, motion.objective
    size, unknowns = jacobian.shape
    if unknowns < size:
        return None
    basis, upper = np.linalg.qr(jacobian.T, mode="complete")
    own, null, upper = basis[:, :size], basis[:, size:], upper[:size]
    closed = motion.task.policy.shooting.closed
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

    before = merit(motion)
    for k in range(motion.task.policy.polish.halves):
        part = 0.5**k
        found = motion.moved(part * change, motion.costate + part * (costate - motion.costate))
        if found is not None and (merit(found) < before or max(found.errors) < (1 - part / 10) * max(motion.errors)):
            return found
    return None
