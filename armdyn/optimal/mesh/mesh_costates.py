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

The program has costates at the knots; the integral is then evaluated by Simpson's rule.
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
        numbers: bound of changes of states, and accuracy of the program.
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
        (K, n), limits, length = self.torque_level.shape[1:], self.limits, np.diff(self.motion.t) / self.motion.t[-1]
        interval, limit = np.nonzero(limits.near.T)  # of each multiplier
        source = limits.unit[limit, None] * self.effect[interval, :, limits.state[limit]]
        distance = length[interval] * (limits.margin[limit, interval] + limits.margin[limit, interval + 1]) / 2
        E, own, most_change = limit.size, 2 * n * (K + 1), self.numbers.state_bound / self.motion.t[-1]
        changes, cost, bounds = self._changes(length, own + E)
        states = np.full((2 * n * K, 2), (-most_change, most_change))
        spare = distance + most_change * np.abs(source).sum(axis=1)
        adjoint = _adjoint(self.propagator, interval, source)
        matrix = sp.vstack([changes, adjoint, sp.hstack([sp.csr_matrix((E, own)), -sp.eye(E)])], format="csr")
        order = np.argsort(np.append(np.repeat(np.arange(K + 1), 2 * n), interval), kind="stable")
        marginals = np.empty(own + E)
        _, marginals[order] = marginals_in_boxes(  # any costates give a bound
            matrix[:, order].T.tocsc(),
            np.append(np.zeros(own), -distance)[order],
            np.append(cost, np.zeros(len(states) + E)),
            np.concatenate([bounds, states, np.stack([np.zeros(E), spare], axis=1)]),
            self.numbers.converged,
        )
        multipliers = np.maximum(marginals[own:], 0.0)
        held = np.zeros((K, 2 * n))
        np.add.at(held, (interval, limits.state[limit]), multipliers * limits.unit[limit])
        costates = _nearest(adjoint, marginals[:own], multipliers).reshape(K + 1, 2 * n)
        return self._measured(costates, held, float(multipliers @ distance))

    def _changes(self, length: Array, unknowns: int) -> tuple[sp.csr_matrix, Array, Array]:
        """Rows of H and S, with the costs and bounds of the changes of pace and torques.

        The pace changes along every interval, the torques at the knots, within their range in the adjacent halves.

        Args:
            length: of the intervals, as parts of the duration, shape (K,).
            unknowns: number of costates and multipliers.
        """
        K, n, level = length.size, self.width.size, self.torque_level[1]
        places = np.repeat(np.arange(K), 2 * n), np.arange(K * 2 * n)
        pace = sp.csr_matrix((-self.state_rate[0].ravel(), places), shape=(K, unknowns))
        velocities = (2 * n * np.arange(K + 1)[:, None, None] + n + np.arange(n)) + np.zeros((n, 1), int)
        places = np.repeat(np.arange(n * (K + 1)), n), velocities.ravel()
        gain, tau = (np.concatenate([each[0], each[2, -1:]]) for each in (self.switching_gain, self.tau))
        torques = sp.csr_matrix((-gain.ravel(), places), shape=(n * (K + 1), unknowns))
        halves = (np.pad(length[:, None] / 2 * part, ((1, 1), (0, 0))) for part in (level, 1 - level))
        falls, rises = ((half[:-1] + half[1:]).ravel() for half in halves)
        bounds = np.concatenate([length[:, None] * (-1, 1), np.stack([-falls, rises], axis=1)])
        cost = 1 + tau[:-1] ** 2 @ self.weight / 2, (self.weight * tau * self.width).ravel()
        return sp.vstack([pace, torques]), np.concatenate(cost), bounds

    def _measured(self, scaled: Array, held: Array, near_limits: float) -> MeshCostates:
        """Costates of the motion, and the violation at each interval's worse end.

        Args:
            scaled: costates at the knots, times the states' sizes, shape (K + 1, 2 nv).
            held: multipliers of the limits in the intervals, shape (K, 2 nv).
            near_limits: what changes towards limits that are nearly reached may save.
        """
        n, motion, h = self.width.size, self.motion, np.diff(self.motion.t)
        added = np.einsum("kij,kj->ki", self.effect, held)
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
            saving=float(np.sum(missed)) + near_limits,
        )


def _adjoint(propagator: Array, interval: Index, source: Array) -> sp.csr_matrix:
    """Rows r_k = A_kᵀ r_{k+1} + sources of all intervals; a source's interval and effect, shapes (E,) and (E, 2 nv)."""
    (K, m, _), E = propagator.shape, len(source)
    carried = sp.bsr_matrix((propagator, np.arange(1, K + 1), np.arange(K + 1)), shape=(K * m, (K + 1) * m))
    rows = m * interval[:, None] + np.arange(m)
    sources = sp.csc_matrix((source.ravel(), rows.ravel(), m * np.arange(E + 1)), shape=(K * m, E))
    return sp.hstack([sp.eye(K * m, (K + 1) * m) - carried, -sources], format="csr")


def _nearest(adjoint: sp.csr_matrix, costates: Array, multipliers: Array) -> Array:
    """Project costates onto the adjoint equations; the linear program satisfies these to its tolerance only.

    Integrated from one end, the residuals would grow as fast as the motion is unstable.
    """
    own, missing = adjoint[:, : costates.size], adjoint @ np.append(costates, multipliers)
    return np.asarray(costates - own.T @ splu((own @ own.T).tocsc()).solve(missing))
