"""Whether a motion is what it claims to be: it lands, it keeps the limits, and Pontryagin agrees.

With H = 1 + w/2 τᵀτ + ρᵀf(x, τ) and free final time, an optimum has H = 0 throughout, and every
torque on its limit is there because H falls outward: S_i = ∂H/∂τ_i is negative on the upper and
positive on the lower limit, zero where the torque is free (Pontryagin et al. 1962; Bryson and Ho,
Applied Optimal Control, section 3.9 for limits on the state).
"""

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from armdyn.dynamics.numeric import forward_dynamics
from armdyn.optimal.arcs.arc import BANG, POSITION, VELOCITY, outward
from armdyn.optimal.arcs.phases import TABLEAU, Phases
from armdyn.optimal.arcs.sampling import lagrange
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

GOAL_TOLERANCE = 1e-6
"""Of the replay at the goal [rad or m]: a hundredth of what encoders of good arms resolve."""
HAMILTONIAN_TOLERANCE = 1e-4
"""Of |H|, against the 1 that time costs: what multipliers from collocation on these meshes resolve."""
SWITCHING_TOLERANCE = 1e-4
"""Of what H could still fall by if one torque went to a limit that it is not on, against the 1 that time costs."""
LIMIT_TOLERANCE = 1e-6
"""Of a limit, as a part of it."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """What was checked, and how it came out. Infinite: could not be checked.

    Attributes:
        ok: everything within its tolerance.
        goal_error: largest joint position error of the replay at the goal [rad or m].
        goal_velocity_error: the same for the velocities [rad/s or m/s].
        hamiltonian_spread: largest |H| at the knots; 0 at an optimum.
        switching_violation: what H could still fall by if one torque went to a limit that it is not on, by
            the sign of its switching function; for held velocities, the wrong sign of their multiplier
            relative to its peak.
        limit_violation: largest excess of a torque, velocity or position over its limit anywhere in the
            replay, relative to the limit (position: to the range).
        singular: some arc has a joint on no limit.
        reasons: why it is not ok.
        t: times at which the costates are known [s], shape (K,).
        costate: ρ at those times, for (q, v), shape (K, 2 nv).
        switching: S = ∂H/∂τ at those times, shape (K, nv).
    """

    goal_error: float
    goal_velocity_error: float
    limit_violation: float
    hamiltonian_spread: float = float("inf")
    switching_violation: float = float("inf")
    singular: bool = False
    remark: str = ""
    t: Array = field(default_factory=lambda: np.empty(0), repr=False)
    costate: Array = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    switching: Array = field(default_factory=lambda: np.empty((0, 0)), repr=False)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why it is not ok, for people; empty if it is."""
        checks = (
            ("the replay misses the goal by {:.2g} rad", self.goal_error, GOAL_TOLERANCE),
            ("a limit is exceeded by {:.2g} of it", self.limit_violation, LIMIT_TOLERANCE),
            ("the Hamiltonian strays from 0 by {:.2g}", self.hamiltonian_spread, HAMILTONIAN_TOLERANCE),
            ("a switching function has the wrong sign by {:.2g}", self.switching_violation, SWITCHING_TOLERANCE),
        )
        if not np.isfinite(self.goal_error):
            return (self.remark or "there is no motion to check",)
        unknown = not np.isfinite(self.hamiltonian_spread)
        known = checks[:2] if unknown else checks
        wrong = tuple(text.format(value) for text, value, bound in known if not value <= bound)
        return (*((self.remark,) if self.remark and (wrong or unknown) else ()), *wrong) or (
            ("no costates: the arcs were not resolved",) if unknown else ()
        )

    @property
    def ok(self) -> bool:
        """Everything within its tolerance."""
        return not self.reasons


def certify(problem: MinimumTimeProblem, replay: Trajectory, phases: Phases | None, remark: str = "") -> Certificate:
    """Check a replayed motion, and its costates if its arcs are known.

    Args:
        problem: what was asked.
        replay: what the torques do under `replay_torques`.
        phases: the arcs solved; None: only the replay is checked.
        remark: why there are no arcs.
    """
    goal = float(np.max(np.abs(replay.q[-1] - problem.q_goal)))
    goal_velocity = float(np.max(np.abs(replay.v[-1] - problem.v_goal)))
    limit = limit_violation(problem, replay)
    if phases is None:
        return Certificate(goal, goal_velocity, limit, remark=remark)
    hamiltonian, switching, sign = pontryagin(problem, phases)
    return Certificate(
        goal_error=goal,
        goal_velocity_error=goal_velocity,
        limit_violation=limit,
        hamiltonian_spread=float(np.max(np.abs(hamiltonian))),
        switching_violation=sign,
        singular=problem.effort_weight == 0 and any(arc.singular for arc in phases.arcs),
        remark=remark,
        t=phases.t,
        costate=phases.costate,
        switching=switching,
    )


@dataclass(frozen=True, eq=False)
class Excess:
    """How far a motion goes beyond its limits anywhere, 0 where it does not.

    Attributes:
        effort: over the torque limits [N m or N], shape (nv,).
        velocity: [rad/s or m/s], shape (nv,).
        position: below the lower and above the upper limits [rad or m], shape (2, nv).
    """

    effort: Array
    velocity: Array
    position: Array


def excess(problem: MinimumTimeProblem, motion: Trajectory, dense: int = 8) -> Excess:
    """Largest excess over every limit, looked for at `dense` points between samples."""
    limits = problem.limits
    t = np.unique((motion.t[:-1, None] + np.diff(motion.t)[:, None] * np.linspace(0, 1, dense, endpoint=False)).ravel())
    at = motion(np.append(t, motion.t[-1]))

    def most(*over: Array) -> Array:
        worst: Array = np.max([np.max(x, axis=0) for x in over], axis=0)
        return np.maximum(worst, 0.0)

    return Excess(
        most(motion.tau - limits.effort_upper, limits.effort_lower - motion.tau),
        most(np.abs(at.v) - limits.velocity),
        np.stack([most(limits.position_lower - at.q), most(at.q - limits.position_upper)]),
    )


def limit_violation(problem: MinimumTimeProblem, motion: Trajectory, dense: int = 8) -> float:
    """Largest excess over a limit relative to it (position: to the range), looked for between samples, too."""
    limits, over = problem.limits, excess(problem, motion, dense)
    reach = np.maximum(np.where(np.isinf(limits.position_upper), 0, limits.position_upper - limits.position_lower), 1.0)
    half = (limits.effort_upper - limits.effort_lower) / 2
    fastest = np.where(np.isinf(limits.velocity), 1.0, limits.velocity)
    return float(max(np.max(over.effort / half), np.max(over.velocity / fastest), np.max(over.position / reach)))


def pontryagin(problem: MinimumTimeProblem, phases: Phases) -> tuple[Array, Array, float]:
    """H, shape (K + 1,), and S, shape (K + 1, nv), at the knots; the worst sign."""
    robot, n, w = problem.robot, problem.robot.nv, problem.effort_weight
    model, data, acceleration = robot.model, robot.model.createData(), forward_dynamics(robot)
    tau = _at_knots(phases)
    hamiltonian, switching = np.empty(phases.t.size), np.empty((phases.t.size, n))
    for k in range(phases.t.size):
        v = phases.v[k]
        a = acceleration(phases.q[k], v, tau[k])
        inertia = np.triu(pin.crba(model, data, robot.configuration(phases.q[k])))
        inertia = inertia + np.triu(inertia, 1).T
        switching[k] = np.linalg.solve(inertia, phases.costate[k, n:]) + w * tau[k]
        hamiltonian[k] = 1 + w / 2 * tau[k] @ tau[k] + phases.costate[k, :n] @ v + phases.costate[k, n:] @ a
    up, down = problem.limits.effort_upper - tau, tau - problem.limits.effort_lower
    fall = np.maximum(switching, 0) * down + np.maximum(-switching, 0) * up
    if w > 0:  # H is a parabola in the torque: its bottom may be nearer than the limit
        fall = np.minimum(fall, switching**2 / (2 * w))
    worst = 0.0
    for k, a in enumerate(phases.arc_of):
        first = k == 0 or phases.arc_of[k - 1] != a
        for i, mode in enumerate(phases.arcs[a].modes):
            if mode in BANG or not first:  # a free torque is extrapolated to the knot where its arc begins
                worst = max(worst, fall[k, i])
    return hamiltonian, switching, float(max(worst, _worst_pull(phases)))


def _worst_pull(phases: Phases) -> float:
    """How much a held velocity or position would rather be let inward, relative to its largest pull outward."""
    worst, K = 0.0, phases.arc_of.size
    for i in range(phases.q.shape[1]):
        modes = [phases.arcs[a].modes[i] for a in phases.arc_of]
        fast = [-outward(mode) * phases.state_pull[k, :, 1, i] for k, mode in enumerate(modes) if mode in VELOCITY]
        inside = np.array([mode in POSITION for mode in modes])
        sign = np.array([outward(mode) for mode in modes])
        stages, knots = _position_pulls(phases, i, inside)
        met = np.zeros(K - 1)  # at the knots between intervals: in contact on either side, or touching
        met[inside[1:]], met[inside[:-1]] = sign[1:][inside[1:]], sign[:-1][inside[:-1]]
        for a, arc in enumerate(phases.arcs[:-1]):
            for joint, mode in arc.touches:
                if joint == i:
                    met[np.flatnonzero(phases.arc_of == a)[-1]] = outward(mode)
        near = [-sign[k] * stages[k] for k in np.flatnonzero(inside)] + [-(met * knots)[met != 0]]
        for pulls in (fast, near):
            if sum(map(len, pulls)):
                every = np.concatenate(pulls)
                worst = max(worst, -np.min(every) / max(np.max(np.abs(every)), 1e-300))
    return worst


def _position_pulls(phases: Phases, i: int, inside: NDArray[np.bool_]) -> tuple[Array, Array]:
    """A position limit's ∂t_f/∂q_i at the inner stages, shape (K, stages - 1), and inner knots, shape (K - 1,).

    In contact the program holds the velocity, too, and asks nothing of q's defects. Here the limit is one
    of position alone: multipliers of the defects stand in for the pulls on the velocities.
    """
    K, s = phases.arc_of.size, TABLEAU.c.size
    stages, knots = phases.state_pull[:, :, 0, i].copy(), phases.knot_pull[:, 0, i].copy()
    lengths = np.diff(phases.t)
    for k in np.flatnonzero(inside):
        last = phases.knot_pull[k, 1, i] if k < K - 1 else 0.0
        costate = np.linalg.solve(lengths[k] * TABLEAU.A.T, np.append(phases.state_pull[k, :, 1, i], last))
        stages[k] += costate[: s - 1]
        if k < K - 1:
            knots[k] += costate[-1]
        if k > 0:
            knots[k - 1] -= costate.sum()
    return stages, knots


def _at_knots(phases: Phases) -> Array:
    """Torque at the knots, from the interval after each; at the end from the one before."""
    # A Radau interval ends with its last stage; to its start the stages are extrapolated.
    start, end = np.einsum("j,kji->ki", lagrange(TABLEAU.c, 0.0)[0], phases.tau), phases.tau[:, -1]
    return np.vstack([start, end[-1:]])
