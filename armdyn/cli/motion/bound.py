"""The command `armdyn bound`: proves a lower bound on the duration."""

from __future__ import annotations

import armdyn as ad
from armdyn.cli.console import Answer, done, facts_table, working
from armdyn.cli.options.joints import friction_facts, friction_words, reserve_words
from armdyn.cli.options.task import ProblemOptions


def bound(task: ProblemOptions) -> Answer:
    """Lower bound on the duration between two poses, proven: no motion is faster.

    Velocity limits alone give one; torque limits add the least time of speeding up and slowing down. All is
    computed in intervals, rounded outward; no motion is searched for. With --goal-pose the bound holds for all joint
    positions within the limits that reach the pose, with --wrap for all ways round. It takes less than a second, for a
    goal pose of six or seven joints some seconds. Without velocity
    limits there is no bound, which is no error: the exit code is 0.

    [dim]armdyn bound panda --q-start ready --q-goal 1,0.2,0.5,-1.5,0.3,2,-0.5
    armdyn bound r --velocity-limit 5 --payload 0.1006[/]
    """
    from armdyn.optimal.answer.solution import reserve_summary

    problem = task.problem()
    task.path_constraints.expect_bodies()
    arm = problem.robot
    with working(f"lower bound of {arm.name}"):
        found = ad.lower_bound(problem)
    facts = {"robot": arm.name, **friction_facts(arm), "reserve": reserve_summary(problem), **_facts(found)}
    words = friction_words(arm) | reserve_words(problem) | _words(found)
    return done("unbounded" if found is None else "bounded", facts, facts_table(f"{arm.name}: lower bound", words))


def _facts(found: ad.LowerBound | None) -> dict[str, object]:
    if found is None:
        return {"bound": None, "joint": None, "kinematic": None, "ramps": None}
    return {"bound": found.duration, "joint": found.joint, "kinematic": found.kinematic, "ramps": found.ramps}


def _words(found: ad.LowerBound | None) -> dict[str, str]:
    if found is None:
        return {"bound": "none: no joint that moves has a velocity limit; --velocity-limit gives it one"}
    words = {
        "no motion is faster than": f"{found.duration:.9f} s (proven)",
        "decided by": f"the speed limit of {found.joint}",
        "velocity limits alone": f"{found.kinematic:.9f} s",
    }
    share = f"{100 * found.ramps / found.kinematic:.3g} %"
    return words | {"speeding up and slowing down cost": f"{1e3 * found.ramps:.4g} ms at least, {share}"}
