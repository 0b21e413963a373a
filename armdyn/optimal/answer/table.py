"""A solution as a table of facts in words, for the terminal and notebooks, and as the title of a figure."""

from __future__ import annotations

import numpy as np

from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.answer.words import assessment, checks, decided_words, verdict
from armdyn.optimal.problem.poses import endless
from armdyn.optimal.problem.status import Status
from armdyn.reprs import joint_unit, more_payload, short_time


def solution_title(solution: Solution) -> str:
    """Title of a figure or a page of a solution: the arm, its payload, the duration and the verdict."""
    arm = solution.problem.robot
    carried = f", {1000 * arm.payload.mass:g} g" if arm.payload is not None and arm.payload.mass else ""
    return f"{arm.name}{carried}: {title_words(solution)}"


def title_words(solution: Solution) -> str:
    """Duration and verdict of a solution in a few words."""
    if solution.success:
        found = "best so far" if solution.status is Status.TIME_LIMIT else "minimum time"
        return f"{found} {solution.duration:.4f} s, {verdict(solution)}"
    status = str(solution.status).replace("_", " ")
    return f"{status}, best so far {solution.duration:.4f} s" if solution.moves else f"{status}, no motion to the goal"


def _turns(solution: Solution) -> dict[str, str]:
    """Turns of endless joints, where another way round was open or was taken."""
    problem, wrap = solution.problem, solution.problem.wrap
    away = (problem.x_goal - problem.x_start)[: problem.robot.nv]
    far = [
        f"{name} turns {angle:.4g} rad"
        for name, angle, turns in zip(
            problem.robot.joint_names, away, endless(problem.robot, problem.limits), strict=True
        )
        if turns and (wrap or abs(angle) > np.pi)
    ]
    hint = "" if wrap else ", as its goal says; with `wrap` it may go the other way round"
    return {"way round": ", ".join(far) + hint} if far else {}


def solution_words(solution: Solution) -> dict[str, str]:
    """A solution of a minimum-time problem in words, by the names of its facts; arguments in Python in backticks."""
    has_status = solution.success or not (solution.moves and solution.feasible)  # then the verdict has the message
    facts = {"status": str(solution.status).replace("_", " ") if has_status else solution.message}
    if solution.success:
        facts["duration"] = f"{solution.duration:.9f} s"
    facts["verdict"] = assessment(solution)
    words = {True: "yes: ", False: "no: ", None: ""}
    facts |= {name: f"{words[holds]}{said}" for name, holds, said in checks(solution)}
    if solution.certificate.idle and solution.moves:
        facts["idle"] = "no part of the time is decided by " + ", ".join(solution.certificate.idle)
    if solution.what_to_do:
        facts["what you can do"] = "\n".join(solution.what_to_do)
    facts |= _path_words(solution)
    if solution.local_optima:
        others = ", ".join(f"{x:.4f}" for x in solution.local_optima[:5])
        facts["other optima"] = f"{others}{' …' if len(solution.local_optima) > 5 else ''} s"
    if decided := decided_words(solution):
        facts["time decided by"] = decided
    if solution.calm and solution.moves:
        facts["calm joints"] = f"take {short_time(solution.calm, 2)} of it; `calm` 0 is the fastest"
    if (by := solution.sensitivities()) is not None:
        more, cost = more_payload(by.payload_mass, solution.duration)
        facts["payload"] = f"{more} costs {cost:.3g} ms"
    facts["solved in"] = f"{solution.solve_time:.1f} s, {solution.iterations} iterations"
    return facts | _turns(solution)


def _path_words(solution: Solution) -> dict[str, str]:
    """The nearest obstacle, the via points and the goals."""
    facts = {}
    if solution.clearance is not None and not solution.moves:  # else the checks have it
        facts["nearest"] = str(solution.clearance)
    if solution.via_times:
        facts["via points"] = "at " + ", ".join(f"{t:.4f}" for t in solution.via_times) + " s"
    if solution.goals:
        facts["goals tried"] = (
            ", ".join(f"{goal.duration:.4f}{'' if goal.refined else ' (coarse)'}" for goal in solution.goals[:8]) + " s"
        )
        robot = solution.problem.robot
        goal = ", ".join(f"{x:z.4f}" for x in solution.problem.x_goal[: robot.nv])
        facts["goal"] = f"{goal} {joint_unit(robot.slides)}"
    return facts
