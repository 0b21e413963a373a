"""A case solved or simulated."""

from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np

from armdyn.control.tracking.arrival import Arrival
from armdyn.control.tracking.pid import pid_summary
from armdyn.optimal import MinimumTimeOptions, Solution, solve_minimum_time
from armdyn.optimal.answer.solution import minimum_time_summary
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.verify.optimum import trajectory_cost
from armdyn.paper.continuous_pid import simulate
from armdyn.paper.indirect.solution import IndirectOptions, compare_with_direct
from armdyn.paper.indirect.solve_indirect import solve_indirect
from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.outcome import Fact, Outcome

SOLVE_LIMIT, INDIRECT_LIMIT = 120.0, 20.0
"""Wall time limits of a direct and of an indirect solve [s]: several times the slowest case's time."""
ALIKE = 2.0
"""Factor between payloads below which their optima are so alike that one leads to the other, and few further guesses
are enough."""


def run_case(
    case: Case,
    progress: Callable[[str], None] | None = None,
    workers: int | None = None,
    near: Outcome | None = None,
) -> Outcome:
    """Solve or simulate a case.

    Args:
        case: the problem or loop.
        progress: called with a line of text on the current step.
        workers: processes of the search for minimum time; None: one per core.
        near: of the same case with another payload: where the search begins. It has few other guesses if that is
            certified, and the payloads are `ALIKE`.

    Returns:
        An outcome. Its facts are, for every open-loop case, `certified`, `goal_error` [rad], `objective` J,
        `solve_time` [s]; for minimum time also `switch_times_jN` [s] of joint N, `local_optima` [s],
        `hamiltonian_spread`, `switching_violation`, `limit_violation`, `why_not_certified`; with the indirect
        method, for R and RR, `indirect_time_s`, None if it failed, `indirect_hamiltonian_spread`,
        `indirect_message`, and `indirect_X_difference` for the X of `optimal.Comparison`; for a PID loop
        `settled`, `max_real_eigenvalue` [1/s], `overshoot` [rad], `arrival_rule`, `goal_error` at the end
        [rad].
    """
    if case.kind == "pid":
        return _closed_loop(case)
    problem = case.problem()
    options = MinimumTimeOptions(time_limit=SOLVE_LIMIT, workers=workers)
    if near is not None and near.success and near.trajectory is not None:
        alike = 1 / ALIKE < near.case.payload / case.payload < ALIKE
        few = Policy.of(problem).search.neighbour_starts if near.facts["certified"] and alike else None
        options = replace(options, guesses=(near.trajectory,), starts=few)
    return _open_loop(case, solve_minimum_time(problem, options, progress))


def _open_loop(case: Case, solution: Solution) -> Outcome:
    certificate, motion = solution.certificate, replace(solution.trajectory, name=case.kind.replace("_", " "))
    facts: dict[str, Fact] = {
        "certified": solution.certified,
        "why_not_certified": "; ".join(certificate.reasons),
        "goal_error": _finite(certificate.goal_error),
        "goal_velocity_error": _finite(certificate.goal_velocity_error),
        "limit_violation": _finite(certificate.limit_violation),
        "hamiltonian_spread": _finite(certificate.hamiltonian_spread),
        "switching_violation": _finite(certificate.switching_violation),
        "objective": trajectory_cost(motion, solution.problem.effort_weight),
        "local_optima": list(solution.local_optima),
        "solve_time": solution.solve_time,
    }
    if solution.success and case.arm != "rrr":  # position limits, which RRR touches, are not the method's
        facts |= _indirect(case, solution)
    if case.kind == "minimum_time":
        facts |= {f"switch_times_j{i + 1}": list(times) for i, times in enumerate(motion.switch_times)}
    return Outcome(
        case=case,
        time=solution.duration if solution.success else None,
        trajectory=motion,
        success=solution.success,
        status=str(solution.status),
        message=solution.message,
        facts=facts,
        summary=minimum_time_summary(solution),
    )


def _indirect(case: Case, solution: Solution) -> dict[str, Fact]:
    """Solve a case by the paper's second approach, corrected: Pontryagin's conditions as equations."""
    options = IndirectOptions(bounded=case.kind == "minimum_time", time_limit=INDIRECT_LIMIT)
    found = solve_indirect(solution.problem, solution, options)
    facts: dict[str, Fact] = {
        "indirect_time_s": found.duration if found.success else None,
        "indirect_hamiltonian_spread": _finite(found.hamiltonian_spread),
        "indirect_message": found.message,
    }
    if found.success and solution.costates is not None:
        differences = asdict(compare_with_direct(found, solution.costates))
        facts |= {f"indirect_{name}_difference": value for name, value in differences.items()}
    return facts


def _closed_loop(case: Case) -> Outcome:
    run = simulate(case.loop(), case.q_start, Arrival(case.arrival_rule))
    return Outcome(
        case=case,
        time=run.arrival_time,
        trajectory=run.trajectory,
        success=run.arrival_time is not None,
        status=run.status,
        message=run.message,
        facts={
            "settled": run.settled,
            "max_real_eigenvalue": run.max_real_eigenvalue,
            "overshoot": [float(x) for x in run.overshoot],
            "arrival_rule": run.arrival_rule,
            "goal_error": float(np.max(np.abs(run.trajectory.q[-1] - np.array(case.q_goal)))),
        },
        summary=pid_summary(run),
    )


def _finite(number: float) -> float | None:
    return number if np.isfinite(number) else None
