"""What a solution is, in words."""

from __future__ import annotations

import re
from collections.abc import Sequence
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
    from armdyn.optimal.answer.words import verdict

    if solution.success:
        return f"minimum time {solution.duration:.4f} s, {verdict(solution)}"
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


def missing_words(missing: Sequence[str]) -> dict[str, str]:
    """What was required and is missing, for `facts_table`."""
    return {"required": "\n".join(map(options_of, missing))} if missing else {}


def options_of(line: str) -> str:
    """A line of advice with the command line's options instead of Python's arguments."""
    return re.sub(r"`([a-z_]+)`", lambda name: "--" + name.group(1).replace("_", "-"), line)


def _facts(solution: Solution) -> dict[str, str]:
    """A solution in words."""
    import numpy as np

    from armdyn.optimal.answer.words import replay_words

    certificate = solution.certificate
    facts = {"status": str(solution.status) if solution.success else solution.message}
    if solution.success:
        facts["duration"] = f"{solution.duration:.9f} s"
    if np.isfinite(certificate.goal_error):
        facts["replay"] = f"{replay_words(certificate)}; velocity within {certificate.goal_velocity_error:.1e} rad/s"
    facts |= _verdict_facts(solution) | _course(solution)
    if solution.local_optima:
        others = ", ".join(f"{x:.4f}" for x in solution.local_optima[:5])
        facts["other optima"] = f"{others}{' …' if len(solution.local_optima) > 5 else ''} s"
    if solution.decides:
        most = solution.decides[0]
        shares = ", ".join(f"{one.name} {100 * one.part:.3g} %" for one in solution.decides[:3])
        saved = f"1 % more of the first saves {10 * most.part * solution.duration:.3g} ms"
        facts["time decided by"] = f"{shares}{' …' if len(solution.decides) > 3 else ''}; {saved}"
    if (by := solution.sensitivities()) is not None:
        facts["payload"] = f"1 g more at the tip costs {by.payload_mass:.3g} ms"
    facts["solved in"] = f"{solution.solve_time:.1f} s, {solution.iterations} iterations"
    return facts


def _verdict_facts(solution: Solution) -> dict[str, str]:
    """What was checked, each apart, and what may help where something is missing."""
    from armdyn.optimal.proof.certificate import percent

    certificate = solution.certificate
    how = "yes" if certificate.replay == "open loop" else "yes, under feedback"
    facts = {"usable": f"{how}: it lands and keeps its limits" if solution.usable else "NO"}
    if solution.feasible and solution.problem.unheld is not None:
        facts["usable"] = f"NO: the arm cannot stay at the goal: {solution.problem.unheld.words}"
    if solution.feasible:
        facts["certified"] = "yes" if solution.certified else "; ".join(("no", *certificate.reasons))
    if solution.arcs:
        adjoint = certificate.adjoint_error
        facts["extremal"] = (
            f"{'yes' if certificate.extremal else 'no'}: |H| ≤ {certificate.hamiltonian_spread:.1e}, wrong signs ≤ "
            f"{certificate.switching_violation:.1e}, {len(solution.arcs)} arcs"
        ) + ("" if adjoint is None else f"; adjoint equations to {adjoint:.1e}")
    if certificate.idle:
        facts["idle"] = ", ".join(certificate.idle) + ": time does not determine how they move"
    if solution.gap is not None:
        said = "at most" if solution.gap_proven else "about"
        proven = "proven" if solution.gap_proven else "not proven for this motion"
        facts["gap"] = (
            f"{said} {percent(max(solution.gap, 0.0))} above the lower bound of {solution.lower_bound:.6f} s ({proven})"
        )
    if solution.what_to_do:
        facts["what you can do"] = "\n".join(map(options_of, solution.what_to_do))
    return facts


def _course(solution: Solution) -> dict[str, str]:
    """What was asked along the way, and of the goal, and how that is kept."""
    facts = {}
    if solution.clearance is not None:
        proof = "nothing is missed between looks" if solution.clearance.sure else "looked at 10,000 times at most"
        facts["nearest"] = f"{solution.clearance} ({proof})"
    facts |= {kept.name: kept.said for kept in solution.constraint_reports if kept.share is not None}
    if solution.via_times:
        facts["via points"] = "at " + ", ".join(f"{t:.4f}" for t in solution.via_times) + " s"
    if solution.goals:
        facts["goals tried"] = (
            ", ".join(f"{goal.duration:.4f}{'' if goal.refined else ' (coarse)'}" for goal in solution.goals[:8]) + " s"
        )
        facts["goal"] = ", ".join(f"{x:.4f}" for x in solution.problem.x_goal[: solution.problem.robot.nv]) + " rad"
    return facts
