"""The same collocation for fatrop, an interior-point solver that factorises stage by stage.

Fatrop wants the unknowns as states and controls, x_{k+1} given by x_k and u_k, and all else as
constraints within a stage. An implicit method has that form once the end of an interval is a control:

    w   = [x_0 | u_0 | x_1 | u_1 | … | x_N]
    x_k = q, v, T at knot k
    u_k = inner stages, torques and accelerations of interval k, and e_k: q, v at its end
    g   = [x_1 - (e_0, T_0) | defects of interval 0 | x_2 - (e_1, T_1) | … | defects of interval N - 1]

Defects, scales and derivatives are those of `transcription`, interval by interval.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.errors import ProblemError
from armdyn.optimal.direct import Attempt, DirectOptions, effort_weights
from armdyn.optimal.mesh import Scales, bounds, split, to_trajectory, to_unknowns, worst_violation
from armdyn.optimal.monitor import Stop
from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.optimal.status import Status
from armdyn.optimal.transcription import (
    Layout,
    Nlp,
    Scheme,
    assemble,
    build_nlp,
    interval_functions,
    jacobian_function,
    parameters_of,
)
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

# fatrop 1.1, ip_algorithm.hpp: IpSolverReturnFlag; -1: an exception was caught.
_FATROP_STATUS = {
    0: (Status.SOLVED, "solve succeeded"),
    1: (Status.ITERATION_LIMIT, "maximum iterations exceeded"),
    2: (Status.FAILED, "stopped at a tiny step"),
    3: (Status.SOLVED, "solved to acceptable level"),
    4: (Status.INFEASIBLE, "infeasible problem detected"),
    5: (Status.FAILED, "stopped at a feasible point"),
    6: (Status.FAILED, "iterates diverge"),
    7: (Status.FAILED, "error in step computation"),
    8: (Status.FAILED, "invalid option"),
}


@dataclass(frozen=True)
class StagedNlp:
    """A nonlinear program in fatrop's order, with its exact derivatives.

    Attributes:
        layout: of the knots and inner blocks; a stage has the end of its interval besides.
        intervals: their number N.
        functions: x, p, f, g for nlpsol.
        jacobian: (x, p) -> (g, ∂g/∂x).
        hessian: (x, p, σ, λ) -> gradient and full symmetric Hessian of σ f + λᵀg.
        states: per stage, shape (N + 1,).
        controls: per stage, shape (N + 1,); the last stage has none.
        constraints: per stage besides its dynamics, shape (N + 1,).
    """

    layout: Layout
    intervals: int
    functions: dict[str, ca.MX]
    jacobian: ca.Function
    hessian: ca.Function
    states: tuple[int, ...]
    controls: tuple[int, ...]
    constraints: tuple[int, ...]


def build_staged(dynamics: Dynamics, scheme: Scheme, intervals: int) -> StagedNlp:
    """The program of an arm; parameters as those of `transcription.build_nlp`.

    Raises:
        ProblemError: the torque is linear, so that a knot's torque would belong to two stages.
    """
    if scheme.control == "linear":
        raise ProblemError('fatrop takes control="constant": linear torque ties the controls of neighbouring stages')
    layout, N = Layout(dynamics.nv, scheme), intervals
    one = interval_functions(dynamics, scheme)
    knot, end = layout.knot, 2 * layout.nv
    block, defects = knot + layout.inner + end, one.defects.numel_out(0) - 1  # without T_{k+1} = T_k, a dynamic
    rows, size = knot + defects, block * N + knot

    x = ca.MX.sym("x", size)
    p = ca.MX.sym("p", N + parameters_of(dynamics.nv))
    stage = ca.reshape(x[: block * N], block, N)
    duration = stage[end, :]
    y = ca.vertcat(stage, duration)
    parameters = ca.vertcat(p[:N].T, ca.repmat(p[N:], 1, N))

    following = ca.horzcat(stage[:knot, 1:], x[block * N :])
    gap = following - ca.vertcat(stage[block - end :, :], duration)
    g = ca.vec(ca.vertcat(gap, one.defects.map(N)(y, parameters)[:defects, :]))
    f = ca.sum2(one.cost.map(N)(y, parameters))

    # An interval's unknowns but for T_{k+1} are a stage's: its derivatives go where they are, gaps above them.
    row, col = (np.array(i) for i in one.jacobian_pattern.get_triplet())
    kept = np.flatnonzero((row < defects) & (col < block))
    pattern = ca.Sparsity.triplet(rows, block, (row[kept] + knot).tolist(), col[kept].tolist())
    nonzeros = one.jacobian.map(N)(y, parameters)[kept.tolist(), :]
    gaps = ca.evalf(ca.jacobian(ca.vec(ca.vertcat(gap, ca.MX(defects, N))), x))
    jacobian = gaps + assemble(pattern, (rows, block), (rows * N, size), nonzeros)

    sigma, lam = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", rows * N)
    weights = ca.vertcat(ca.reshape(lam, rows, N)[knot:, :], ca.MX.zeros(1, N))
    nonzeros = one.hessian.map(N)(y, parameters, ca.repmat(sigma, 1, N), weights)
    hessian = ca.triu2symm(assemble(one.hessian_pattern, (block, block), (size, size), nonzeros))
    gradient = sigma * ca.gradient(f, x) + ca.jtimes(g, x, lam, True)

    return StagedNlp(
        layout=layout,
        intervals=N,
        functions={"x": x, "p": p, "f": f, "g": g},
        jacobian=jacobian_function(x, p, g, jacobian),
        hessian=ca.Function(
            "nlp_hess_l",
            [x, p, sigma, lam],
            [gradient, hessian],
            ["x", "p", "lam_f", "lam_g"],
            ["grad_gamma_x", "hess_gamma_x_x"],
        ),
        states=(knot,) * (N + 1),
        controls=(block - knot,) * N + (0,),
        constraints=(defects,) * N + (0,),
    )


def solve_staged(
    problem: MinimumTimeProblem,
    guess: Trajectory,
    dynamics: Dynamics,
    scheme: Scheme,
    intervals: int,
    options: DirectOptions,
    stop: Stop,
) -> Attempt:
    """One call of fatrop; in place of `direct.solve_on_mesh`, which takes the same arguments.

    Fatrop asks nobody while it runs: `stop` is looked at before it starts, and what bounds a solve is
    `options.max_iterations`.

    Args:
        problem: what is to be solved.
        guess: where it starts.
        dynamics: of the problem's robot.
        scheme: the transcription, with constant torque.
        intervals: of the mesh, all of one length.
        options: iteration limit, tolerance, verbosity.
        stop: nothing is started once it says so.

    Returns:
        What came out, converged or not; a fatrop that fails is no exception.

    Raises:
        ProblemError: the problem has conditions along the way, or the torque is linear.
    """
    if problem.conditions:
        raise ProblemError(f"fatrop's program has no rows for {', '.join(problem.conditions)}")
    program = _program(dynamics, scheme, intervals, options)
    nlp = program.nlp
    scales = Scales.of(problem, guess)
    fractions = np.full(intervals, 1 / intervals)
    parameters = np.concatenate([fractions, scales.parameters(effort_weights(problem, scales), dynamics.last_body)])
    lower, upper = bounds(problem, nlp.layout, intervals, scales)
    x = np.clip(to_unknowns(guess, nlp.layout, fractions, scales), lower, upper)

    iterations = 0
    if stop:
        status = Status.INTERRUPTED if stop.interrupted else Status.TIME_LIMIT
        message = "stopped before fatrop started"
    else:
        result = program.solver(
            x0=_stages(x, nlp), p=parameters, lbx=_free(lower, nlp, -np.inf), ubx=_free(upper, nlp, np.inf),
            lbg=0, ubg=0,
        )  # fmt: skip
        stats: dict[str, Any] = program.solver.stats()
        iterations = min(int(stats["iter_count"]), options.max_iterations)  # it counts the one that it refuses, too
        code = stats["return_status"]
        status, message = _FATROP_STATUS.get(code, (Status.FAILED, f"fatrop returned {code}"))
        found = _knots_and_inner(np.array(result["x"]).ravel(), nlp)
        if np.all(np.isfinite(found)):
            x = found
        elif status is Status.SOLVED:
            status, message = Status.FAILED, "fatrop returned numbers that are not finite"
    g = np.array(program.defects(x, parameters)).ravel()
    return Attempt(
        status=status,
        message=message,
        trajectory=to_trajectory(x, nlp.layout, fractions, scales, problem.robot.joint_names),
        intervals=intervals,
        iterations=iterations,
        worst_violation=(
            None
            if status is Status.SOLVED
            else worst_violation(problem, nlp.layout, x, g.reshape(intervals, -1), fractions, scales)
        ),
    )


def _stages(x: Array, nlp: Nlp, ends: float | None = None) -> Array:
    """Unknowns of `transcription` in fatrop's order; `ends` stands for all e_k, else the next knots do."""
    knots, inner = split(x, nlp.layout, nlp.intervals)
    end = knots[1:, : 2 * nlp.layout.nv]
    copies = end if ends is None else np.full_like(end, ends)
    return np.concatenate([np.hstack([knots[:-1], inner, copies]).ravel(), knots[-1]])


def _free(side: Array, nlp: Nlp, infinite: float) -> Array:
    """Bounds in fatrop's order: what is equal to something bounded (e_k, T_k) needs none of its own."""
    knots, inner = split(side, nlp.layout, nlp.intervals)
    knots[1:, 2 * nlp.layout.nv] = infinite
    side = np.concatenate([np.hstack([knots[:-1], inner]).ravel(), knots[-1]])
    return _stages(side, nlp, infinite)


def _knots_and_inner(w: Array, nlp: Nlp) -> Array:
    """The unknowns of `transcription` among fatrop's."""
    own = nlp.layout.knot + nlp.layout.inner
    stages = w[: -nlp.layout.knot].reshape(nlp.intervals, -1)
    return np.concatenate([stages[:, :own].ravel(), w[-nlp.layout.knot :]])


@dataclass(frozen=True)
class _Program:
    """What solves, and the program it is measured against."""

    solver: ca.Function
    nlp: Nlp
    defects: ca.Function


@lru_cache(maxsize=16)
def _program(dynamics: Dynamics, scheme: Scheme, intervals: int, options: DirectOptions) -> _Program:
    staged = build_staged(dynamics, scheme, intervals)
    solver = ca.nlpsol(
        "minimum_time_staged",
        "fatrop",
        staged.functions,
        {
            "structure_detection": "manual",
            "N": staged.intervals,
            "nx": staged.states,
            "nu": staged.controls,
            "ng": staged.constraints,
            "cache": {"nlp_jac_g": staged.jacobian, "nlp_hess_l": staged.hessian},
            "calc_multipliers": False,
            "error_on_fail": False,
            "print_time": False,
            "show_eval_warnings": options.verbose,
            "fatrop": {
                "tolerance": options.tolerance,
                "max_iter": options.max_iterations,
                "print_level": 5 if options.verbose else 0,
            },
        },
    )
    nlp = build_nlp(dynamics, scheme, intervals)
    functions = nlp.functions
    return _Program(solver, nlp, ca.Function("defects", [functions["x"], functions["p"]], [functions["g"]]))
