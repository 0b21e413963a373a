"""The command `armdyn optimality`: compares any planner's motion with the fastest."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite
from pathlib import Path

import armdyn as ad
from armdyn.cli.console import Answer, cut_short, facts_table, judged, working
from armdyn.cli.motion.mintime import SolverOptions
from armdyn.cli.options.groups import argument
from armdyn.cli.options.joints import FastJointOptions, friction_facts, friction_words, reserve_words
from armdyn.cli.options.path_constraints import RateOptions
from armdyn.cli.options.results import ResultOptions
from armdyn.cli.options.robot import PayloadOptions, RobotArgument
from armdyn.errors import ProblemError
from armdyn.files import attributes
from armdyn.reprs import joint_unit, short_time

MOTIONS = ("trajectory", "optimum")


def optimality(
    *,
    robot: RobotArgument,
    file: Path = argument(
        "FILE",
        "The motion: a table with a first line such as t,q1,q2,v1,v2 (.csv), arrays t, q and perhaps v, a, tau (.npz, "
        "toppra's names, too), ROS 2's JointTrajectory (.json, .yaml), or a trajectory.npz of armdyn.",
    ),
    payload: PayloadOptions,
    joints: FastJointOptions,
    rates: RateOptions,
    search: SolverOptions,
    results: ResultOptions,
) -> Answer:
    """Compare a planner's motion with the fastest between the same two states.

    Reports whether the motion keeps torque, velocity and position limits, how long each joint is on none of them, and
    the duration of the fastest motion. Missing torques come from inverse dynamics, velocities from a
    cubic spline, accelerations from differences. Joints of a ROS 2 message come in any order. Obstacles and a path that
    was to be kept are ignored: the fastest motion is free to go another way. --reserve is the planner's reserve for
    feedback; --acceleration-limit and --jerk-limit are the planner's, and bind the fastest motion
    only: whether the planner's motion keeps them is not checked.
    Exit code 3: the motion breaks a limit, or no fastest one was found to compare it with.

    [dim]armdyn optimality panda planned.csv
    armdyn optimality rr toppra.npz --payload 0.1006
    armdyn optimality ur5 moveit.yaml
    armdyn optimality rr results/track-rr/trajectory.npz --search quick[/]
    """
    from armdyn.cli.reports.saved import read_saved
    from armdyn.trajectory.planned import SUFFIXES

    if robot.robot.lower().endswith(SUFFIXES):
        raise ProblemError(f"{robot.robot} stands where the robot belongs: armdyn optimality ROBOT FILE")
    arm = joints.fit(robot.read(payload.carried()))
    given = read_saved(file, arm)
    folder = results.folder("optimality", robot.robot, MOTIONS)
    with working(f"fastest motion of {arm.name}") as progress:
        found = ad.time_optimality(
            arm, given.motion, search.options(), a=given.a, **joints.problem_arguments(), **vars(rates)
        )
        summary, solution = cut_short(_facts(found)), found.solution
        motions = {"trajectory": replace(found.trajectory, name=file.stem)}
        if solution.moves:
            motions["optimum"] = replace(solution.trajectory, name="fastest")
        title = f"{arm.name}: {_title(found)}"
        written = results.write(folder, arm, motions, summary, title, progress=progress)
    words = friction_words(arm) | reserve_words(solution.problem) | _words(found) | written.words
    shown = facts_table(f"{arm.name}: {file.name} against the fastest motion", words)
    facts = {"robot": arm.name, **friction_facts(arm), **summary}
    return judged(facts, shown, usable=bool(summary["success"]), files=written.files)


def _facts(found: ad.TimeOptimality) -> dict[str, object]:
    names, solution = found.solution.problem.robot.joint_names, found.solution
    compared = solution.success
    without = "interrupted" if solution.status is ad.Status.INTERRUPTED else "no_optimum"
    return {
        "success": compared and found.feasible,
        "status": without if not compared else "compared" if found.feasible else "limits_broken",
        "message": str(found).splitlines()[0],
        "duration": found.duration,
        "optimal_duration": found.optimal_duration if compared else None,
        "ratio": found.ratio if compared else None,
        **attributes(solution, "certified", "lower_bound", "gap", "gap_proven"),
        "extremal": solution.certificate.extremal,
        **found.facts(),
        "on_no_limit": {name: float(part) for name, part in zip(names, found.idle, strict=True)},
        "what_to_do": list(solution.what_to_do),
    }


def _title(found: ad.TimeOptimality) -> str:
    if not found.solution.success:
        return f"{found.duration:.4f} s, no fastest motion found"
    return f"{found.duration:.4f} s, the fastest takes {found.optimal_duration:.4f} s"


def _words(found: ad.TimeOptimality) -> dict[str, str]:
    solution = found.solution
    names = solution.problem.robot.joint_names
    words = {"the motion takes": f"{found.duration:.6f} s"}
    if solution.success:
        words["the fastest takes"] = f"{found.optimal_duration:.6f} s, {solution.certificate.claims}"
        words["it could be"] = _possible(found)
    else:
        words["the fastest"] = f"was not found: {solution.message}"
    slides = solution.problem.robot.slides
    if (fastest := abs(found.trajectory.v[[0, -1]]).max()) > _AT_REST:
        words["at its ends"] = f"both move by up to {fastest:.3g} {joint_unit(slides, 'rad/s', 'm/s')}"
    words["limits"] = found.limits_kept
    apart = f"{found.replay_error:.2g} {joint_unit(slides)} from"
    words["replayed torques end"] = (
        f"{apart if isfinite(found.replay_error) else 'nowhere near'} its end{found.unstable}"
    )
    idle = [f"{name} {100 * part:.0f} %" for name, part in zip(names, found.idle, strict=True)]
    words["on no limit"] = ", ".join(idle) + " of the time"
    return words


_AT_REST = 1e-5
"""Velocity at an end that is said [rad/s or m/s]: a planner's positions alone may not show that it rests there."""
_NEARLY_ALL = 99.9
"""Saving [%] beyond which none is given: 100 % cannot be saved."""
_ROUNDING = 1e-9
"""Largest relative difference of equal durations: the replay is aimed to 1e-9."""


def _possible(found: ad.TimeOptimality) -> str:
    """Possible gain of time; a motion faster than the fastest one found exceeds a limit, or the search missed it."""
    if abs(found.gap) <= _ROUNDING * found.duration:
        return "no faster: it takes as long as the fastest that was found"
    if found.gap >= 0:
        saved = 100 * (1 - found.optimal_duration / found.duration)
        less = f"{saved:.3g}" if saved < _NEARLY_ALL else f"more than {_NEARLY_ALL:g}"
        return f"{short_time(found.gap, 4)} faster: {less} % less time"
    missed = "the search missed it, or limits are exceeded between samples"
    why = missed if found.feasible else "it breaks a limit"
    return f"no faster: it takes {short_time(-found.gap, 4)} less than the fastest that was found: {why}"
