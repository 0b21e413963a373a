"""Independent check of the costates: the adjoint equations integrated along the replay.

ρ̇ = −∂H/∂x = −(∂f/∂x)ᵀρ, with ∂f/∂x from Pinocchio's derivatives of forward dynamics, integrated from the goal back
to the start. Of the program only the multipliers of held limits enter: where a joint is on a limit of its velocity or
position, the limit pulls on the costate (Bryson and Ho, Applied Optimal Control, section 3.9).

Backwards a difference grows as the motion itself would diverge, ten thousandfold on a heavily laden arm. Therefore the
costates are held against that solution of the equations which is nearest to all of them: shadowing.
"""

from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.dynamics.numeric import forward_dynamics, forward_dynamics_derivatives
from armdyn.models.robots.robot import Robot
from armdyn.optimal.arcs.arc import POSITION, VELOCITY
from armdyn.optimal.arcs.phases import TABLEAU, Phases
from armdyn.optimal.landing.rollout import dense, replay_torques
from armdyn.optimal.task.policy.refinement import AdjointPolicy
from armdyn.optimal.task.tableau import GAUSS_3
from armdyn.trajectory import Trajectory

_POWERS = np.arange(6.0)
"""Of a quintic."""


def adjoint_error(robot: Robot, replay: Trajectory, phases: Phases, numbers: AdjointPolicy) -> float:
    """Residual of the costates in the adjoint equations, as a change of H, relative to the 1 that time costs.

    A difference in ρ_q counts by the joint's largest velocity, one in ρ_v by its largest acceleration.

    Args:
        robot: that moves.
        replay: its motion.
        phases: the arcs, with costates.
        numbers: how finely the equations are integrated.

    Returns:
        The largest difference at any knot, of any joint; infinite if the replay or the integration broke off.
    """
    duration = phases.duration
    if abs(replay.duration - duration) > 1e-12 * duration:
        return float("inf")
    finer = dense(replay, numbers.samples)
    if finer.t.size > replay.t.size:  # else the replay's own states are all there are
        finer = replay_torques(robot, finer)
        if finer.t[-1] != replay.t[-1]:
            return float("inf")
    along = Along.of(robot, finer, numbers)
    found = _backwards(along, phases)
    if found is None:
        return float("inf")
    apart = (found[:, :, 0] - phases.costate) * along.size
    freedom = found[:, :, 1:] * along.size[:, None]
    shift = np.linalg.lstsq(freedom.reshape(apart.size, -1), apart.ravel(), rcond=None)[0]
    return float(np.max(np.abs(apart - freedom @ shift)))


@dataclass(frozen=True, eq=False)
class Along:
    """A motion interpolated by quintics that match q, v and a at both ends of every sample.

    Attributes:
        robot: that moves.
        motion: samples of its states and torques.
        quintics: between two samples, coefficients of sᵏ with s from 0 to 1 [rad or m], shape (m - 1, 6, nv).
        size: largest velocity and acceleration of every joint, shape (2 nv,).
        policy: how finely the equations are integrated.
    """

    robot: Robot
    motion: Trajectory
    quintics: Array
    size: Array
    policy: AdjointPolicy

    @classmethod
    def of(cls, robot: Robot, motion: Trajectory, policy: AdjointPolicy) -> "Along":
        """Interpolate a motion, with accelerations from forward dynamics."""
        q, v, h = motion.q, motion.v, np.diff(motion.t)[:, None]
        a = forward_dynamics(robot)(q, v, motion.tau)
        start, mean, bend = h * v[:-1], h**2 / 2 * a[:-1], h**2 / 2 * np.diff(a, axis=0)
        rise, speed = np.diff(q, axis=0) - start - mean, h * np.diff(v, axis=0) - 2 * mean
        # Of s³, s⁴ and s⁵, so that value, slope and curvature at s = 1 are rise, speed and 2 bend.
        more = (10 * rise - 4 * speed + bend, -15 * rise + 7 * speed - 2 * bend, 6 * rise - 3 * speed + bend)
        peaks = [np.max(np.abs(each), axis=0) for each in (v, a)]
        size = np.concatenate([np.maximum(each, policy.still * np.max(each)) for each in peaks])
        return cls(robot, motion, np.stack([q[:-1], start, mean, *more], axis=1), size, policy)

    def states(self, times: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and torques at times that are no jumps, shape (k,): each of shape (k, nv)."""
        t, tau = self.motion.t, self.motion.tau
        k = np.clip(np.searchsorted(t, times, side="right") - 1, 0, t.size - 2)
        h = (t[k + 1] - t[k])[:, None]
        s = (times - t[k])[:, None] / h
        powers, quintics = s**_POWERS, self.quintics[k]
        velocities = np.einsum("kp,kpn->kn", _POWERS[1:] * powers[:, :-1], quintics[:, 1:]) / h
        return np.einsum("kp,kpn->kn", powers, quintics), velocities, tau[k] + s * (tau[k + 1] - tau[k])

    def jacobians(self, times: Array) -> Array:
        """System matrix −(∂f/∂x)ᵀ of the adjoint equations, friction included, shape (k, 2 nv, 2 nv)."""
        n = self.robot.nv
        _, by_q, by_v, _ = forward_dynamics_derivatives(self.robot)(*self.states(times))
        down = np.zeros((times.size, 2 * n, 2 * n))
        down[:, :n, n:], down[:, n:, n:] = -by_q.swapaxes(1, 2), -by_v.swapaxes(1, 2)
        down[:, n:, :n] = -np.eye(n)
        return down

    def carried(self, edges: Array, precise: float) -> Array | None:
        """Transition matrices of the costates from the end of each stretch to its start, shape (k, 2 nv, 2 nv).

        By the sixth order of Gauss in one step and in two: where these differ, each half once more.

        Args:
            edges: of the stretches, at samples or between them, shape (k + 1,) [s].
            precise: by how much entries may differ where costates are measured by `size`.

        Returns:
            None: it takes too many stretches.
        """
        starts, ends = edges[:-1], edges[1:]
        return self._halved(starts, ends, self._step(starts, ends), precise, self.policy.deepest)

    def _halved(self, starts: Array, ends: Array, whole: Array, precise: float, deepest: int) -> Array | None:
        """Transition matrices by bisection of the stretches, until another bisection changes nothing."""
        t = self.motion.t
        middles = (starts + ends) / 2
        k = np.searchsorted(t, middles)
        near = np.where(t[k] - middles < middles - t[k - 1], t[k], t[k - 1])
        middles = np.where(np.abs(near - middles) < self.policy.middle * (ends - starts), near, middles)
        steps = self._step(np.append(starts, middles), np.append(middles, ends))
        first, second = steps[: starts.size], steps[starts.size :]
        both: Array = first @ second
        apart = np.max(np.abs(both - whole) * (self.size[:, None] / self.size), axis=(1, 2))
        rough = np.flatnonzero(~(apart <= precise))
        if not rough.size:
            return both
        if not deepest or rough.size > self.policy.most:
            return None
        first_half = self._halved(starts[rough], middles[rough], first[rough], precise, deepest - 1)
        if first_half is None:
            return None
        second_half = self._halved(middles[rough], ends[rough], second[rough], precise, deepest - 1)
        if second_half is None:
            return None
        both[rough] = first_half @ second_half
        return both

    def _step(self, starts: Array, ends: Array) -> Array:
        """Transition matrices in one step."""
        s, own = GAUSS_3.c.size, self.size.size
        h = (ends - starts)[:, None]
        backwards = ends[:, None] - h * GAUSS_3.c
        rates = self.jacobians(backwards.ravel()).reshape(-1, s, own, own)
        system = np.einsum("k,jl,kjab->kjalb", h[:, 0], GAUSS_3.A, rates).reshape(-1, s * own, s * own)
        stages = np.linalg.solve(np.eye(s * own) + system, rates.reshape(-1, s * own, own))
        moved = np.einsum("j,kjab->kab", GAUSS_3.b, stages.reshape(-1, s, own, own))
        carried: Array = np.eye(own) - h[:, :, None] * moved
        return carried


def _backwards(along: Along, phases: Phases) -> Array | None:
    """Integrate the adjoint equations backwards from the costate at the goal to the knots; None if they diverge.

    Returns:
        Their solution, and how it answers to each costate at the goal, shape (K + 1, 2 nv, 1 + 2 nv).
    """
    inner, knots, on_limit = _impulses(phases)
    K, own = phases.arc_of.size, phases.costate.shape[1]
    stops = phases.t[:-1, None] + np.diff(phases.t)[:, None] * TABLEAU.c[:-1]  # where limits pull
    breaks = np.unique(np.concatenate([phases.t, stops[on_limit].ravel()]))
    edges = _edges(breaks, along.motion.t, along.policy.near)
    largest = float(np.max(np.abs(phases.costate * along.size)))
    steps = along.carried(edges, along.policy.precise / max(largest, 1.0))
    if steps is None:
        return None
    place = np.searchsorted(edges, phases.t)
    found = np.empty((K + 1, own, own + 1))
    found[-1] = np.column_stack([phases.costate[-1], np.diag(1 / along.size)])
    for k in range(K - 1, -1, -1):
        here = found[k + 1].copy()
        if k < K - 1:
            here[:, 0] -= knots[k]
        impulses = dict(zip(np.searchsorted(edges, stops[k]).tolist(), inner[k], strict=True)) if on_limit[k] else {}
        for step in range(place[k + 1] - 1, place[k] - 1, -1):
            here = steps[step] @ here
            if step in impulses:
                here[:, 0] -= impulses[step]
        found[k] = here
    return found if np.all(np.isfinite(found)) else None


def _edges(breaks: Array, samples: Array, close: float) -> Array:
    """Edges of the stretches of integration: all breaks, and every second sample that is not too near a break."""
    others = samples[::2]
    k = np.clip(np.searchsorted(breaks, others), 1, breaks.size - 1)
    before, after = breaks[k - 1], breaks[k]
    near = np.minimum(np.abs(others - before), np.abs(after - others))
    return np.sort(np.concatenate([breaks, others[near > close * (after - before)]]))


def _impulses(phases: Phases) -> tuple[Array, Array, Flags]:
    """Impulses of the state limits on the costates; none from a limit that no arc names.

    Impulses at the stages are what the collocation's quadrature makes of a limit that is held. A touch has its own
    at the knot, and IPOPT's barrier some of it at the stages beside.

    Returns:
        At the inner stages, shape (K, stages - 1, 2 nv); at the inner knots, shape (K - 1, 2 nv); and whether any
        stage of an interval has some, shape (K,).
    """
    K, n = phases.q.shape[0] - 1, phases.q.shape[1]
    modes = np.array([phases.arcs[a].modes for a in phases.arc_of], dtype=object)
    slow = np.isin(modes, POSITION)
    held = np.stack([slow, slow | np.isin(modes, VELOCITY)], axis=1)  # (K, 2, nv): positions, velocities
    met = held[:-1] | held[1:]
    for a, k in enumerate(np.flatnonzero(np.diff(phases.arc_of))):
        for i, mode in phases.arcs[a].touches:
            rows = slice(None) if mode in POSITION else slice(1, 2)
            met[k, rows, i] = held[k : k + 2, rows, i] = True
    inner = (phases.state_multiplier * held[:, None]).reshape(K, -1, 2 * n)
    return inner, (phases.knot_multiplier * met).reshape(K - 1, 2 * n), np.asarray(np.any(held, axis=(1, 2)))
