"""The command that finds the fastest motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import typer

import armdyn as ad
from armdyn.cli.console import INTERRUPTED, NOT_CERTIFIED, answering, console, facts_table, working
from armdyn.cli.motion.words import solution_words, title_words
from armdyn.cli.options.course import CourseOptions
from armdyn.cli.options.joints import FastJointOptions, friction_facts, friction_words
from armdyn.cli.options.poses import GoalOptions
from armdyn.cli.options.results import ResultOptions
from armdyn.cli.options.robot import PayloadOptions, RobotOptions


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """How much is searched; see `MinimumTimeOptions`."""

    panel: ClassVar[str] = "Search"

    starts: Annotated[
        int | None,
        typer.Option(
            help="Guesses of the global search; by default as many as suit the robot (armdyn doctor ROBOT --policy)."
        ),
    ] = None
    time_limit: Annotated[float, typer.Option(metavar="S", help="For the whole solve \\[s].")] = 300.0
    seed: Annotated[int, typer.Option(help="Of the guesses after the first.")] = 0

    def options(self) -> ad.MinimumTimeOptions:
        """The solver's options."""
        return ad.MinimumTimeOptions(starts=self.starts, time_limit=self.time_limit, seed=self.seed)


def mintime(
    goal: GoalOptions,
    payload: PayloadOptions,
    robot: RobotOptions,
    joints: FastJointOptions,
    course: CourseOptions,
    search: SearchOptions,
    results: ResultOptions,
) -> None:
    """Fastest motion between two poses that the actuators allow.

    Searches many guesses, resolves the best to exact switching times, replays the torques through
    Pinocchio's forward dynamics by an independent integrator, and checks Pontryagin's conditions.
    Exit code 0 means certified; 3 that something of this failed, and the output says what. Where there
    is no motion that lands within the limits, no duration is printed.

    With obstacles, via points or limits along the way the answer is the collocation's, replayed and
    checked all along; the switching times are then not resolved, so that its exit code is 3, too.

    [dim]armdyn mintime rr --payload 0.1006
    armdyn mintime rr --obstacle sphere:0.05@0.3,0,-0.1
    armdyn mintime rr --limit tip-speed=2 --limit torque-rate=50
    armdyn mintime rr --goal-pose tip:0.35,0,0.1
    armdyn mintime panda --q-start 0,-0.785,0,-2.356,0,1.571,0.785 --q-goal 1,0.2,0.5,-1.5,0.3,2,-0.5[/]
    """
    json = results.output.json
    with answering(json) as answer:
        from armdyn.optimal.answer.summary import minimum_time_summary

        arm = joints.fit(robot.read(payload.carried()))
        problem = ad.MinimumTimeProblem(arm, **goal.asked(arm, robot.robot), **course.asked())
        folder = results.folder("mintime", robot.robot)
        with working(f"minimum time of {arm.name}", json) as progress:
            solution = ad.solve_minimum_time(problem, search.options(), progress)
            summary = minimum_time_summary(solution)
            title = f"{arm.name}, {1000 * payload.payload:g} g: {title_words(solution)}"
            motion = solution.trajectory
            written = results.write(folder, arm, motion, summary, title, problem.obstacles, tell=progress)
        answer.facts |= {"robot": arm.name, **friction_facts(arm), **summary, **written.facts}
        if not (solution.success and solution.certificate.ok):
            answer.code = INTERRUPTED if solution.status is ad.Status.INTERRUPTED else NOT_CERTIFIED
        if not json:
            words = friction_words(arm) | solution_words(solution, goal.wrap) | written.words
            console.print(facts_table(f"{arm.name}: minimum time", words))
