"""The command `armdyn track`."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import armdyn as ad
from armdyn.arguments import number as checked
from armdyn.cli import interrupts
from armdyn.cli.console import Answer, escape, facts_table, judged, working
from armdyn.cli.invocation import flag_of, is_given
from armdyn.cli.options.groups import TASK, group, option
from armdyn.cli.options.joints import friction_words
from armdyn.cli.options.results import ResultOptions
from armdyn.cli.options.task import FastArmOptions
from armdyn.cli.tracking.controllers import ControllerOptions, LoopOptions, PlantOptions
from armdyn.errors import ProblemError

_UNUSED = {
    "reference": ("q_start", "q_goal", "reserve", "velocity_reserve"),
    "ramp": ("reserve", "velocity_reserve"),
}
"""Options that the motion of a reference does not depend on."""


@group(TASK)
class ReferenceOptions:
    """The reference, and the simulated time."""

    reference: Path | None = option(
        "FILE",
        "A motion that was saved, or another planner's, as armdyn optimality reads it; by default the fastest one is "
        "searched.",
    )
    ramp: float | None = option("S", "Instead of the fastest motion a quintic ramp of this duration \\[s].")
    duration: float = option(
        "S", "Simulated time \\[s]; if the motion takes longer, its duration and a second.", default=2.0
    )
    tolerance: float = option(
        "RAD", "Largest error from the goal at which the arm has settled \\[rad or m].", default=0.005
    )

    def motion(self, task: FastArmOptions, progress: Callable[[str], None]) -> ad.Trajectory | ad.Solution:
        """The motion to follow, or the unusable solution of a search that failed.

        Args:
            task: the controller's model, start and goal.
            progress: called with a line of text per step.

        Raises:
            ArmdynError: a file is no motion of the arm, two references are requested, or options of another one are
                given.
            KeyboardInterrupt: Ctrl-C came during the search.
        """
        if self.reference is not None and self.ramp is not None:
            raise ProblemError("--reference and --ramp both give a reference: give one of them")
        for name, unused in _UNUSED.items():
            others = [flag_of(other) for other in unused if is_given(other)]
            if others and getattr(self, name) is not None:
                raise ProblemError(f"{others[0]} does not change the motion of --{name}: leave it out")
        if self.reference is not None:
            from armdyn.cli.reports.saved import read_saved
            from armdyn.models.robots.loads import is_motion_of

            motion = read_saved(self.reference, task.arm).motion
            if motion.model_hashes and not is_motion_of(task.arm, motion):
                warnings.warn(
                    f"{self.reference}: was computed for another arm, payload or friction than {task.arm.name}'s: "
                    "give the --payload, --damping, --friction, --lock and --mount of its run",
                    ad.ArmdynWarning, stacklevel=2,
                )  # fmt: skip
            return motion
        if self.ramp is not None:
            return ad.ramp(task.arm, *task.ends(), checked(self.ramp, "--ramp", sign="positive"))
        solution = ad.solve_minimum_time(task.problem(), ad.MinimumTimeOptions(**task.solver_options), progress)
        if solution.status is ad.Status.INTERRUPTED or interrupts.pressed():
            raise KeyboardInterrupt
        return solution.trajectory if solution.usable else solution


def track(
    task: FastArmOptions,
    reference: ReferenceOptions,
    controller: ControllerOptions,
    loop: LoopOptions,
    plant: PlantOptions,
    results: ResultOptions,
) -> Answer:
    """Simulate a controller on a real arm along a motion: sampled, delayed, saturated, with another payload.

    The fastest motion leaves feedback no torque; --reserve 0.1 keeps some for it. The controller's model carries
    --payload; the simulated arm may carry --plant-payload and have friction. Where the payload changes along
    --reference, both have the loads of its pieces. Exit code 0: it settled at the goal, and the output names
    limits that it exceeded on the way; 3: it did not, and the output says why, also where the loop is unstable for its
    sampling.

    [dim]armdyn track rrr --payload 0.1006 --reserve 0.1 --plant-payload 0.12
    armdyn track rr --ramp 0.4 --controller pid --gains 30,50,1
    armdyn track problem.toml --plant-payload 0.12
    armdyn track ur5 --reference results/mintime-ur5/trajectory.npz --controller computed-torque[/]
    """
    from armdyn.show.page.motions import until

    arm = task.arm
    law, joined, real = controller.chosen(), loop.joined(), plant.real(task)
    folder = results.folder("track", task.robot.robot, ("trajectory", "reference"))

    with working(f"tracking with {arm.name}") as progress:
        motion = reference.motion(task, progress)
        if isinstance(motion, ad.Solution):
            return no_motion(motion)
        progress("the loop")
        run = ad.track(arm, motion, law, real, joined, reference.duration, tolerance=reference.tolerance)
        summary = {"robot": arm.name, "reference_duration": motion.duration, **run.summary()}
        title = f"{arm.name}: {controller.controller}, {_outcome(run)}"
        followed = replace(motion, name="reference", model_hash=arm.model_hash)
        # A fifth longer than reference and settling took is worth looking at.
        end = None if run.settled_time is None else 1.2 * max(run.settled_time, motion.duration)
        motions = {"trajectory": until(run.trajectory, end), "reference": followed}
        written = results.write(folder, real, motions, summary, title, progress=progress)
    words = friction_words(real) | _words(run, motion) | ({} if run.settled else controller.in_force()) | written.words
    shown = facts_table(f"{arm.name}: tracking with {controller.controller}", words)
    return judged(summary, shown, usable=run.settled, files=written.files)


def no_motion(found: ad.Solution) -> Answer:
    """The answer where there is no motion to follow."""
    facts = {"success": False, "status": str(found.status), "message": found.message}
    return judged(facts, usable=False, remarks=[f"no motion to follow: {escape(found.message)}"])


def _outcome(run: ad.Run) -> str:
    if run.settled_time is None:
        return str(run.status).replace("_", " ")
    return f"settled at {run.settled_time:.4f} s" + (", beyond its limits" if run.limits_exceeded else "")


def _words(run: ad.Run, reference: ad.Trajectory) -> dict[str, str]:
    """A run in words."""
    settled = run.settled_time
    later = "" if settled is None else f", {1e3 * (settled - reference.duration):+.1f} ms from the reference's end"
    words = {
        "reference": f"{reference.duration:.4f} s",
        "status": run.message,
        "settled": "-" if settled is None else f"{settled:.4f} s{later}",
        **run.words(),
    }
    if run.failed_time is not None:
        words["far from the reference"] = f"by 20 tolerances or more, first at {run.failed_time:.3f} s"
    return words
