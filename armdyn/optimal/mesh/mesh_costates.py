"""Upper bound on the first-order saving of time by any change of a motion, whatever its switching structure.

Let ρ solve the adjoint equations along a motion, with multipliers η ≥ 0 of the limits of velocity and position that the
motion nearly reaches (Bryson and Ho, Applied Optimal Control, section 3.9). Changes of the torques within their limits,
and of the pace, change the cost to first order by ∫ H δσ + Σ S_i δτ_i dt, and every motion within the limits of the
state has ∫ η (change of the state) dt ≤ ∫ η (distance from the limit) dt. With a pace that changes by at most the
whole, |δσ| ≤ 1, and torques anywhere within their limits, no change saves more, as a part of the duration T, than

    1/T ∫ |H| + Σ_i (decrease of H as torque i goes to a limit) + η · (distance from the limit) dt.

With a weight w on effort H and S have its parts w/2 τᵀτ and w τ, and H falls by S_i²/2w at most as torque i changes.

The bound is zero where Pontryagin's conditions hold, and for no other motion. Any ρ and η ≥ 0 give a bound; a linear
program finds the least one. No solver's multipliers enter, so that motions of any method are judged.

The program has costates at the ends of stretches of some thousandths of the duration; the integral is then evaluated
over all intervals.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from armdyn.arrays import Array, Flags, Index
from armdyn.dynamics.numeric import forward_dynamics, joint_inertia
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.bound.linear_program import marginals_in_boxes
from armdyn.optimal.mesh.shooting import Shooting
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.problem.policy.refinement import ShootingPolicy
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.verify.costates import Costates
from armdyn.optimal.verify.rollout import gauss_steps
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class MeshCostates(Costates):
    """Costates of a motion on a mesh, and the largest first-order saving by any change of it.

    Attributes:
        switching: S = ∂H/∂τ at the knots, shape (K + 1, nv).
        held: multipliers of limits of (q, v) in the intervals, positive where the upper one is active
            [1/rad or 1/(rad/s)], shape (K, 2 nv).
        missed: bound on the first-order saving by changes within each interval, as a part of the duration, shape (K,).
        saving: bound on the first-order saving by a change of the motion, as a part of the duration.
    """

    switching: Array
    held: Array
    missed: Array
    saving: float


def mesh_costates(
    problem: MinimumTimeProblem, motion: Shooting, replay: Trajectory, policy: Policy
) -> MeshCostates | None:
    """Costates that violate Pontryagin's conditions least; None if the adjoint equations were not integrated.

    Args:
        problem: problem of the motion.
        motion: a motion that lands.
        replay: replay of the motion, along which the adjoint equations are integrated.
        policy: lengths of stretches, distance of near limits, and tolerances of the integration.
    """
    robot, actuators, n, numbers = problem.robot, problem.limits.actuators, problem.robot.nv, policy.shooting
    size, h, own = motion.size, np.diff(motion.t), np.eye(2 * n)
    at = replay((motion.t[:-1] + motion.t[1:]) / 2)
    x = np.stack([motion.x[:-1], np.concatenate([at.q, at.v], axis=1), motion.x[1:]])
    tau = np.stack([motion.tau[:, 0], np.mean(motion.tau, axis=1), motion.tau[:, 1]])
    torques = np.stack([tau[:2].reshape(-1, n), tau[1:].reshape(-1, n)], axis=1)
    steps = gauss_steps(robot)(np.tile(h / 2, 2), x[:2].reshape(-1, 2 * n), torques)[1]
    if not np.all(np.isfinite(steps)):
        return None
    first, second = (steps.swapaxes(1, 2) * size[:, None] / size).reshape(2, h.size, 2 * n, 2 * n)
    carried, (q, v) = first @ second, np.split(x.reshape(-1, 2 * n), 2, axis=1)
    a = forward_dynamics(robot)(q, v, tau.reshape(-1, n)).reshape(tau.shape)
    inverse = np.linalg.inv(joint_inertia(robot)(q)).reshape(*tau.shape, n)
    width = np.where(actuators.width > 0, actuators.width, 1.0)  # without a motor the torque is fixed
    return _StationarityProgram(
        motion=motion,
        x=x,
        tau=tau,
        second_half=second,
        propagator=carried,
        effect=h[:, None, None] / 6 * (own + 4 * first + carried) * size,  # by Simpson's rule
        state_rate=np.concatenate([x[..., n:], a], axis=2) / size,
        switching_gain=inverse * actuators.width[:, None] / size[n:],
        torque_level=(tau - actuators.lower) / width,
        weight=problem.effort_weights(),
        limits=_Limits.of(problem.limits, motion, numbers.held),
        width=width,
        numbers=numbers,
    ).solved()


@dataclass(frozen=True, eq=False)
class _Limits:
    """Limits of the states that a motion nearly reaches.

    Attributes:
        state: index of the state of each, from 0 to 2 nv, shape (J,).
        unit: 1 over the limit's size, negative for lower limits, shape (J,). A position's size is the joint's way.
        margin: distance from the limit at the knots, as a part of its size, shape (J, K + 1).
        near: intervals along which the limit may be active, shape (J, K).
    """

    state: Index
    unit: Array
    margin: Array
    near: Flags

    @classmethod
    def of(cls, limits: JointLimits, motion: Shooting, nearest: float) -> "_Limits":
        """Limits whose margin is at most `nearest` somewhere."""
        n = motion.tau.shape[-1]
        upper = np.concatenate([limits.position_upper, limits.velocity])
        lower = np.concatenate([limits.position_lower, -limits.velocity])
        sizes = np.concatenate([motion.size[:n], limits.velocity])
        bound = np.stack([upper, lower], axis=1).ravel()
        state = np.repeat(np.arange(2 * n), 2)[np.isfinite(bound)]
        side = np.tile([1.0, -1.0], 2 * n)[np.isfinite(bound)]
        size = sizes[state]
        margin = np.maximum(side[:, None] * (bound[np.isfinite(bound), None] - motion.x.T[state]), 0.0) / size[:, None]
        kept = np.min(margin, axis=1) <= nearest
        near = margin[kept] <= nearest
        return cls(state[kept], (side / size)[kept], margin[kept], near[:, :-1] & near[:, 1:])


@dataclass(frozen=True, eq=False)
class _Segments:
    """A motion in stretches, for costates r = ρ size at their ends.

    Attributes:
        ends: knots at the ends of the stretches, shape (G + 1,).
        propagator: propagator of r from the end of each stretch to its start, shape (G, 2 nv, 2 nv).
        source_of: stretch, and limit, of each multiplier, shape (2, E).
        source: contribution of a unit multiplier to r at the stretch's start, shape (E, 2 nv).
        distance: unit multiplier times the distance from the limit, as a part of the duration, shape (E,).
    """

    ends: Index
    propagator: Array
    source_of: Index
    source: Array
    distance: Array


@dataclass(frozen=True, eq=False)
class _StationarityProgram:
    """Pontryagin's conditions as linear inequalities for costates and multipliers.

    Attributes:
        motion: the motion.
        x: states at the start, in the middle and at the end of every interval, shape (3, K, 2 nv).
        tau: torques there, shape (3, K, nv).
        second_half: propagator of r from the end of an interval to its middle, shape (K, 2 nv, 2 nv).
        propagator: propagator of r from the end of an interval to its start, shape (K, 2 nv, 2 nv).
        effect: contribution of a multiplier of 1 along the interval to r there, a column per state, (K, 2 nv, 2 nv).
        state_rate: rates of the state there, shape (3, K, 2 nv).
        switching_gain: ∂S/∂(costates of velocities), times the torques' ranges, shape (3, K, nv, nv).
        torque_level: height of the torques above the lower limit, over their ranges, shape (3, K, nv).
        weight: weights of the squared torques [1/(N m)²], shape (nv,).
        limits: limits that the motion nearly reaches.
        width: widths of the torques' ranges, shape (nv,); 1 without a motor.
        numbers: lengths of stretches, and distance of near limits.
    """

    motion: Shooting
    x: Array
    tau: Array
    second_half: Array
    propagator: Array
    effect: Array
    state_rate: Array
    switching_gain: Array
    torque_level: Array
    weight: Array
    limits: _Limits
    width: Array
    numbers: ShootingPolicy

    def solved(self) -> MeshCostates:
        """Solve the linear program, and integrate the adjoint equations with its multipliers.

        The unknowns are changes of the motion in boxes; the equations are the linearised dynamics and the distances
        from limits; their marginals are the costates and the multipliers of the limits.
        """
        segments = self._segments()
        G, n, E = len(segments.propagator), self.width.size, len(segments.distance)
        changes, cost, bounds = self._changes(segments)
        most_change, own = self.numbers.state_bound / self.motion.t[-1], 2 * n * (G + 1)
        states = np.full((2 * n * G, 2), (-most_change, most_change))
        spare = segments.distance + most_change * np.abs(segments.source).sum(axis=1)
        matrix = [changes, _adjoint(segments), sp.hstack([sp.csr_matrix((E, own)), -sp.eye(E)])]
        order = np.argsort(np.append(np.repeat(np.arange(G + 1), 2 * n), segments.source_of[0]), kind="stable")
        marginals = np.empty(own + E)
        program = (
            sp.vstack(matrix, format="csr")[:, order].T.tocsc(),
            np.append(np.zeros(own), -segments.distance)[order],
            np.append(cost, np.zeros(len(states) + E)),
            np.concatenate([bounds, states, np.stack([np.zeros(E), spare], axis=1)]),
        )
        _, marginals[order] = marginals_in_boxes(*program, self.numbers.converged)  # any costates give a bound
        multipliers = np.maximum(marginals[own:], 0.0)
        costates = _nearest(matrix[1], marginals[:own], multipliers)
        return self._measured(segments, costates.reshape(G + 1, 2 * n), multipliers)

    def _segments(self) -> _Segments:
        """Merge intervals into stretches of at least a given length."""
        (_, K, n), h = self.torque_level.shape, np.diff(self.motion.t) / self.motion.t[-1]
        ends, length = [0], 0.0
        for k in range(K):
            length += h[k]
            if length >= self.numbers.least_spacing or k == K - 1:
                ends.append(k + 1)
                length = 0.0
        first, last, limits = np.array(ends[:-1]), np.array(ends[1:]), self.limits
        stretch, limit = np.nonzero(np.logical_or.reduceat(limits.near, first, axis=1).T)
        flow, source = np.tile(np.eye(2 * n), (first.size, 1, 1)), np.zeros((stretch.size, 2 * n))
        for back in range(1, int(np.max(last - first)) + 1):  # an interval of every stretch, from its end
            own, of = np.flatnonzero(last - first >= back), np.flatnonzero((last - first)[stretch] >= back)
            at, j = last[stretch[of]] - back, limit[of]
            flow[own] = self.propagator[last[own] - back] @ flow[own]
            acting = np.where(limits.near[j, at], limits.unit[j], 0.0)[:, None] * self.effect[at, :, limits.state[j]]
            source[of] = np.einsum("eij,ej->ei", self.propagator[at], source[of]) + acting
        middle = (limits.margin[:, :-1] + limits.margin[:, 1:]) / 2
        distance = np.add.reduceat(h * limits.near * middle, first, axis=1)[limit, stretch]
        return _Segments(np.array(ends), flow, np.stack([stretch, limit]), source, distance)

    def _changes(self, segments: _Segments) -> tuple[sp.csr_matrix, Array, Array]:
        """Rows of H and S, with the costs and bounds of the changes of pace and torques.

        The pace changes along every stretch, the torques at its ends, within their range in the adjacent half
        stretches.
        """
        G, n = len(segments.propagator), self.width.size
        t, ends, m = self.motion.t / self.motion.t[-1], segments.ends, 2 * n
        width, lengths = m * (G + 1) + len(segments.distance), np.diff(t[ends])
        places = np.repeat(np.arange(G), m), np.arange(G * m)
        pace = sp.csr_matrix((-self.state_rate[0][ends[:-1]].ravel(), places), shape=(G, width))
        velocities = (m * np.arange(G + 1)[:, None, None] + n + np.arange(n)) + np.zeros((n, 1), int)
        places = np.repeat(np.arange(n * (G + 1)), n), velocities.ravel()
        gain, tau = (np.concatenate([each[0], each[2, -1:]])[ends] for each in (self.switching_gain, self.tau))
        torques = sp.csr_matrix((-gain.ravel(), places), shape=(n * (G + 1), width))
        level = self.torque_level[1]
        falls, rises = (self._about_ends(segments.ends, part) for part in (level, 1 - level))
        bounds = np.concatenate([lengths[:, None] * (-1, 1), np.stack([-falls.ravel(), rises.ravel()], axis=1)])
        cost = 1 + tau[:-1] ** 2 @ self.weight / 2, (self.weight * tau * self.width).ravel()
        return sp.vstack([pace, torques]), np.concatenate(cost), bounds

    def _about_ends(self, ends: Index, share: Array) -> Array:
        """Integral of shares of the torques' ranges, as parts of the duration, between the middles of the stretches.

        Args:
            ends: knots at the ends of the stretches, shape (G + 1,).
            share: shares in the intervals, shape (K, nv).

        Returns:
            Over the halves of the stretches before and after each end, shape (G + 1, nv).
        """
        t = self.motion.t / self.motion.t[-1]
        stretch = np.searchsorted(ends, np.arange(len(share)), side="right") - 1
        h, middle = np.diff(t), ((t[ends[:-1]] + t[ends[1:]]) / 2)[stretch]
        before = np.clip(middle - t[:-1], 0.0, h)
        found = np.zeros((ends.size, share.shape[1]))
        np.add.at(found, stretch, before[:, None] * share)
        np.add.at(found, stretch + 1, (h - before)[:, None] * share)
        return found

    def _measured(self, segments: _Segments, at_ends: Array, multipliers: Array) -> MeshCostates:
        """Costates at all knots from those at the stretches' ends, and the violation at each interval's worse end.

        Integrals are by Simpson's rule, with the intervals' ends and middles as points.
        """
        (_, K, n), motion, h = self.torque_level.shape, self.motion, np.diff(self.motion.t)
        scaled = np.empty((K + 1, 2 * n))
        of_interval = np.searchsorted(segments.ends, np.arange(K), side="right") - 1
        size = np.zeros((len(segments.propagator), len(self.limits.state)))
        size[tuple(segments.source_of)] = multipliers
        acting = np.where(self.limits.near.T, size[of_interval] * self.limits.unit, 0.0)
        held = acting @ (self.limits.state[:, None] == np.arange(2 * n))
        added = np.einsum("kij,kj->ki", self.effect, held)
        scaled[segments.ends] = at_ends
        for m in np.setdiff1d(np.arange(K), segments.ends)[::-1]:
            scaled[m] = self.propagator[m] @ scaled[m + 1] + added[m]
        middle = np.einsum("kij,kj->ki", self.second_half, scaled[1:]) + added / 2
        r, level, part = np.stack([scaled[:-1], middle, scaled[1:]]), self.torque_level, np.array([1, 4, 1]) / 6
        switching = np.einsum("skij,skj->ski", self.switching_gain, r[..., n:]) + self.weight * self.tau * self.width
        parabola = 2 * self.weight * self.width**2  # H's minimum may be nearer than the limit
        inner = np.where(parabola > 0, switching**2 / np.where(parabola > 0, parabola, 1.0), np.inf)
        falls = np.sum(
            np.minimum(np.maximum(switching * level, switching * (level - 1)), inner)[::2].max(axis=0), axis=1
        )
        hamiltonian = 1 + self.tau**2 @ self.weight / 2 + np.sum(self.state_rate * r, axis=2)
        missed = (falls + np.max(np.abs(hamiltonian[::2]), axis=0)) * h / motion.t[-1]
        free = (self.weight > 0) & (level > 0) & (level < 1)  # without a weight it switches within an interval
        parts = (part[:, None] * h)[..., None]
        return MeshCostates(
            t=motion.t,
            q=motion.x[:, :n],
            v=motion.x[:, n:],
            tau=motion.tau,
            costate=scaled / motion.size,
            points=np.stack([self.x[..., :n], self.x[..., n:], self.tau]).reshape(3, -1, n),
            pushed=(parts * r / motion.size)[..., n:].reshape(-1, n),
            switched=(parts * np.where(free, 0.0, switching) / self.width).reshape(-1, n),
            velocity=-h @ np.abs(held[:, n:]),
            switching=np.concatenate([switching[0], switching[2, -1:]]) / self.width,
            held=held,
            missed=missed,
            saving=float(np.sum(missed) + multipliers @ segments.distance),
        )


def _adjoint(segments: _Segments) -> sp.csr_matrix:
    """Rows r_g = A_gᵀ r_{g+1} + sources of all stretches."""
    (G, m, _), E = segments.propagator.shape, len(segments.source)
    carried = sp.bsr_matrix((segments.propagator, np.arange(1, G + 1), np.arange(G + 1)), shape=(G * m, (G + 1) * m))
    rows = m * segments.source_of[0][:, None] + np.arange(m)
    sources = sp.csc_matrix((segments.source.ravel(), rows.ravel(), m * np.arange(E + 1)), shape=(G * m, E))
    return sp.hstack([sp.eye(G * m, (G + 1) * m) - carried, -sources], format="csr")


def _nearest(adjoint: sp.csr_matrix, costates: Array, multipliers: Array) -> Array:
    """Project costates onto the adjoint equations; the linear program satisfies these to its tolerance only.

    Integrated from one end, the residuals would grow as fast as the motion is unstable.
    """
    own, missing = adjoint[:, : costates.size], adjoint @ np.append(costates, multipliers)
    return np.asarray(costates - own.T @ splu((own @ own.T).tocsc()).solve(missing))
