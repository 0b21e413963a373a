"""A solution in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armdyn.optimal.proof.certificate import GAP_TOLERANCE, Certificate, percent

if TYPE_CHECKING:
    from armdyn.optimal.answer.solution import Solution

_MOST_LIMITS = 3
"""That are named as deciding the time."""


def verdict(solution: Solution) -> str:
    """What can be said for a motion's optimality, in a few words."""
    if not solution.usable:
        return "certified, but cannot stay at the goal" if solution.certified else "not usable"
    gap = solution.gap if solution.gap_proven else None
    if solution.certificate.extremal:
        return "certified"
    above = "" if gap is None else f"gap {percent(max(gap, 0.0))}"
    return ", ".join(filter(None, ("certified" if solution.certified else "not certified", above)))


def paragraph(solution: Solution) -> str:
    """A solution for who prints it: duration, verdict, what decides the time, the bound, how it was found."""
    said = [_found(solution), _checked(solution), _decided(solution), _bounded(solution)]
    if solution.met:
        said.append(f"{solution.met[0].upper()}{solution.met[1:]}.")
    elif solution.local_optima:
        others = len(solution.local_optima)
        said.append(f"{others} other optim{'a were' if others > 1 else 'um was'} met.")
    said.append(f"It was solved in {solution.solve_time:.1f} s, {solution.iterations} iterations.")
    said += [f"What you can do: {line}." for line in solution.what_to_do]
    return " ".join(filter(None, said))


def replay_words(certificate: Certificate) -> str:
    """What the replay of a motion has shown: open loop, or by segments and under feedback."""
    growth = "" if certificate.growth is None else f"{certificate.growth:.2g}"
    if certificate.replay == "open loop":
        grown = f" (growth {growth})" if growth else ""
        apart = "" if certificate.repeats else f"; a segment ends {certificate.segment_error:.1e} from the next sample"
        return f"open-loop replay ends within {certificate.goal_error:.1e} rad of the goal{grown}{apart}"
    segments = f"every segment replayed to within {certificate.segment_error:.1e} rad or rad/s"
    unstable = f"open loop the motion is unstable (growth {growth})"
    if certificate.correction is None or certificate.correction_share is None:
        return f"{segments}; {unstable}, and a replay under feedback leaves it"
    return (
        f"{segments}; {unstable}, under feedback it ends within {certificate.goal_error:.1e} rad of the goal with "
        f"corrections of at most {certificate.correction:.1e} N m "
        f"({certificate.correction_share:.1e} of half the torque range)"
    )


def _found(solution: Solution) -> str:
    robot = solution.problem.robot
    name, joints = " ".join(robot.name.split()), f"{robot.nv} joint{'s' if robot.nv > 1 else ''}"
    if not solution.moves:
        return f"No motion was found for {name}, {joints}: {solution.message}."
    return f"The fastest motion found for {name}, {joints}, takes {solution.duration:.6f} s."


def _checked(solution: Solution) -> str:
    certificate = solution.certificate
    if not solution.moves:
        return ""
    if not solution.usable:
        return f"It is not usable: {solution.message}."
    ends = replay_words(certificate)
    if solution.certified:
        why = (
            "Pontryagin's conditions hold along it"
            if certificate.extremal
            else f"a proven bound is within {percent(GAP_TOLERANCE)} of it"
        )
        return f"It is usable and certified: {ends}, and {why}."
    return f"It is usable, but not certified: {ends}; {'; '.join(certificate.reasons)}."


def _decided(solution: Solution) -> str:
    """What decides the time, and what a change is worth; empty where that is not known."""
    if not solution.decides or not solution.usable:
        return ""
    most = solution.decides[0]
    shares = ", ".join(f"{one.name} ({100 * one.part:.3g} %)" for one in solution.decides[:_MOST_LIMITS])
    saved = f"1 % more of the first would save {10 * most.part * solution.duration:.3g} ms"
    return f"Its time is decided by {shares}; {saved}."


def _bounded(solution: Solution) -> str:
    """The bound that no motion beats; empty without one."""
    if solution.gap is None or not solution.moves:
        return ""
    bound = f"No motion is faster than {solution.lower_bound:.6f} s"
    if not solution.gap_proven:
        return f"{bound}."
    return f"{bound}: this one is at most {percent(max(solution.gap, 0.0))} above that."
