"""A solution in words: sentences, checks, and facts as a table for the terminal, notebooks and titles."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from armdyn.optimal.answer.advice import advice
from armdyn.optimal.problem.checks import ROUNDING
from armdyn.optimal.problem.poses import endless
from armdyn.optimal.problem.status import Status
from armdyn.optimal.verify.certificate import ON_CURVE, Certificate
from armdyn.reprs import gap_words, joint_unit, joints_of, more_payload, percent, saving_words, short_time

if TYPE_CHECKING:
    from armdyn.optimal.answer.solution import Solution

MOST_LIMITS = 3
"""Largest number of limits that are named as deciding the time."""


def verdict(solution: Solution) -> str:
    """Verdict on a motion's optimality, in a few words."""
    if not solution.usable:
        return "reaches the goal, but cannot stay there" if solution.certified else "not usable"
    return solution.certificate.claims + (", without torques" if solution.problem.kinematic else "")


Check = tuple[str, bool | None, str]
"""Name of a check, whether it holds (None: unknown or not requested), and the numbers."""


def assessment(solution: Solution) -> str:
    """Whether the motion is executable, and how near it is to the fastest possible one, in full sentences."""
    certificate, problem = solution.certificate, solution.problem
    if solution.status in (Status.FOLLOWED, Status.STOPPED):
        return f"It keeps all limits and comes to rest, but not at the goal: {solution.message}."
    if not solution.moves:
        return f"No motion was found: {solution.message.removeprefix('no motion was found: ')}."
    if not solution.feasible:
        return f"The motion is not executable: {solution.message}."
    said = ["The motion is executable."]
    if problem.kinematic:
        why = "as requested" if problem.robot.has_dynamics else "the arm's inertias are unknown"
        said = [f"The motion keeps its limits of position, velocity, acceleration and jerk, without torques: {why}."]
    elif problem.holding_deficit is not None:
        said = [f"The motion reaches the goal, but the arm cannot stay there: {problem.holding_deficit.words}."]
    elif certificate.replay == "segments":
        said = ["The motion is executable under feedback; open loop it is unstable."]
    said += [f"The arm does not stay there by itself: {words}." for words in problem.unstable_ends]
    if solution.status is Status.TIME_LIMIT:
        said.append("The time limit ended the search: with more time a faster motion may be found, or this one proven.")
    if certificate.extremal and certificate.saving is not None:
        saved = percent(certificate.saving)
        what = "cost" if solution.problem.pays_effort else "time"
        said.append(f"It is locally optimal: to first order no change saves more than {saved} of its {what}.")
    elif certificate.extremal:
        said.append("Pontryagin's conditions hold along it: it is locally optimal, no small change makes it faster.")
    if solution.gap is not None and solution.gap_proven:
        said.append(f"It is {gap_words(solution.gap)}.")
    elif not solution.certified:
        said.append(f"It is not proven optimal: {'; '.join(certificate.reasons)}.")
    return " ".join(said)


def checks(solution: Solution) -> list[Check]:
    """The checks of a motion: replay, limits, path constraints, controller, Pontryagin's conditions, lower bound."""
    certificate = solution.certificate
    if not solution.moves:
        return []
    largest = certificate.limit_violation
    kept = "no limit is exceeded" + ("" if largest < ROUNDING else f" by more than {100 * largest:.2g} % of it")
    if not certificate.keeps_limits and certificate.exceeded is not None:
        kept = str(certificate.exceeded)
    preset = solution.problem.preset
    seen = None if preset is None else preset.check(solution.trajectory)
    speed = joint_unit(certificate.slides, "rad/s", "m/s")
    velocity = f"velocity within {certificate.goal_velocity_error:.1e} {speed}"
    return [
        ("lands", certificate.lands, f"{replay_words(certificate)}; {velocity}"),
        ("keeps its limits", certificate.keeps_limits, kept),
        *((one.name, not one.reasons, "; ".join(one.reasons) or one.said) for one in solution.constraint_reports),
        *([] if seen is None else [("controller", seen.ok, str(seen))]),
        ("extremal", *_extremal(solution)),
        ("lower bound", *_bound(solution)),
    ]


def _extremal(solution: Solution) -> tuple[bool | None, str]:
    """Pontryagin's conditions with their largest errors."""
    certificate = solution.certificate
    if certificate.saving is not None:
        what = "cost" if solution.problem.pays_effort else "time"
        return (
            certificate.extremal,
            f"to first order a change saves at most {percent(certificate.saving)} of the {what}",
        )
    if solution.phases is None:
        return None, ON_CURVE
    adjoint = certificate.adjoint_error
    return certificate.extremal, (
        f"|H| ≤ {certificate.hamiltonian_spread:.1e}, wrong signs ≤ {certificate.switching_violation:.1e}, "
        f"{len(solution.arcs)} arcs"
    ) + ("" if adjoint is None else f"; adjoint equations to {adjoint:.1e}")


def _bound(solution: Solution) -> tuple[bool | None, str]:
    """The lower bound, and the motion's excess over it."""
    if solution.gap is None:
        return None, "none was computed"
    above = f"{percent(max(solution.gap, 0.0))} above the lower bound of {solution.lower_bound:.6f} s"
    return solution.gap_proven, f"at most {above}" if solution.gap_proven else f"about {above}, not proven"


def standing(solution: Solution) -> dict[str, Any]:
    """Facts that `--require` compares; "missing": reasons why "certified", "extremal" or a "gap" is not reached."""
    certificate, reasons = solution.certificate, "; ".join(solution.certificate.reasons)
    lines = advice(solution)
    missing = {"certified": reasons} | {kind: lines.get(kind, reasons) for kind in ("extremal", "gap")}
    if solution.gap_proven and solution.gap is not None:
        missing["gap"] = f"the gap is {percent(solution.gap)}"
    return {
        "certified": solution.certified,
        "extremal": certificate.extremal,
        "gap": solution.gap,
        "gap_proven": solution.gap_proven,
        "missing": missing,
    }


def paragraph(solution: Solution) -> str:
    """A solution in words: duration, verdict, replay, limits that decide the time, statistics of the search."""
    robot = solution.problem.robot
    name, joints = " ".join(robot.name.split()), joints_of(robot.nv)
    said = [assessment(solution)]
    if solution.moves:
        said.insert(0, f"The fastest motion found for {name}, {joints}, takes {solution.duration:.6f} s.")
    else:
        said = [said[0].replace("was found:", f"was found for {name}, {joints}:", 1)]
    if solution.feasible and solution.moves:
        words = replay_words(solution.certificate)
        said.append(f"{words[0].upper()}{words[1:]}.")
    decided = decided_words(solution)
    said.append(f"Its time is decided by {decided}." if decided else "")
    if (calm := solution.calm) and solution.usable:
        part = percent(calm / (solution.duration - calm))
        said.append(f"{short_time(calm, 2)} of it ({part}) are given for calm joints: calm = 0 is the fastest.")
    if solution.lower_bound is not None and solution.moves:
        said.append(f"No motion is faster than {solution.lower_bound:.6f} s.")
    if solution.search_remark:
        said.append(f"{solution.search_remark[0].upper()}{solution.search_remark[1:]}.")
    elif solution.local_optima:
        others = len(solution.local_optima)
        said.append(f"{others} other optim{'a were' if others > 1 else 'um was'} met.")
    said.append(f"It was solved in {solution.solve_time:.1f} s, {solution.iterations} iterations.")
    said += [f"What you can do: {line}." for line in solution.what_to_do]
    return " ".join(filter(None, said))


def found_words(certificate: Certificate, duration: float) -> str:
    """Duration, replay and claims of a motion, and why it is not certified."""
    return "; ".join((f"{duration:.9g} s", replay_words(certificate), certificate.claims, *certificate.reasons))


def replay_words(certificate: Certificate) -> str:
    """Result of a motion's replay in words: open loop, or by segments and under feedback."""
    slides = certificate.slides
    within = f"ends within {certificate.goal_error:.1e} {joint_unit(slides)} of the goal"
    if certificate.replay == "curve":
        return f"{within}, torques by inverse dynamics; not replayed"
    if certificate.replay == "accelerations":
        return f"integrated from its accelerations, it {within}"
    growth = "" if certificate.growth is None else f"{certificate.growth:.2g}"
    if certificate.replay == "open loop":
        grown = f" (growth {growth})" if growth else ""
        apart = "" if certificate.repeats else f"; a segment ends {certificate.segment_error:.1e} from the next sample"
        return f"open-loop replay {within}{grown}{apart}"
    segments = f"every segment replayed to within {certificate.segment_error:.1e} {joint_unit(slides)}, and per second"
    unstable = f"open loop the motion is unstable (growth {growth})"
    if certificate.correction is None or certificate.correction_share is None:
        return f"{segments}; {unstable}, and a replay under feedback leaves it"
    return (
        f"{segments}; {unstable}, under feedback it {within} with "
        f"corrections of at most {certificate.correction:.1e} {joint_unit(slides, 'N m', 'N')} "
        f"({certificate.correction_share:.1e} of half the torque range)"
    )


def decided_words(solution: Solution, names: Mapping[str, str] = MappingProxyType({})) -> str:
    """Limits that decide the time, and the saving by more of the first alone and of all; empty if unknown.

    To first order, the shares are one subgradient of the time: more of one limit saves at most its share, and nothing
    where another joint ties with it, see `saving.with_saving`; more of all saves their sum.

    Args:
        solution: of a minimum-time problem.
        names: shorter names of joints.
    """
    shares = solution.decides
    if not shares or not solution.usable:
        return ""
    shown = ", ".join(
        f"{names.get(one.joint, one.joint)}'s {one.limit} {100 * one.part:.3g} %" for one in shares[:MOST_LIMITS]
    )
    first, together = shares[0], sum(one.part for one in shares)
    alone = saving_words(first.part, solution.duration, first.saved, first.ties)
    saved = f"1 % more of the first alone {alone}"
    if len(shares) > 1:
        saved += f", 1 % more of all limits {short_time(together * solution.duration / 100, 2)}"
    return f"{shown}{' …' if len(shares) > MOST_LIMITS else ''}; {saved}"


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
