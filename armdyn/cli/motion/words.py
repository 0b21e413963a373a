"""What a solution is, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armdyn.optimal import Solution


def solution_words(solution: Solution, wrap: bool) -> dict[str, str]:
    """A solution as `facts_table` shows it.

    Args:
        solution: of a minimum-time problem.
        wrap: goals of endless joints were meant modulo 2π.
    """
    return _facts(solution) | _turns(solution, wrap)


def title_words(solution: Solution) -> str:
    """A solution as a figure's title shows it."""
    if solution.success:
        return f"minimum time {solution.duration:.4f} s"
    said = str(solution.status).replace("_", " ")
    return f"{said}, best so far {solution.duration:.4f} s" if solution.moves else f"{said}, no motion to the goal"


def _turns(solution: Solution, wrap: bool) -> dict[str, str]:
    """How far endless joints turn, where another way round was open or was taken."""
    import numpy as np

    from armdyn.optimal.problem.turns import endless

    problem = solution.problem
    away = (problem.x_goal - problem.x_start)[: problem.robot.nv]
    far = [
        f"{name} turns {angle:.4g} rad"
        for name, angle, turns in zip(
            problem.robot.joint_names, away, endless(problem.robot, problem.limits), strict=True
        )
        if turns and (wrap or abs(angle) > np.pi)
    ]
    hint = "" if wrap else ", as it was asked to; with --wrap it may go the other way round"
    return {"way round": ", ".join(far) + hint} if far else {}


def _facts(solution: Solution) -> dict[str, str]:
    """A solution in words."""
    import numpy as np

    certificate, by = solution.certificate, solution.sensitivities()
    facts = {"status": str(solution.status) if solution.success else solution.message}
    if solution.success:
        facts["duration"] = f"{solution.duration:.9f} s"
    if np.isfinite(certificate.goal_error):
        facts["replay"] = (
            f"{certificate.goal_error:.1e} rad and {certificate.goal_velocity_error:.1e} rad/s beside the goal"
        )
    facts["certificate"] = "yes" if certificate.ok else "NO: " + "; ".join(certificate.reasons)
    if solution.clearance is not None:
        proof = "nothing is missed between looks" if solution.clearance.sure else "looked at 10,000 times at most"
        facts["nearest"] = f"{solution.clearance} ({proof})"
    facts |= {kept.name: kept.said for kept in solution.kept if kept.share is not None}
    if solution.via_times:
        facts["via points"] = "at " + ", ".join(f"{t:.4f}" for t in solution.via_times) + " s"
    if solution.goals:
        facts["goals tried"] = (
            ", ".join(f"{goal.duration:.4f}{'' if goal.refined else ' (coarse)'}" for goal in solution.goals[:8]) + " s"
        )
        facts["goal"] = ", ".join(f"{x:.4f}" for x in solution.problem.x_goal[: solution.problem.robot.nv]) + " rad"
    if solution.arcs:
        facts["Pontryagin"] = (
            f"|H| ≤ {certificate.hamiltonian_spread:.1e}, wrong signs ≤ {certificate.switching_violation:.1e}, "
            f"{len(solution.arcs)} arcs"
        )
    if solution.local_optima:
        others = ", ".join(f"{x:.4f}" for x in solution.local_optima[:5])
        facts["other optima"] = f"{others}{' …' if len(solution.local_optima) > 5 else ''} s"
    if by is not None:
        most, saved = by.limited_most_by(solution.problem)
        facts["limited most by"] = f"{most}: 1 % more saves {1e3 * saved:.3g} ms"
        facts["payload"] = f"1 g more at the tip costs {by.payload_mass:.3g} ms"
    facts["solved in"] = f"{solution.solve_time:.1f} s, {solution.iterations} iterations"
    return facts
