"""Minimum time by direct collocation and IPOPT."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.errors import ProblemError
from armdyn.optimal.mesh import Scales, bounds, to_trajectory, to_unknowns, worst_violation
from armdyn.optimal.monitor import Monitor, Stop, stopping
from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.optimal.rollout import replay_torques
from armdyn.optimal.solution import Solution, Status, Violation
from armdyn.optimal.starts import starts
from armdyn.optimal.transcription import Control, DynamicsForm, Nlp, Scheme, build_nlp
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_IPOPT_STATUS = {
    "Solve_Succeeded": Status.SOLVED,
    "Solved_To_Acceptable_Level": Status.SOLVED,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Restoration_Failed": Status.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Status.ITERATION_LIMIT,
    "Maximum_CpuTime_Exceeded": Status.TIME_LIMIT,
    "Maximum_WallTime_Exceeded": Status.TIME_LIMIT,
    "User_Requested_Stop": Status.INTERRUPTED,
}


@dataclass(frozen=True, kw_only=True)
class MinimumTimeOptions:
    """How `solve_minimum_time` goes about it.

    Attributes:
        intervals: of the first mesh.
        max_intervals: of the finest mesh that is tried when the replay misses the goal.
        replay_tolerance: largest goal error of the replay [rad or m] that counts as landed.
        method: collocation tableau; "lobatto3" is Hermite-Simpson.
        control: torque "linear" or "constant" between knots; constant converges in fewer iterations.
        dynamics: "forward", "inverse", or "auto": forward up to three joints, inverse beyond, where
            the derivatives of the articulated-body algorithm cost more than the extra unknowns.
        max_starts: guesses that are tried before giving up.
        max_iterations: of IPOPT, for one guess on one mesh.
        tolerance: of IPOPT, on the scaled problem.
        time_limit: wall time for the whole solve [s].
        seed: of the guesses after the first.
        verbose: let IPOPT print.
    """

    intervals: int = 50
    max_intervals: int = 800
    replay_tolerance: float = 1e-3
    method: str = "lobatto3"
    control: Control = "constant"
    dynamics: DynamicsForm | Literal["auto"] = "auto"
    max_starts: int = 5
    max_iterations: int = 500
    tolerance: float = 1e-8
    time_limit: float = 300.0
    seed: int = 0
    verbose: bool = False

    def __post_init__(self) -> None:
        for name in ("intervals", "max_intervals", "max_starts", "max_iterations"):
            if getattr(self, name) < 1:
                raise ProblemError(f"{name} is {getattr(self, name)}; it must be at least 1")
        for name in ("replay_tolerance", "tolerance", "time_limit"):
            if not getattr(self, name) > 0:
                raise ProblemError(f"{name} is {getattr(self, name)}; it must be positive")


@dataclass(frozen=True)
class Attempt:
    """What IPOPT made of one guess on one mesh."""

    status: Status
    message: str
    trajectory: Trajectory
    iterations: int
    worst_violation: Violation | None


def solve_minimum_time(
    problem: MinimumTimeProblem,
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> Solution:
    """The fastest motion that collocation finds from a guess.

    Solves on a mesh, replays the torques through `pin.aba` with another integrator, and halves the
    intervals until the replay lands on the goal. A guess from which IPOPT does not converge gives
    way to the next.

    Args:
        problem: what is to be solved.
        options: defaults suit arms of one to seven joints.
        progress: told in words what is being tried.

    Returns:
        A `Solution`; look at `success`. Ctrl-C returns the best so far, with status "interrupted".
    """
    options = options or MinimumTimeOptions()
    started = time.perf_counter()
    dynamics = Dynamics(problem.robot)
    form: DynamicsForm = "forward" if problem.robot.nv <= 3 else "inverse"
    scheme = Scheme(options.method, options.control, form if options.dynamics == "auto" else options.dynamics)

    iterations = 0
    best: Solution | None = None
    with stopping(options.time_limit) as stop:
        for start, guess in zip(range(options.max_starts), starts(problem, options.seed), strict=False):
            mesh, refine = options.intervals, True
            while refine:
                if progress:
                    progress(f"start {start + 1} of at most {options.max_starts}, {mesh} intervals")
                attempt = solve_on_mesh(problem, guess, dynamics, scheme, mesh, options, stop)
                iterations += attempt.iterations
                solution = _judge(problem, attempt, options, mesh, iterations, time.perf_counter() - started)
                if best is None or _rank(solution) <= _rank(best):
                    best = solution
                refine = solution.status is Status.REPLAY_MISSED and 2 * mesh <= options.max_intervals and not stop
                mesh, guess = 2 * mesh, attempt.trajectory
            if attempt.status is Status.SOLVED or stop:
                break
    if best is None:
        raise AssertionError("there is always a first start")
    return best


def solve_on_mesh(
    problem: MinimumTimeProblem,
    guess: Trajectory,
    dynamics: Dynamics,
    scheme: Scheme,
    intervals: int,
    options: MinimumTimeOptions,
    stop: Stop,
) -> Attempt:
    """One call of IPOPT.

    Args:
        problem: what is to be solved.
        guess: where it starts.
        dynamics: of the problem's robot.
        scheme: the transcription.
        intervals: of the mesh, all of one length.
        options: iteration limit, tolerance, verbosity.
        stop: asked at every iteration.
    """
    nlp, solver, monitor = _solver(_SolverKey(dynamics, scheme, intervals, options))
    scales = Scales.of(problem, guess)
    fractions = np.full(intervals, 1 / intervals)
    parameters = np.concatenate([fractions, scales.parameters(problem.effort_weight)])
    lower, upper = bounds(problem, nlp, scales)
    x = np.clip(to_unknowns(guess, nlp.layout, fractions, scales), lower, upper)
    monitor.stop = stop
    result = solver(x0=x, p=parameters, lbx=lower, ubx=upper, lbg=0, ubg=0)
    stats: dict[str, Any] = solver.stats()
    word = str(stats["return_status"])
    status = _IPOPT_STATUS.get(word, Status.FAILED)
    if status is Status.INTERRUPTED and not stop.interrupted:
        status, word = Status.TIME_LIMIT, "time limit reached"
    found = np.array(result["x"]).ravel()
    x = found if np.all(np.isfinite(found)) else x
    g = np.array(solver.get_function("nlp_g")(x, parameters)).ravel()
    landed = status is Status.SOLVED
    return Attempt(
        status=status,
        message=word.replace("_", " "),
        trajectory=to_trajectory(x, nlp.layout, fractions, scales, problem.robot.joint_names),
        iterations=int(stats["iter_count"]),
        worst_violation=None if landed else worst_violation(problem, nlp, x, g, fractions, scales),
    )


def _judge(
    problem: MinimumTimeProblem,
    attempt: Attempt,
    options: MinimumTimeOptions,
    mesh: int,
    iterations: int,
    solve_time: float,
) -> Solution:
    """Replays what came out of a solve, and says in words what it is worth."""
    trajectory, status = attempt.trajectory, attempt.status
    position_error = velocity_error = float("inf")
    if status is Status.SOLVED:
        replay = replay_torques(problem.robot, trajectory)
        if replay.t[-1] == trajectory.t[-1]:
            position_error = float(np.max(np.abs(replay.q[-1] - problem.q_goal)))
            velocity_error = float(np.max(np.abs(replay.v[-1] - problem.v_goal)))
        if position_error > options.replay_tolerance:
            status = Status.REPLAY_MISSED
    joints = f"{mesh} intervals"
    if status is Status.SOLVED:
        message = f"{trajectory.duration:.6g} s; replayed to within {position_error:.2g} rad of the goal ({joints})"
    elif status is Status.REPLAY_MISSED:
        message = (
            f"collocation found {trajectory.duration:.6g} s, but its torques end {position_error:.2g} rad from the "
            f"goal when replayed (tolerance {options.replay_tolerance:g} rad, {joints}): raise max_intervals"
        )
    else:
        message = f"{attempt.message} ({joints}); worst: {attempt.worst_violation}"
    return Solution(
        success=status is Status.SOLVED,
        status=status,
        message=message,
        problem=problem,
        duration=trajectory.duration,
        trajectory=trajectory,
        replay_error=position_error,
        replay_velocity_error=velocity_error,
        intervals=mesh,
        iterations=iterations,
        solve_time=solve_time,
        worst_violation=attempt.worst_violation,
    )


def _rank(solution: Solution) -> tuple[int, float]:
    """Smaller is better: landed, then converged, then the least violated."""
    if solution.success or solution.status is Status.REPLAY_MISSED:
        return (not solution.success), solution.replay_error
    return 2, solution.worst_violation.value if solution.worst_violation else float("inf")


class _SolverKey:
    """Lets the cache know a solver by what it is made of."""

    def __init__(self, dynamics: Dynamics, scheme: Scheme, intervals: int, options: MinimumTimeOptions):
        self.dynamics, self.scheme, self.intervals, self.options = dynamics, scheme, intervals, options
        self.identity = (
            dynamics.digest(), scheme, intervals, options.tolerance, options.max_iterations, options.verbose
        )  # fmt: skip

    def __hash__(self) -> int:
        return hash(self.identity)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _SolverKey) and self.identity == other.identity


@lru_cache(maxsize=16)
def _solver(key: _SolverKey) -> tuple[Nlp, ca.Function, Monitor]:
    nlp, options = build_nlp(key.dynamics, key.scheme, key.intervals), key.options
    nx, ng, parameters = (nlp.functions[name].numel() for name in ("x", "g", "p"))
    monitor = Monitor(nx, ng, parameters)
    solver = ca.nlpsol(
        "minimum_time",
        "ipopt",
        nlp.functions,
        {
            "jac_g": nlp.jacobian,
            "hess_lag": nlp.hessian,
            "iteration_callback": monitor,
            "calc_multipliers": False,
            "error_on_fail": False,
            "print_time": False,
            "show_eval_warnings": options.verbose,
            "ipopt": {
                "tol": options.tolerance,
                "max_iter": options.max_iterations,
                "nlp_scaling_method": "none",  # the unknowns and equations are scaled already
                "fixed_variable_treatment": "make_parameter",
                "print_level": 5 if options.verbose else 0,
                "sb": "yes",
            },
        },
    )
    return nlp, solver, monitor
