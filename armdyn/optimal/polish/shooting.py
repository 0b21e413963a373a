"""A motion of bang arcs in segments: their ends, and the first and second derivatives of these.

Every segment is integrated from its own first state (multiple shooting; Bock and Plitt, IFAC World Congress 1984). All
values are scaled: states by the joints' ways and speeds, times by the duration.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.dynamics.numeric import forward_dynamics, forward_dynamics_derivatives
from armdyn.optimal.polish.structure import Switches
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.verify.rollout import gauss_steps


@dataclass(frozen=True, eq=False)
class Ends:
    """Ends of all segments, and the states on the way there.

    Attributes:
        states: of each step, from the segments' starts to their ends, scaled, shape (Q, S, 2 nv).
        flow: their derivatives by the segments' first states, scaled, shape (Q, S, 2 nv, 2 nv).
        rate: rates of the state at the ends, scaled, shape (S, 2 nv).
    """

    states: Array
    flow: Array
    rate: Array

    @property
    def x(self) -> Array:
        """States at the ends, scaled, shape (S, 2 nv)."""
        return np.asarray(self.states[-1])

    @property
    def by_start(self) -> Array:
        """Their derivatives by the first states, scaled, shape (S, 2 nv, 2 nv)."""
        return np.asarray(self.flow[-1])

    @property
    def finite(self) -> bool:
        """Whether all numbers are finite."""
        return all(np.all(np.isfinite(each)) for each in (self.x, self.by_start, self.rate))


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
class BangShooting:
    """Segments of a motion of bang arcs.

    Attributes:
        problem: the minimum-time problem.
        policy: numbers of `polish`, and tolerances of derivatives.
        tau: torques of the segments [N m or N], shape (S, nv).
        arc_of: arc of each segment, shape (S,).
        share: each segment's part of its arc, shape (S,).
        size: scales of the states, shape (2 nv,).
        unit: scale of times [s].
    """

    problem: MinimumTimeProblem
    policy: Policy
    tau: Array
    arc_of: Index
    share: Array
    size: Array
    unit: float

    @classmethod
    def of(cls, problem: MinimumTimeProblem, policy: Policy, switches: Switches, size: Array) -> Self:
        """Divide arcs into segments of about the same length.

        Args:
            problem: problem with constant torque limits.
            policy: the policy.
            switches: the arcs.
            size: scales of the states, shape (2 nv,).
        """
        counts = np.ceil(policy.polish.segments * switches.lengths / switches.duration).astype(int)
        counts = np.maximum(counts, 1)
        arc_of = np.repeat(np.arange(counts.size), counts)
        tau = problem.limits.actuators.extreme(switches.signs)[arc_of]
        return cls(problem, policy, tau, arc_of, 1 / counts[arc_of], size, switches.duration)

    def ends(self, lengths: Array, x: Array) -> Ends:
        """Integrate the segments.

        Args:
            lengths: of the arcs, scaled, shape (K,).
            x: first states of the segments, scaled, shape (S, 2 nv).
        """
        count, step = self.policy.polish.steps, gauss_steps(self.problem.robot)
        h, torques = self.seconds(lengths) / count, np.stack([self.tau, self.tau], axis=1)
        states, flows = [x * self.size], [np.tile(np.eye(self.size.size), (len(x), 1, 1))]
        for _ in range(count):
            state, flow, _ = step(h, states[-1], torques)
            states.append(state)
            flows.append((flow * self.size / self.size[:, None]) @ flows[-1])
        return Ends(np.array(states) / self.size, np.array(flows), self._rate(states[-1]) * self.unit / self.size)

    def seconds(self, lengths: Array) -> Array:
        """Lengths of the segments [s], shape (S,)."""
        return np.asarray(lengths[self.arc_of] * self.share * self.unit)

    def hessian(self, lengths: Array, ends: Ends, costate: Array) -> Array:
        """Second derivatives of costateᵀ(end) by first state and length, scaled, shape (S, 2 nv + 1, 2 nv + 1).

        By the first states ∫ Φᵀ (∂²H/∂x²) Φ dt, with the costates along the segment and the sensitivities Φ there, by
        Simpson's rule; ∂²H/∂x² by central differences of the Jacobian of the dynamics.

        Args:
            lengths: of the arcs, scaled, shape (K,).
            ends: the segments' ends.
            costate: there, scaled, shape (S, 2 nv).
        """
        count, m, h, flow = self.policy.polish.steps, self.size.size, self.seconds(lengths), ends.flow
        along = carried(flow, np.einsum("sab,sa->sb", ends.by_start, costate))
        weights = np.array([1.0, *[4.0, 2.0] * (count // 2 - 1), 4.0, 1.0]) / (3 * count)
        curved = self._curvature(ends.states * self.size, along) * h[:, None, None]
        found = np.zeros((h.size, m + 1, m + 1))
        found[:, :m, :m] = np.einsum("q,qsab->sab", weights, flow.swapaxes(2, 3) @ curved @ flow)
        jacobian = self._jacobian(ends.x * self.size, self.tau) * self.size / self.size[:, None]
        rate = np.einsum("sab,sa->sb", jacobian, costate) * self.unit
        found[:, :m, m] = found[:, m, :m] = np.einsum("sab,sa->sb", ends.by_start, rate)
        found[:, m, m] = np.sum(rate * ends.rate, axis=1)
        return found

    def _rate(self, x: Array) -> Array:
        n = self.tau.shape[1]
        a = forward_dynamics(self.problem.robot)(x[:, :n], x[:, n:], self.tau)
        return np.concatenate([x[:, n:], a], axis=1)

    def _jacobian(self, x: Array, tau: Array) -> Array:
        """∂ẋ/∂x, shape (…, 2 nv, 2 nv)."""
        n = tau.shape[-1]
        _, by_q, by_v, _ = forward_dynamics_derivatives(self.problem.robot)(x[..., :n], x[..., n:], tau)
        upper = np.broadcast_to(np.eye(n, 2 * n, n), (*x.shape[:-1], n, 2 * n))
        return np.concatenate([upper, np.concatenate([by_q, by_v], axis=-1)], axis=-2)

    def _curvature(self, x: Array, costate: Array) -> Array:
        """∂²(costateᵀẋ)/∂x², scaled by the states, per second; of states of shape (Q, S, 2 nv)."""
        m, difference = self.size.size, self.policy.polish.difference
        moved = difference * np.diag(self.size)[:, None, None, :]
        both = np.stack([x + moved, x - moved])
        jacobian = self._jacobian(both.reshape(-1, m), np.tile(self.tau, (2 * m * len(x), 1)))
        jacobian = jacobian.reshape(*both.shape, m) * self.size / self.size[:, None]
        upward, downward = np.einsum("diqsab,qsa->diqsb", jacobian, costate)
        found = np.moveaxis((upward - downward) / (2 * difference), 0, -2)
        return np.asarray((found + found.swapaxes(-1, -2)) / 2)
