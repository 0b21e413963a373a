"""Time saved by more of the limit that decides most, found by solving again."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from armdyn.errors import ProblemError
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.minimum_time import solve_minimum_time
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.status import Status
from armdyn.optimal.verify.costates import MORE, Share

_TIED = 0.1
"""Part of the first-order saving below which another limit ties: where none does, 0.9 to 1 of it were saved."""


def with_saving(solution: Solution, options: MinimumTimeOptions) -> Solution:
    """Solve again with the deciding limit raised by `MORE`; store the time saved, and the limits that tie with it.

    To first order a limit raised by `MORE` saves at most `MORE` times its share of the duration, and nothing where
    another limit ties with it: where both decide the same time, raising one alone does not help. So the problem is
    solved again from the solution's motion; if that hardly saves time, the limit with the largest share then is raised,
    too, until it does, or as many are raised as there are joints. Joints of these limits are not idle.

    Args:
        solution: solution of a minimum-time problem.
        options: options of its solve, with a time limit for all further solves.

    Returns:
        The solution with `saved` and `ties` in the first share of `decides`; unchanged if there is none, if its limit
        cannot be raised, or if time is up.
    """
    if not solution.decides or not solution.usable:
        return solution
    first, *others = solution.decides
    raised, saved, until = [first], list[float](), time.perf_counter() + options.time_limit
    most = MORE * first.part * solution.duration
    while len(raised) <= solution.problem.robot.nv and (left := until - time.perf_counter()) > 0:
        found = _solved_with(solution, raised, replace(options, time_limit=left))
        if found is None:
            break
        saved.append(max(0.0, solution.duration - solution.calm - found.duration))
        if saved[0] > _TIED * most or saved[-1] > most / 2:
            first = replace(first, saved=saved[0], ties=tuple(one.name for one in raised[1:]))
            idle = tuple(name for name in solution.certificate.idle if name not in {one.joint for one in raised})
            certificate = replace(solution.certificate, idle=idle)
            return replace(solution, decides=(first, *others), certificate=certificate)
        known = {one.name for one in raised}
        raised += [one for one in found.decides if one.name not in known][:1]
        if len(raised) == len(known):
            break
    return solution


def _solved_with(solution: Solution, raised: Sequence[Share], options: MinimumTimeOptions) -> Solution | None:
    """The fastest motion with some limits raised by `MORE`; None: they cannot be raised, or none was found in time.

    A controller's limits, and a torque's by speed, are not raised.
    """
    problem, limits, kept = solution.problem, solution.problem.limits, solution.problem.reserves
    if problem.preset is not None or not limits.actuators.constant:
        return None
    own = {
        "torque_limit": np.array([limits.effort_lower, limits.effort_upper]) / (1 - kept.effort),
        "velocity_limit": limits.velocity / (1 - kept.velocity),
        "acceleration_limit": problem.acceleration_limit,
        "jerk_limit": problem.jerk_limit,
    }
    for share in raised:
        name, k = share.limit.replace(" ", "_"), problem.robot.joint_names.index(share.joint)
        own[name] = np.asarray(own[name]) * np.where(np.arange(problem.robot.nv) == k, 1 + MORE, 1.0)
    effort = tuple(np.asarray(own.pop("torque_limit")))
    near = replace(options, guesses=(solution.trajectory,), starts=1, bound=False, calm=0.0)
    try:
        more = problem.variant(effort_limit=None if problem.kinematic else effort, **own)
        found = solve_minimum_time(more, near)
    except ProblemError:
        return None
    return found if found.usable and found.status is Status.SOLVED else None
