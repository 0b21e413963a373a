"""A solution in words: sentences, checks, and facts as a table for the terminal, notebooks and titles."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from armdyn.optimal.answer.advice import advice, what_to_do
from armdyn.optimal.answer.result import Result
from armdyn.optimal.problem.checks import ROUNDING
from armdyn.optimal.problem.poses import endless
from armdyn.optimal.problem.status import Status
from armdyn.optimal.verify.certificate import ON_CURVE, Certificate
from armdyn.reprs import gap_words, joint_unit, joints_of, more_payload, percent, saving_words, short_time

MOST_LIMITS = 3
"""Largest number of limits that are named as deciding the time."""


def verdict(result: Result) -> str:
    """Verdict on a motion's optimality, in a few words."""
    if not result.usable:
        return "reaches the goal, but cannot stay there" if result.certified else "not usable"
    return result.certificate.claims + (", without torques" if result.problem.kinematic else "")


Check = tuple[str, bool | None, str]
"""Name of a check, whether it holds (None: unknown or not requested), and the numbers."""


def assessment(result: Result) -> str:
    """Whether the motion is executable, and how near it is to the fastest possible one, in full sentences."""
    certificate, problem = result.certificate, result.problem
    if result.status in (Status.FOLLOWED, Status.STOPPED):
        return f"It keeps all limits and comes to rest, but not at the goal: {result.message}."
    if not result.moves:
        return f"No motion was found: {result.message.removeprefix('no motion was found: ')}."
    if not result.feasible:
        return f"The motion is not executable: {result.message}."
    said = ["The motion is executable."]
    if problem.kinematic:
        why = "as requested" if problem.robot.has_dynamics else "the arm's inertias are unknown"
        said = [f"The motion keeps its limits of position, velocity, acceleration and jerk, without torques: {why}."]
    elif problem.holding_deficit is not None:
        said = [f"The motion reaches the goal, but the arm cannot stay there: {problem.holding_deficit.words}."]
    elif certificate.replay == "segments":
        said = ["The motion is executable under feedback; open loop it is unstable."]
    said += [f"The arm does not stay there by itself: {words}." for words in problem.unstable_ends]
    if result.status is Status.TIME_LIMIT:
        said.append("The time limit ended the search: with more time a faster motion may be found, or this one proven.")
    if certificate.extremal and certificate.saving is not None:
        saved = percent(certificate.saving)
        what = "cost" if result.problem.pays_effort else "time"
        said.append(f"It is locally optimal: to first order no change saves more than {saved} of its {what}.")
    elif certificate.extremal:
        said.append("Pontryagin's conditions hold along it: it is locally optimal, no small change makes it faster.")
    if result.gap is not None and result.gap_proven:
        said.append(f"It is {gap_words(result.gap)}.")
    elif not result.certified:
        said.append(f"It is not proven optimal: {'; '.join(certificate.reasons)}.")
    return " ".join(said)


def checks(result: Result) -> list[Check]:
    """The checks of a motion: replay, limits, path constraints, controller, Pontryagin's conditions, lower bound."""
    certificate = result.certificate
    if not result.moves:
        return []
    largest = certificate.limit_violation
    kept = "no limit is exceeded" + ("" if largest < ROUNDING else f" by more than {100 * largest:.2g} % of it")
    if not certificate.keeps_limits and certificate.exceeded is not None:
        kept = str(certificate.exceeded)
    preset = result.problem.preset
    seen = None if preset is None else preset.check(result.trajectory)
    speed = joint_unit(certificate.slides, "rad/s", "m/s")
    velocity = f"velocity within {certificate.goal_velocity_error:.1e} {speed}"
    return [
        ("lands", certificate.lands, f"{replay_words(certificate)}; {velocity}"),
        ("keeps its limits", certificate.keeps_limits, kept),
        *((one.name, not one.reasons, "; ".join(one.reasons) or one.said) for one in result.constraint_reports),
        *([] if seen is None else [("controller", seen.ok, str(seen))]),
        ("extremal", *_extremal(result)),
        ("lower bound", *_bound(result)),
    ]


def _extremal(result: Result) -> tuple[bool | None, str]:
    """Pontryagin's conditions with their largest errors."""
    certificate = result.certificate
    if certificate.saving is not None:
        what = "cost" if result.problem.pays_effort else "time"
        return (
            certificate.extremal,
            f"to first order a change saves at most {percent(certificate.saving)} of the {what}",
        )
    if result.phases is None:
        return None, ON_CURVE
    adjoint = certificate.adjoint_error
    return certificate.extremal, (
        f"|H| ≤ {certificate.hamiltonian_spread:.1e}, wrong signs ≤ {certificate.switching_violation:.1e}, "
        f"{len(result.arcs)} arcs"
    ) + ("" if adjoint is None else f"; adjoint equations to {adjoint:.1e}")


def _bound(result: Result) -> tuple[bool | None, str]:
    """The lower bound, and the motion's excess over it."""
    if result.gap is None:
        return None, "none was computed"
    above = f"{percent(max(result.gap, 0.0))} above the lower bound of {result.lower_bound:.6f} s"
    return result.gap_proven, f"at most {above}" if result.gap_proven else f"about {above}, not proven"


def standing(result: Result) -> dict[str, Any]:
    """Facts that `--require` compares; "missing": reasons why "certified", "extremal" or a "gap" is not reached."""
    certificate, reasons = result.certificate, "; ".join(result.certificate.reasons)
    lines = advice(result)
    missing = {"certified": reasons} | {kind: lines.get(kind, reasons) for kind in ("extremal", "gap")}
    if result.gap_proven and result.gap is not None:
        missing["gap"] = f"the gap is {percent(result.gap)}"
    return {
        "certified": result.certified,
        "extremal": certificate.extremal,
        "gap": result.gap,
        "gap_proven": result.gap_proven,
        "missing": missing,
    }


def paragraph(result: Result) -> str:
    """A solution in words: duration, verdict, replay, limits that decide the time, statistics of the search."""
    robot = result.problem.robot
    name, joints = " ".join(robot.name.split()), joints_of(robot.nv)
    said = [assessment(result)]
    if result.moves:
        said.insert(0, f"The fastest motion found for {name}, {joints}, takes {result.duration:.6f} s.")
    else:
        said = [said[0].replace("was found:", f"was found for {name}, {joints}:", 1)]
    if result.feasible and result.moves:
        words = replay_words(result.certificate)
        said.append(f"{words[0].upper()}{words[1:]}.")
    decided = decided_words(result)
    said.append(f"Its time is decided by {decided}." if decided else "")
    if (calm := result.calm) and result.usable:
        part = percent(calm / (result.duration - calm))
        said.append(f"{short_time(calm, 2)} of it ({part}) are given for calm joints: calm = 0 is the fastest.")
    if result.lower_bound is not None and result.moves:
        said.append(f"No motion is faster than {result.lower_bound:.6f} s.")
    if result.search_remark:
        said.append(f"{result.search_remark[0].upper()}{result.search_remark[1:]}.")
    elif result.local_optima:
        others = len(result.local_optima)
        said.append(f"{others} other optim{'a were' if others > 1 else 'um was'} met.")
    said.append(f"It was solved in {result.solve_time:.1f} s, {result.iterations} iterations.")
    said += [f"What you can do: {line}." for line in what_to_do(result)]
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


def decided_words(result: Result, names: Mapping[str, str] = MappingProxyType({})) -> str:
    """Limits that decide the time, and the saving by more of the first alone and of all; empty if unknown.

    To first order, the shares are one subgradient of the time: more of one limit saves at most its share, and nothing
    where another joint ties with it, see `saving.with_saving`; more of all saves their sum.

    Args:
        result: of a minimum-time problem.
        names: shorter names of joints.
    """
    shares = result.decides
    if not shares or not result.usable:
        return ""
    shown = ", ".join(
        f"{names.get(one.joint, one.joint)}'s {one.limit} {100 * one.part:.3g} %" for one in shares[:MOST_LIMITS]
    )
    first, together = shares[0], sum(one.part for one in shares)
    alone = saving_words(first.part, result.duration, first.saved, first.ties)
    saved = f"1 % more of the first alone {alone}"
    if len(shares) > 1:
        saved += f", 1 % more of all limits {short_time(together * result.duration / 100, 2)}"
    return f"{shown}{' …' if len(shares) > MOST_LIMITS else ''}; {saved}"


def solution_title(result: Result) -> str:
    """Title of a figure or a page of a solution: the arm, its payload, the duration and the verdict."""
    arm = result.problem.robot
    carried = f", {1000 * arm.payload.mass:g} g" if arm.payload is not None and arm.payload.mass else ""
    return f"{arm.name}{carried}: {title_words(result)}"


def title_words(result: Result) -> str:
    """Duration and verdict of a solution in a few words."""
    if result.success:
        found = "best so far" if result.status is Status.TIME_LIMIT else "minimum time"
        return f"{found} {result.duration:.4f} s, {verdict(result)}"
    status = str(result.status).replace("_", " ")
    return f"{status}, best so far {result.duration:.4f} s" if result.moves else f"{status}, no motion to the goal"


def _turns(result: Result) -> dict[str, str]:
    """Turns of endless joints, where another way round was open or was taken."""
    problem, wrap = result.problem, result.problem.wrap
    away = (problem.x_goal - problem.x_start)[: problem.robot.nv]
    far = np.flatnonzero(endless(problem.robot, problem.limits) & ((np.abs(away) > np.pi) | wrap))
    said = ", ".join(f"{problem.robot.joint_names[i]} turns {away[i]:.4g} rad" for i in far)
    hint = "" if wrap else ", as its goal says; with `wrap` it may go the other way round"
    return {"way round": said + hint} if said else {}


def solution_words(result: Result) -> dict[str, str]:
    """A solution of a minimum-time problem in words, by the names of its facts; arguments in Python in backticks."""
    has_status = result.success or not (result.moves and result.feasible)  # then the verdict has the message
    facts = {"status": str(result.status).replace("_", " ") if has_status else result.message}
    if result.success:
        facts["duration"] = f"{result.duration:.9f} s"
    facts["verdict"] = assessment(result)
    words = {True: "yes: ", False: "no: ", None: ""}
    facts |= {name: f"{words[holds]}{said}" for name, holds, said in checks(result)}
    if result.certificate.idle and result.moves:
        facts["idle"] = "no part of the time is decided by " + ", ".join(result.certificate.idle)
    if todo := what_to_do(result):
        facts["what you can do"] = "\n".join(todo)
    if result.clearance is not None and not result.moves:  # else the checks have it
        facts["nearest"] = str(result.clearance)
    if result.via_times:
        facts["via points"] = "at " + ", ".join(f"{t:.4f}" for t in result.via_times) + " s"
    if result.goals:
        facts["goals tried"] = (
            ", ".join(f"{goal.duration:.4f}{'' if goal.refined else ' (coarse)'}" for goal in result.goals[:8]) + " s"
        )
        robot = result.problem.robot
        goal = ", ".join(f"{x:z.4f}" for x in result.problem.x_goal[: robot.nv])
        facts["goal"] = f"{goal} {joint_unit(robot.slides)}"
    if result.local_optima:
        others = ", ".join(f"{x:.4f}" for x in result.local_optima[:5])
        facts["other optima"] = f"{others}{' …' if len(result.local_optima) > 5 else ''} s"
    if decided := decided_words(result):
        facts["time decided by"] = decided
    if result.calm and result.moves:
        facts["calm joints"] = f"take {short_time(result.calm, 2)} of it; `calm` 0 is the fastest"
    if (by := result.sensitivities()) is not None:
        more, cost = more_payload(by.payload_mass, result.duration)
        facts["payload"] = f"{more} costs {cost:.3g} ms"
    facts["solved in"] = f"{result.solve_time:.1f} s, {result.iterations} iterations"
    return facts | _turns(result)
