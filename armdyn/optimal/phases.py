"""Arcs of known structure as one nonlinear program whose durations are unknown.

Every arc is a phase of five-stage Radau IIA collocation on which the torque (or the velocity, or the position)
of each joint stays on its limit. What is left to find are the durations: within a phase the motion
is smooth, so that the collocation's error falls with its full order, and t_f is exact to rounding.
The multipliers of the defects are the costates.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.arcs import BANG, POSITION, VELOCITY, Arc, Mode
from armdyn.optimal.ipopt import make_solver
from armdyn.optimal.layers import fractions_within, mesh_measure
from armdyn.optimal.mesh import Scales, bounds, split, tie_break, to_unknowns
from armdyn.optimal.monitor import Monitor, Stop
from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.optimal.tableau import RADAU_5
from armdyn.optimal.transcription import Layout, Nlp, Scheme, build_nlp
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

TABLEAU = RADAU_5
"""Of the arcs: motion is smooth on them, and ninth order leaves nothing to see on a few intervals."""
_TOLERANCE = 1e-10
"""Of IPOPT on the scaled problem: durations then hold to about as much."""
_TIE = 1e-6
"""Cost of full torques on joints that time leaves free, against the 1 of time: it makes them unique."""
_SAMPLES = 480
"""Torque samples, about, on all arcs where the torque is not constant together: 4 to 16 on an interval."""


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
        stage_q: positions at the stages, shape (K, stages, nv).
        stage_v: velocities at the stages, shape (K, stages, nv).
        stage_costate: ∫ρ over each stage's share of the time, shape (K, stages, 2 nv): what multiplies a
            change of the rates there.
        torque_pull: ∂t_f/∂tau at the stages [s/(N m)], shape (K, stages, nv); 0 where it is free.
        state_pull: the same for (q, v) at the inner stages [s/rad, s²/rad], shape (K, stages - 1, 2, nv).
        knot_pull: the same at the inner knots, shape (K - 1, 2, nv).
        torques: the torque over time, its states only a guess: for `replay_torques`.
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
) -> Phases:
    """Durations of arcs, by Newton's method in the shape of IPOPT.

    Args:
        problem: what is to be solved.
        arcs: the structure, and guesses of its durations.
        guess: states to start from, at the times that the durations say.
        dynamics: of the problem's robot.
        scheme: says the form of the dynamics.
        intervals: of the whole mesh, dealt out by the arcs' lengths.
        stop: asked at every iteration.
        offset: how far beside the goal the collocation shall end, in (q, v), shape (2 nv,): where
            the collocation's error takes it back.
        near: the guess solves nearly the same problem: IPOPT stays where it is.
    """
    n, N = problem.robot.nv, intervals
    singular = any(arc.singular for arc in arcs)
    nlp, solver, monitor = _solver(
        dynamics, replace(scheme, method=TABLEAU.name, control="stage"), N, singular, near or not singular
    )
    layout = nlp.layout
    scales = Scales.of(problem, guess)
    durations = np.array([arc.duration for arc in arcs])
    edges = np.append(0.0, np.cumsum(durations)) / durations.sum()
    measure = mesh_measure(guess, problem.robot.friction)
    per_arc = _deal(durations if measure is None else np.diff(np.interp(edges, *measure)), N)
    arc_of = np.repeat(np.arange(len(arcs)), per_arc)
    part = fractions_within(edges, per_arc, measure)
    share = durations[arc_of] * part / durations.sum()
    x = to_unknowns(guess, layout, share, scales)
    lower, upper = bounds(problem, nlp, scales)
    _fix_modes(problem, arcs, arc_of, nlp, scales, lower, upper)
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
    weight = problem.effort_weight
    if weight == 0 and singular:
        weight = tie_break(problem, _TIE)
    parameters = np.concatenate([part, scales.parameters(weight, dynamics.last_body)])
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
    own = layout.knot + layout.inner
    unit = scales.time / np.array([scales.length, scales.speed])[:, None]
    blocks = slope[: own * N].reshape(N, own)[:, layout.knot :]
    q, v = knots[:, :n] * scales.length, knots[:, n : 2 * n] * scales.speed
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
        stage_q=states[:, :, 0] * scales.length,
        stage_v=states[:, :, 1] * scales.speed,
        stage_costate=share_of_costate,
        state_pull=blocks[:, : layout.stages].reshape(N, -1, 2, n) * unit,
        torque_pull=blocks[:, layout.stages : layout.stages + layout.torques].reshape(N, stages, n)
        * (scales.time / scales.effort),
        knot_pull=slope[np.arange(1, N)[:, None] * own + np.arange(2 * n)].reshape(N - 1, 2, n) * unit,
        torques=_torque_trajectory(problem, layout, found, arc_of, t, q, v, tau),
        iterations=int(stats["iter_count"]),
    )


def _deal(durations: Array, intervals: int) -> NDArray[np.int_]:
    """Intervals for every arc: two at least, the rest by its length."""
    spare = intervals - 2 * durations.size
    counts: NDArray[np.int_] = 2 + np.floor(spare * durations / durations.sum()).astype(int)
    counts[np.argmax(durations)] += intervals - counts.sum()
    return counts


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
) -> None:
    """Narrow the bounds, in place, to what the arcs say."""
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


def _torque_trajectory(
    problem: MinimumTimeProblem,
    layout: Layout,
    arcs: Sequence[Arc],
    arc_of: NDArray[np.int_],
    t: Array,
    q: Array,
    v: Array,
    tau: Array,
) -> Trajectory:
    """The torques over time; on arcs where they vary, samples of the stages' polynomial within the limits."""
    c, limits = layout.scheme.tableau.c, problem.limits
    varying = sum(any(mode not in BANG for mode in arcs[a].modes) for a in arc_of)
    samples = int(np.clip(_SAMPLES // max(varying, 1), 4, 16))
    rows_t, rows_tau, rows_k = [], [], []
    for k, a in enumerate(arc_of):
        constant = all(mode in BANG for mode in arcs[a].modes)
        s = np.array([0.0, 1.0]) if constant else np.linspace(0, 1, samples + 1)
        weights = np.array([[lagrange(c, j, at) for j in range(c.size)] for at in s])
        values = np.clip(weights @ tau[k], limits.effort_lower, limits.effort_upper)
        for i, mode in enumerate(arcs[a].modes):
            if mode in BANG:
                values[:, i] = (limits.effort_upper if mode is Mode.UPPER else limits.effort_lower)[i]
        times = t[k] + s * (t[k + 1] - t[k])
        times[-1] = np.nextafter(t[k + 1], 0) if k < arc_of.size - 1 else t[k + 1]
        rows_t.append(times)
        rows_tau.append(values)
        rows_k.append(np.where(s < 1, k, k + 1))
    index = np.concatenate(rows_k)
    times, values = np.concatenate(rows_t), np.concatenate(rows_tau)
    # Where the torque does not jump the sample one ulp before a knot says nothing new.
    jump = np.append(np.any(np.abs(np.diff(values, axis=0)) > 0, axis=1) | (np.diff(times) > 1e-13), True)
    return Trajectory(
        times[jump], q[index][jump], v[index][jump], values[jump], problem.robot.joint_names, "minimum time"
    )


def lagrange(c: Array, j: int, s: float) -> float:
    """The polynomial through the stages c that is 1 at stage j and 0 at the others, at s."""
    others = np.delete(c, j)
    return float(np.prod((s - others) / (c[j] - others)))


@lru_cache(maxsize=32)
def _solver(
    dynamics: Dynamics, scheme: Scheme, intervals: int, singular: bool, near: bool
) -> tuple[Nlp, ca.Function, Monitor]:
    nlp = build_nlp(dynamics, scheme, intervals)
    # "Acceptable" to IPOPT is a defect of 1e-2: not to us.
    newton: dict[str, float | str] = {"bound_relax_factor": 0.0, "acceptable_iter": 0, "mu_init": 1e-3}
    if near:  # or all torques are held: Newton's method from where it stands
        newton |= {"mu_init": 1e-9, "bound_push": 1e-9, "bound_frac": 1e-9}
    solver, monitor = make_solver(nlp, _TOLERANCE, 100 if singular else 60, options=newton)
    return nlp, solver, monitor
