"""The command `armdyn pid`."""

from __future__ import annotations

import armdyn as ad
from armdyn import models
from armdyn.cli.console import Answer, facts_table, judged, working
from armdyn.cli.options.groups import Numbers, group, option
from armdyn.cli.options.joints import friction_facts, friction_words
from armdyn.cli.options.results import ResultOptions
from armdyn.cli.options.task import ArmOptions
from armdyn.cli.tracking.controllers import in_force
from armdyn.control.tracking.arrival import ARRIVAL_RULES
from armdyn.errors import ProblemError


@group("Loop")
class PidLoopOptions:
    """The controller, and the simulated time; see `simulate_pid`."""

    gains: Numbers = option(
        "KP,KI,KD", "The same for every joint; by default those of the paper's arms.", default="30,50,10"
    )
    form: str = option(
        "FORM",
        "acceleration (the paper's), torque (saturated, not sampled), or computed_torque.",
        default="acceleration",
    )
    duration: float = option("S", "Simulated time \\[s].", default=10.0)
    arrival_rule: str | None = option(
        "RULE",
        "When it has arrived: " + ", ".join(ARRIVAL_RULES) + "; by default the first, of r, rr and rrr the "
        "paper's, which is the second.",
        show_default=False,
    )


def pid(task: ArmOptions, loop: PidLoopOptions, results: ResultOptions) -> Answer:
    """Simulate a PID loop between two poses.

    r, rr and rrr move as in the paper's Examples 4 to 6, and count as arrived when joint 1 is there to stay.

    [dim]armdyn pid rr --payload 0.1006
    armdyn pid problem.toml
    armdyn pid rr --form torque --gains 30,50,3[/]
    """
    from armdyn.control.tracking.pid import pid_summary
    from armdyn.paper.printed.loop import PAPER_RULE

    arm, (start, goal), name = task.arm, task.ends("pid"), task.robot.robot
    folder, gains = results.folder("pid", name), loop.gains or []
    if len(gains) != 3:
        raise ProblemError(f"--gains has {len(gains)} numbers; give three, KP,KI,KD")
    rule = loop.arrival_rule or (PAPER_RULE if name in models.PLANAR_ARMS else ARRIVAL_RULES[0])
    with working(f"PID loop of {arm.name}") as progress:
        run = ad.simulate_pid(
            arm,
            q_start=start,
            q_goal=goal,
            gains=ad.PidGains(*gains),
            duration=loop.duration,
            form=loop.form,  # type: ignore[arg-type]  # simulate_pid refuses unknown forms
            arrival_rule=rule,  # type: ignore[arg-type]  # the same
        )
        summary = pid_summary(run)
        carried = f", {1000 * arm.payload.mass:g} g" if arm.payload is not None else ""
        title = f"{arm.name}{carried}: PID loop"
        written = results.write(folder, arm, {"trajectory": run.trajectory}, summary, title, progress=progress)
    facts = {"robot": arm.name, **friction_facts(arm), **summary}
    failing = in_force("pid", gains, loop.form) if run.arrival_time is None else {}
    words = facts_table(f"{arm.name}: PID loop", friction_words(arm) | _words(run) | failing | written.words)
    return judged(facts, words, usable=run.arrival_time is not None, files=written.files)


def _words(run: ad.Run) -> dict[str, str]:
    """A run in words."""
    return {
        "status": run.message,
        "arrival": _arrival(run),
        "overshoot": run.words()["overshoot"],
        "max Re λ": f"{run.max_real_eigenvalue:.4f} 1/s",
    }


def _arrival(run: ad.Run) -> str:
    """Time of arrival with its rule; for other rules than that all joints stay, also the time of that rule."""
    rule = run.arrival_rule.replace("_", " ")
    words = f"{_seconds(run.arrival_time)} ({rule})"
    if run.arrival_rule == ARRIVAL_RULES[0]:
        return words
    return f"{words}; all joints: {_seconds(run.settled_time)}"


def _seconds(time: float | None) -> str:
    return "-" if time is None else f"{time:.4f} s"
