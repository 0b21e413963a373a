"""Hermite-Simpson with few unknowns, for the search.

Where dynamics are forward the middle of an interval follows from its ends,

    x_m = (x_k + x_{k+1}) / 2 + h / 8 (f_k - f_{k+1}),

which is what the equations of `transcription` say together (Betts, Practical Methods for Optimal Control, 2010,
section 4.5: compressed against separated). It is put in, and the final time stands once instead of at every knot:
half as many unknowns and equations, the same solutions, and four fifths of the time for an iteration. The price
are limits of positions and velocities that hold at the knots and no more in the middle, and so no conditions along
the way.

    w = [x_0 | u_0 | x_1 | u_1 | … | x_N | T], with u_N only if the torque is linear between knots
"""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.exclusive import built_once, one_at_a_time
from armdyn.optimal.conditions.course import path_rows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.program.assembly import (
    Index,
    IntervalFunctions,
    Layout,
    Program,
    differentiated,
    mapped,
    parameters_of,
)
from armdyn.optimal.program.unknowns import Scales, bounds, to_trajectory, to_unknowns, worst_violation
from armdyn.optimal.solve.direct import Attempt, _solve_on_mesh, effort_weights, mesh, outcome, prepare
from armdyn.optimal.solve.ipopt import make_solver
from armdyn.optimal.solve.monitor import Monitor
from armdyn.optimal.task.options import DirectOptions
from armdyn.optimal.task.scheme import Scheme
from armdyn.optimal.task.tableau import LOBATTO_3
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_NEAR = 1e-3
"""Of a joint's travel, and of its velocity limit: so near to a limit it is reached."""
_RELAXED = 1e-8
"""What IPOPT lets unknowns exceed their bounds by."""


def condensable(problem: MinimumTimeProblem, scheme: Scheme) -> bool:
    """Whether a search may do with so few unknowns."""
    plain = scheme.tableau is LOBATTO_3 and scheme.dynamics == "forward" and scheme.control != "stage"
    return plain and problem.robot.nv <= 3 and not problem.conditions


def solve_quickly(
    problem: MinimumTimeProblem,
    guess: Trajectory,
    dynamics: Dynamics,
    scheme: Scheme,
    intervals: int,
    options: DirectOptions,
    stop: Stop,
    between: bool = True,
) -> Attempt:
    """`direct.solve_on_mesh`, by way of the condensed program where that is possible.

    Args:
        problem: what is to be solved.
        guess: where it starts.
        dynamics: of the problem's robot.
        scheme: the transcription.
        intervals: of the mesh.
        options: iteration limit, tolerance, verbosity.
        stop: asked every few iterations.
        between: a solution that exceeds a limit between the knots is solved again with all unknowns.
    """
    if not condensable(problem, scheme) or (between and _on_limits(problem, guess)):
        return _solve_on_mesh(problem, guess, dynamics, scheme, intervals, options, stop)
    attempt, within = _condensed(problem, guess, dynamics, scheme, intervals, options, stop)
    if within or not between or attempt.status is not Status.SOLVED:
        return attempt
    again = _solve_on_mesh(problem, attempt.trajectory, dynamics, scheme, intervals, options, stop)
    return replace(again, iterations=attempt.iterations + again.iterations)


def _on_limits(problem: MinimumTimeProblem, guess: Trajectory) -> bool:
    """A guess that reaches a position or velocity limit is likely to exceed it between the knots."""
    limits, near = problem.limits, _NEAR * np.ptp(guess.q, axis=0)
    beyond = np.any((guess.q <= limits.position_lower + near) | (guess.q >= limits.position_upper - near))
    return bool(beyond or np.any(np.abs(guess.v) >= (1 - _NEAR) * limits.velocity))


def _condensed(
    problem: MinimumTimeProblem,
    guess: Trajectory,
    dynamics: Dynamics,
    scheme: Scheme,
    intervals: int,
    options: DirectOptions,
    stop: Stop,
) -> tuple[Attempt, bool]:
    """An attempt, and whether it keeps all limits between the knots, too."""
    program, solver, monitor = _solver(dynamics, scheme, intervals, options)
    scales, layout, places = Scales.of(problem, guess), Layout(dynamics.nv, scheme), program.places
    fractions = np.diff(mesh(intervals, dynamics.nv))
    numbers = scales.parameters(effort_weights(problem, scales), dynamics.last_body)
    parameters = np.concatenate([fractions, numbers])
    lower, upper = bounds(problem, layout, intervals, scales)
    start = np.clip(to_unknowns(guess, layout, fractions, scales), lower, upper)[places.kept]
    with one_at_a_time:
        monitor.stop = stop
        result = solver(x0=start, p=parameters, lbx=lower[places.kept], ubx=upper[places.kept], lbg=0, ubg=0)
        status, word, iterations = outcome(solver, stop)
    found = np.array(result["x"]).ravel()
    found = found if np.all(np.isfinite(found)) else start
    x = np.empty(layout.size(intervals))
    x[places.kept], x[places.times] = found, found[-1]
    x[places.middles] = np.array(program.middles(found, parameters)).ravel(order="F")
    violation = None
    if status is not Status.SOLVED:
        defects = np.array(solver.get_function("nlp_g")(found, parameters)).reshape(intervals, -1)
        violation = worst_violation(problem, layout, x, defects, fractions, scales)
    motion = to_trajectory(x, layout, fractions, scales, problem.robot.joint_names)
    beyond = np.maximum(lower - x, x - upper)[places.middles]
    within = bool(np.max(beyond) <= max(options.tolerance, _RELAXED))
    return Attempt(status, word, motion, intervals, iterations, violation), within


def prepare_quickly(
    problem: MinimumTimeProblem, dynamics: Dynamics, scheme: Scheme, intervals: int, options: DirectOptions
) -> None:
    """Build, if it is not there, what `solve_quickly` is likely to need."""
    if condensable(problem, scheme):
        _solver(dynamics, scheme, intervals, options)
    else:
        prepare(dynamics, scheme, intervals, options, path_rows(problem))


@dataclass(frozen=True, eq=False)
class _Places:
    """Where the unknowns stand among those of `transcription`.

    Attributes:
        kept: for each its place; of the times the first.
        times: all of them.
        middles: of the states in the middle of the intervals.
    """

    kept: Index
    times: Index
    middles: Index


@dataclass(frozen=True, kw_only=True, eq=False)
class _Condensed(Program):
    """The program, and the middles of its intervals: (w, p) -> a column each."""

    places: _Places
    middles: ca.Function


def _places(layout: Layout, intervals: int) -> _Places:
    block, n = layout.knot + layout.inner, layout.nv
    knots, inner = block * np.arange(intervals + 1), block * np.arange(intervals) + layout.knot
    states = knots[:, None] + np.arange(2 * n)
    linear = layout.scheme.control == "linear"
    torques = (knots + 2 * n + 1 if linear else inner + layout.stages)[:, None] + np.arange(n)
    kept = np.sort(np.concatenate([states.ravel(), torques.ravel()]))
    return _Places(np.append(kept, 2 * n), knots + 2 * n, (inner[:, None] + np.arange(2 * n)).ravel())


@built_once(maxsize=16)
def _interval(dynamics: Dynamics, scheme: Scheme) -> tuple[IntervalFunctions, ca.Function]:
    """Functions of y = (x_k, u_k, x_{k+1}, T) or (x_k, u_k, x_{k+1}, u_{k+1}, T), and p; the middle's state."""
    n, linear = dynamics.nv, scheme.control == "linear"
    y, p = ca.SX.sym("y", 6 * n + 1 if linear else 5 * n + 1), ca.SX.sym("p", 1 + parameters_of(n))
    fraction, time, length, speed = ca.vertsplit(p[:4])
    weights, effort = p[4 : 4 + n], p[4 + n : 4 + 2 * n]
    body = ca.vertcat(*(p[4 + 2 * n + i] if present else 0 for i, present in enumerate(dynamics.last_body != 0)))
    scale = ca.vertcat(ca.repmat(length, n, 1), ca.repmat(speed, n, 1))
    left, right, duration = y[: 2 * n], y[3 * n : 5 * n], y[-1]
    first = y[2 * n : 3 * n]
    last = y[5 * n : 6 * n] if linear else first
    h = fraction * time * duration

    def rate(x: ca.SX, u: ca.SX) -> ca.SX:
        q, v = length * x[:n], speed * x[n:]
        return ca.vertcat(v, dynamics.aba(q, v, effort * u, body)) / scale

    start, end = rate(left, first), rate(right, last)
    middle = (left + right) / 2 + h / 8 * (start - end)
    defects = right - left - h / 6 * (start + 4 * rate(middle, (first + last) / 2) + end)
    squares = sum(
        b * ca.dot(weights, u**2) for b, u in zip(LOBATTO_3.b, (first, (first + last) / 2, last), strict=True)
    )
    cost = fraction * duration * (1 + squares / 2)

    functions = differentiated("condensed", y, p, defects, cost, scheme.compile)
    return functions, ca.Function("condensed_middle", [y, p], [middle])


def _program(dynamics: Dynamics, scheme: Scheme, intervals: int) -> _Condensed:
    n, N, (one, middle) = dynamics.nv, intervals, _interval(dynamics, scheme)
    places = _places(Layout(n, scheme), N)
    size, width = places.kept.size, one.jacobian_pattern.shape[1]
    own = np.vstack([np.arange(width - 1)[:, None] + 3 * n * np.arange(N), np.full((1, N), size - 1)])
    program, (y, parameters) = mapped(one, own, size, n)
    x, p = program.functions["x"], program.functions["p"]
    return _Condensed(
        functions=program.functions,
        jacobian=program.jacobian,
        hessian=program.hessian,
        places=places,
        middles=ca.Function("middles", [x, p], [middle.map(N)(y, parameters)]),
    )


@built_once(maxsize=16)
def _solver(
    dynamics: Dynamics, scheme: Scheme, intervals: int, options: DirectOptions
) -> tuple[_Condensed, ca.Function, Monitor]:
    program = _program(dynamics, scheme, intervals)
    solver, monitor = make_solver(
        program,
        options.tolerance,
        options.max_iterations,
        verbose=options.verbose,
        options={"mu_init": options.barrier},
    )
    return program, solver, monitor


def _old(f):
    return f


_solve_quickly, _prepare_quickly = solve_quickly, prepare_quickly


def solve_quickly(task, guess, intervals, settings, between=True):
    return _solve_quickly(task.problem, guess, task.dynamics, task.scheme, intervals, settings, task.stop, between)


def prepare_quickly(task, intervals, settings):
    return _prepare_quickly(task.problem, task.dynamics, task.scheme, intervals, settings)
