"""Arcs of known structure and unknown durations: their nonlinear program, and its solution as phases.

Every arc is a phase of five-stage Radau IIA collocation on which the torque (or the velocity, or the position)
of each joint stays on its limit. The unknowns are the durations: within a phase the motion
is smooth, so that the collocation's error falls with its full order, and t_f is exact to rounding.
The multipliers of the defects are the costates.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.mesh.arc_data import ArcNlpData, assemble_arcs
from armdyn.optimal.mesh.assembly import Nlp, build_nlp
from armdyn.optimal.mesh.grid import Density, density_of, layered
from armdyn.optimal.mesh.ipopt import Ipopt, ipopt_for
from armdyn.optimal.mesh.solver import NlpResult
from armdyn.optimal.problem.options import SolverSettings
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.arc import Arc
from armdyn.optimal.verify.phases import TABLEAU, Phases, motion_of
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Unresolved:
    """Phases that did not converge.

    Attributes:
        message: IPOPT's status in words.
        status: status of the solve.
        iterations: iterations of IPOPT.
        last: last iterate: at best a guess of a solution.
    """

    message: str
    status: Status
    iterations: int
    last: Phases


def solve_phases(
    task: Task,
    arcs: Sequence[Arc],
    guess: Trajectory,
    intervals: int,
    warm: bool = False,
    offset: Array | float = 0.0,
    density: Density | None = None,
) -> Phases | Unresolved:
    """Solve for the durations of arcs by Newton's method in IPOPT.

    Args:
        task: the problem and its settings.
        arcs: the structure, and guesses of its durations.
        guess: initial states, at the times of the guessed durations.
        intervals: number of intervals of the whole mesh.
        warm: whether the guess solves a similar problem: IPOPT then starts with a small barrier.
        offset: offset of the end state from the goal, (q, v), shape (2 nv,), which the replay's error cancels.
        density: density of the mesh; None: intervals in proportion to the arcs' lengths.
    """
    solver = _solver(task, intervals, warm)
    nlp_data = assemble_arcs(task, arcs, guess, solver.program.layout, intervals, warm, offset, density)
    if nlp_data.spare < 0:
        message = f"the structure has more conditions than unknowns, by {-nlp_data.spare}"
        result = NlpResult(
            Status.INFEASIBLE, message, 0, nlp_data.x, np.zeros_like(nlp_data.x), np.zeros_like(nlp_data.g_bounds[0])
        )
    else:
        result = solver.solve(nlp_data, task.stop)
    phases = _read(task, solver.program, nlp_data, result)
    if result.status is Status.SOLVED:
        return phases
    return Unresolved(result.message, result.status, result.iterations, phases)


def _solver(task: Task, intervals: int, warm: bool) -> Ipopt[Nlp]:
    step = replace(task, scheme=replace(task.scheme, control="stage"))
    numbers = task.policy.arcs
    barrier, push = (numbers.near_barrier, numbers.near_barrier) if warm else (numbers.barrier, None)
    settings = SolverSettings(numbers.tolerance, numbers.iterations, barrier=barrier, exact=True, push=push)
    return step.in_time(lambda scheme: ipopt_for(settings, build_nlp, task.dynamics, scheme, intervals))


def _read(task: Task, nlp: Nlp, nlp_data: ArcNlpData, result: NlpResult) -> Phases:
    """Phases from unknowns and multipliers."""
    layout, N, n, scales, x = nlp.layout, nlp.intervals, nlp.layout.nv, nlp_data.scales, result.x
    problem, numbers = task.problem, task.policy.arcs
    units = np.array([scales.length, scales.speed])[:, None]
    lengths = np.maximum(x[layout.times(N)[:-1]] * scales.time * nlp_data.part, 1e-12)
    t = np.concatenate([[0], np.cumsum(lengths)])
    arcs = tuple(
        replace(arc, duration=float(lengths[nlp_data.arc_of == a].sum())) for a, arc in enumerate(nlp_data.arcs)
    )
    knots = x[layout.states(N)].reshape(N + 1, 1, 2, n) * units
    stages = np.concatenate([x[layout.inner_states(N)].reshape(N, -1, 2, n) * units, knots[1:]], axis=1)
    tau = x[layout.torques(N)] * scales.effort
    states = np.concatenate([knots[:-1], stages], axis=1)
    torques = motion_of(problem, arcs, nlp_data.arc_of, t, states, tau, numbers)
    gradient = _gradient(nlp, nlp_data, result)
    by_torque = gradient[layout.torques(N)] * (scales.time / scales.effort)
    costate, stage_costate = _costates(nlp, nlp_data, result, gradient)
    multiplier = scales.time / units
    return Phases(
        arcs=arcs,
        t=t,
        q=knots[:, 0, 0],
        v=knots[:, 0, 1],
        costate=costate,
        tau=tau,
        arc_of=nlp_data.arc_of,
        mesh_density=nlp_data.density,
        density=_density(
            t, states, stage_costate, layered(torques, problem.robot.friction, numbers), numbers.least_density
        ),
        points=np.stack([stages[:, :, 0], stages[:, :, 1], tau]).reshape(3, -1, n),
        pushed=stage_costate[:, :, n:].reshape(-1, n),
        switched=np.where(problem.limits.passive, 0.0, by_torque).reshape(-1, n),
        state_multiplier=gradient[layout.inner_states(N)].reshape(N, -1, 2, n) * multiplier,
        knot_multiplier=gradient[layout.states(N)[1:-1]].reshape(N - 1, 2, n) * multiplier,
        torques=torques,
        iterations=result.iterations,
    )


def _density(t: Array, states: Array, stage_costate: Array, layers: Density | None, least_density: float) -> Density:
    """Mesh density from the curvature of states and costates, and from the layers of dry friction."""
    flat = states.reshape(*states.shape[:2], -1)
    costate = stage_costate / (TABLEAU.b[:, None] * np.diff(t)[:, None, None])
    density = density_of(t, [(np.append(0, TABLEAU.c), flat), (TABLEAU.c, costate)], least_density)
    return density if layers is None else density.with_half_of(layers)


def _gradient(nlp: Nlp, nlp_data: ArcNlpData, result: NlpResult) -> Array:
    """Gradient ∇f + Jᵀλ of the objective and the equations; at an optimum its negative is the bounds' multipliers."""
    jacobian = nlp.jacobian(result.x, nlp_data.p)[1]
    gradient = np.array(ca.mtimes(jacobian.T, result.lam_g)).ravel()
    gradient += np.array(nlp.gradient(result.x, nlp_data.p)).ravel()
    return gradient


def _costates(nlp: Nlp, nlp_data: ArcNlpData, result: NlpResult, gradient: Array) -> tuple[Array, Array]:
    """Costates at the knots, shape (N + 1, 2 nv), and their integrals over the stages, shape (N, stages, 2 nv)."""
    layout, N, scales = nlp.layout, nlp.intervals, nlp_data.scales
    rows = result.lam_g[: N * layout.rows].reshape(N, layout.rows)[:, layout.defects]  # (N, stages, 2 nv)
    units = np.repeat([scales.length, scales.speed], layout.nv)
    costate = np.concatenate([-rows.sum(axis=1), -gradient[layout.states(N)[-1:]]])
    lengths = nlp_data.part * result.x[layout.times(N)[:-1]]
    integrals = -np.einsum("kia,ij,k->kja", rows, TABLEAU.A, lengths * scales.time)
    return costate * scales.time / units, integrals * scales.time / units
