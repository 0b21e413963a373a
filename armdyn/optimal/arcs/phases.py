"""Arcs of known structure as one nonlinear program whose durations are unknown.

Every arc is a phase of five-stage Radau IIA collocation on which the torque (or the velocity, or the position)
of each joint stays on its limit. What is left to find are the durations: within a phase the motion
is smooth, so that the collocation's error falls with its full order, and t_f is exact to rounding.
The multipliers of the defects are the costates.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.exclusive import built_once, one_at_a_time
from armdyn.optimal.arcs.arc import BANG, POSITION, VELOCITY, Arc, Mode
from armdyn.optimal.arcs.grid import Density, deal, density_of
from armdyn.optimal.arcs.layers import layered
from armdyn.optimal.arcs.sampling import sampled
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.program.assembly import Layout, Nlp, build_nlp
from armdyn.optimal.program.unknowns import Scales, bounds, split, to_unknowns
from armdyn.optimal.solve.ipopt import make_solver
from armdyn.optimal.solve.monitor import Monitor
from armdyn.optimal.task.scheme import Scheme
from armdyn.optimal.task.tableau import RADAU_5
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

TABLEAU = RADAU_5
"""Of the arcs: motion is smooth on them, and ninth order leaves nothing to see on a few intervals."""
_TOLERANCE = 1e-10
"""Of IPOPT on the scaled problem: durations then hold to about as much."""
_FEW, _SOME, _MANY = 60, 100, 200
"""Iterations of IPOPT where all torques are held, where some are free, and where they are to be smooth."""
_TIE = 1e-5
"""Cost of full torques on joints that time leaves free, against the 1 of time: it makes them unique."""


@dataclass(frozen=True, eq=False)
class Phases:
    """A solved multi-phase problem.

    Attributes:
        converged: IPOPT's word.
        message: the same.
        arcs: with the durations found.
        t: times of the knots [s], shape (K + 1,).
        q: positions at the knots, shape (K + 1, nv).
        v: velocities, shape (K + 1, nv).
        costate: ρ = ∂(time to go)/∂(q, v) at the knots, from the multipliers, shape (K + 1, 2 nv).
        tau: torques at the stages, shape (K, stages, nv).
        arc_of: which arc an interval is in, shape (K,).
        laid: what the intervals were laid by; None: the arcs' lengths.
        layers: where dry friction turns around, over the same time; None: nowhere.
        stage_q: positions at the stages, shape (K, stages, nv).
        stage_v: velocities at the stages, shape (K, stages, nv).
        stage_costate: ∫ρ over each stage's share of the time, shape (K, stages, 2 nv): what multiplies a
            change of the rates there.
        torque_pull: ∂t_f/∂tau at the stages [s/(N m)], shape (K, stages, nv); 0 where it is free.
        state_pull: the same for (q, v) at the inner stages [s/rad, s²/rad], shape (K, stages - 1, 2, nv).
        knot_pull: the same at the inner knots, shape (K - 1, 2, nv).
        torques: the motion over time by the collocation's polynomials, for `replay_torques` and as a guess.
        iterations: of IPOPT.
    """

    converged: bool
    message: str
    arcs: tuple[Arc, ...]
    t: Array
    q: Array
    v: Array
    costate: Array
    tau: Array
    arc_of: NDArray[np.int_]
    laid: Density | None
    layers: Density | None
    stage_q: Array
    stage_v: Array
    stage_costate: Array
    torque_pull: Array
    state_pull: Array
    knot_pull: Array
    torques: Trajectory
    iterations: int

    @property
    def duration(self) -> float:
        """t_f [s]."""
        return float(self.t[-1])

    @property
    def density(self) -> Density:
        """Where another mesh needs its intervals."""
        c = TABLEAU.c
        states = np.concatenate([self.stage_q, self.stage_v], axis=2)
        from_start = np.concatenate([np.concatenate([self.q, self.v], axis=1)[:-1, None], states], axis=1)
        costate = self.stage_costate / (TABLEAU.b[:, None] * np.diff(self.t)[:, None, None])
        bends = density_of(self.t, [(np.append(0, c), from_start), (c, costate)])
        return bends if self.layers is None else bends.with_half_of(self.layers)


def solve_phases(
    problem: MinimumTimeProblem,
    arcs: Sequence[Arc],
    guess: Trajectory,
    dynamics: Dynamics,
    scheme: Scheme,
    intervals: int,
    stop: Stop,
    offset: Array | float = 0.0,
    near: bool = False,
    density: Density | None = None,
    keep: Phases | None = None,
) -> Phases:
    """Durations of arcs, by Newton's method in the shape of IPOPT.

    Args:
        problem: what is to be solved.
        arcs: the structure, and guesses of its durations.
        guess: states to start from, at the times that the durations say.
        dynamics: of the problem's robot.
        scheme: says the form of the dynamics.
        intervals: of the whole mesh.
        stop: asked every few iterations.
        offset: how far beside the goal the collocation shall end, in (q, v), shape (2 nv,): where
            the collocation's error takes it back.
        near: the guess solves nearly the same problem: IPOPT stays where it is.
        density: where the intervals are needed; None: they are dealt out by the arcs' lengths.
        keep: a solution on the same mesh whose torques off all limits stay; None: they are free.
    """
    n, N = problem.robot.nv, intervals
    singular = any(arc.singular for arc in arcs)
    iterations = (_MANY if problem.effort_weight else _SOME) if singular else _FEW
    nlp, solver, monitor = _solver(dynamics, _of_arcs(scheme), N, near or not singular, iterations)
    layout = nlp.layout
    scales = Scales.of(problem, guess)
    durations = np.array([arc.duration for arc in arcs])
    density = density or layered(guess, problem.robot.friction)
    arc_of, part = deal(durations, N, density)
    share = durations[arc_of] * part / durations.sum()
    x = to_unknowns(guess, layout, share, scales)
    lower, upper = bounds(problem, nlp.layout, intervals, scales)
    _fix_modes(problem, arcs, arc_of, nlp, scales, lower, upper, keep)
    end = x.size - layout.knot
    for bound in (lower, upper):
        bound[end : end + 2 * n] += offset / np.repeat([scales.length, scales.speed], n)
    times = np.arange(N + 1) * (layout.knot + layout.inner) + 2 * n
    x[times] = np.append(durations[arc_of], durations[-1]) / scales.time
    lower[times] = 1e-9
    x = np.clip(x, lower, upper)

    lbg = np.zeros((N, nlp.defects))
    lbg[np.flatnonzero(np.diff(arc_of)), -1] = -np.inf  # every arc has a duration of its own
    for i in range(n):  # a held position: its defects say 0 = 0
        held = np.array([arcs[a].modes[i] in POSITION for a in arc_of.tolist()])
        rows = _defect_rows(layout, nlp)[:, i]
        lbg[np.ix_(held, rows)] = -np.inf
    tied = singular and problem.effort_weight == 0
    weights = scales.weights(problem.effort_weight, _TIE if tied else 0.0)
    parameters = np.concatenate([part, scales.parameters(weights, dynamics.last_body)])
    with one_at_a_time:
        monitor.stop = stop
        result = solver(x0=x, p=parameters, lbx=lower, ubx=upper, lbg=lbg.ravel(), ubg=-lbg.ravel())
        stats = solver.stats()
    x, lam = np.array(result["x"]).ravel(), np.array(result["lam_g"]).ravel()
    word = str(stats["return_status"])
    converged = word in ("Solve_Succeeded", "Solved_To_Acceptable_Level") and bool(np.all(np.isfinite(x)))

    knots, inner = split(x, layout, N)
    lengths = np.maximum(knots[:-1, 2 * n] * scales.time * part, 1e-12)
    t = np.concatenate([[0], np.cumsum(lengths)])
    stages = layout.scheme.tableau.c.size
    tau = inner[:, layout.stages : layout.stages + layout.torques].reshape(N, stages, n) * scales.effort
    found = tuple(replace(arc, duration=float(lengths[arc_of == a].sum())) for a, arc in enumerate(arcs))
    costate, share_of_costate, slope = _multipliers(nlp, x, parameters, lam, scales)
    states = np.concatenate([inner[:, : layout.stages], knots[1:, : 2 * n]], axis=1).reshape(N, stages, 2, n)
    states = states * np.array([scales.length, scales.speed])[:, None]
    own = layout.knot + layout.inner
    unit = scales.time / np.array([scales.length, scales.speed])[:, None]
    blocks = slope[: own * N].reshape(N, own)[:, layout.knot :]
    q, v = knots[:, :n] * scales.length, knots[:, n : 2 * n] * scales.speed
    start = np.stack([q[:-1], v[:-1]], axis=1)[:, None]
    torques = sampled(problem, TABLEAU, found, arc_of, t, np.concatenate([start, states], axis=1), tau)
    return Phases(
        converged=converged,
        message=word.replace("_", " "),
        arcs=found,
        t=t,
        q=q,
        v=v,
        costate=costate,
        tau=tau,
        arc_of=arc_of,
        laid=density,
        layers=layered(torques, problem.robot.friction),
        stage_q=states[:, :, 0],
        stage_v=states[:, :, 1],
        stage_costate=share_of_costate,
        state_pull=blocks[:, : layout.stages].reshape(N, -1, 2, n) * unit,
        torque_pull=blocks[:, layout.stages : layout.stages + layout.torques].reshape(N, stages, n)
        * (scales.time / scales.effort),
        knot_pull=slope[np.arange(1, N)[:, None] * own + np.arange(2 * n)].reshape(N - 1, 2, n) * unit,
        torques=torques,
        iterations=int(stats["iter_count"]),
    )


def prepare_phases(dynamics: Dynamics, scheme: Scheme, intervals: int) -> None:
    """Build, if it is not there, what `solve_phases` needs for arcs without free torques."""
    _solver(dynamics, _of_arcs(scheme), intervals, True, _FEW)


def _of_arcs(scheme: Scheme) -> Scheme:
    return replace(scheme, method=TABLEAU.name, control="stage")


def _defect_rows(layout: Layout, nlp: Nlp) -> NDArray[np.int_]:
    """Rows of the state defects in an interval, shape (stages, 2 nv)."""
    stages = layout.scheme.tableau.c.size
    first = nlp.defects - 1 - stages * 2 * layout.nv
    rows: NDArray[np.int_] = np.arange(first, nlp.defects - 1).reshape(stages, 2 * layout.nv)
    return rows


def _fix_modes(
    problem: MinimumTimeProblem,
    arcs: Sequence[Arc],
    arc_of: NDArray[np.int_],
    nlp: Nlp,
    scales: Scales,
    lower: Array,
    upper: Array,
    keep: Phases | None,
) -> None:
    """Narrow the bounds, in place, to what the arcs say, and to the torques that stay."""
    layout, limits, n = nlp.layout, problem.limits, nlp.layout.nv
    block, stages, inner_states = layout.knot + layout.inner, layout.scheme.tableau.c.size, layout.stages // (2 * n)

    def fix(index: int, value: float) -> None:
        lower[index] = upper[index] = value

    def held(first: int, i: int, mode: Mode) -> None:
        """State of joint i, that begins at `first`, on its limit."""
        if mode in VELOCITY:
            fix(first + n + i, (1 if mode is Mode.VELOCITY_UPPER else -1) * limits.velocity[i] / scales.speed)
        if mode in POSITION:
            bound = limits.position_upper if mode is Mode.POSITION_UPPER else limits.position_lower
            fix(first + i, bound[i] / scales.length)
            fix(first + n + i, 0.0)

    N = arc_of.size
    for k in range(N):
        arc, base = arcs[arc_of[k]], k * block
        for i, mode in enumerate(arc.modes):
            if mode in BANG:
                bound = limits.effort_upper if mode is Mode.UPPER else limits.effort_lower
                for j in range(stages):
                    fix(base + layout.knot + layout.stages + j * n + i, bound[i] / scales.effort[i])
            if mode is Mode.FREE and keep is not None:
                for j in range(stages):
                    value = np.clip(keep.tau[k, j, i], limits.effort_lower[i], limits.effort_upper[i])
                    fix(base + layout.knot + layout.stages + j * n + i, value / scales.effort[i])
            if k > 0 and arc_of[k - 1] != arc_of[k]:
                held(base, i, mode)  # entered on the limit, not within the first interval
            for j in range(inner_states):
                held(base + layout.knot + 2 * n * j, i, mode)
            if k < N - 1:
                held(base + block, i, mode)  # Radau's last stage is the next knot
        if k < N - 1 and arc_of[k + 1] != arc_of[k]:
            for i, mode in arc.touches:
                held(base + block, i, mode)


def _multipliers(nlp: Nlp, x: Array, parameters: Array, lam: Array, scales: Scales) -> tuple[Array, Array, Array]:
    """Costates at the knots, their integrals over the stages, and the gradient of the Lagrangian."""
    layout, N, n = nlp.layout, nlp.intervals, nlp.layout.nv
    rows = lam.reshape(N, nlp.defects)[:, _defect_rows(layout, nlp)]  # (N, stages, 2 nv)
    state = np.repeat([scales.length, scales.speed], n)
    slope = np.array(ca.mtimes(nlp.jacobian(x, parameters)[1].T, lam)).ravel()
    slope += np.array(nlp.gradient(x, parameters)).ravel()
    costate = np.empty((N + 1, 2 * n))
    costate[:-1] = -rows.sum(axis=1)
    last = x.size - layout.knot
    costate[-1] = -slope[last : last + 2 * n]
    lengths = parameters[:N] * x[np.arange(N) * (layout.knot + layout.inner) + 2 * n]
    weight = -np.einsum("kia,ij,k->kja", rows, layout.scheme.tableau.A, lengths * scales.time)
    return costate * scales.time / state, weight * scales.time / state, slope


@built_once(maxsize=32)
def _solver(
    dynamics: Dynamics, scheme: Scheme, intervals: int, near: bool, iterations: int
) -> tuple[Nlp, ca.Function, Monitor]:
    nlp = build_nlp(dynamics, scheme, intervals)
    # "Acceptable" to IPOPT is a defect of 1e-2: not to us.
    newton: dict[str, float | str] = {"bound_relax_factor": 0.0, "acceptable_iter": 0, "mu_init": 1e-3}
    if near:  # or all torques are held: Newton's method from where it stands
        newton |= {"mu_init": 1e-9, "bound_push": 1e-9, "bound_frac": 1e-9}
    solver, monitor = make_solver(nlp, _TOLERANCE, iterations, options=newton)
    return nlp, solver, monitor
