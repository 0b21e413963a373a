"""The command `armdyn mintime`: finds the fastest motion."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import armdyn as ad
from armdyn.cli.console import Answer, cut_short, facts_table, judged, working
from armdyn.cli.invocation import in_options
from armdyn.cli.motion.require import REQUIRE, missing_of, missing_words, requirements_of
from armdyn.cli.options.groups import LIMITS, SOLVER, flag, given, group, option
from armdyn.cli.options.joints import carried_facts, carried_words, friction_facts, friction_words, reserve_words
from armdyn.cli.options.results import ResultOptions
from armdyn.cli.options.task import ProblemOptions
from armdyn.errors import ProblemError
from armdyn.optimal.problem.choices import MethodName, SearchLevel

_CHEAP = 2.0
"""Time of a solve [s] below which the motion is solved again for the saving by more of the first deciding limit, some
times in thrice this time where limits tie."""
_WATCHED = 1.0
"""Simulated time of likely arms [s], or after a longer motion: they are many, and near to the model."""


class ToMinimumTimeOptions:
    """A group whose options are fields of `MinimumTimeOptions`, perhaps among others."""

    def options(self, of_file: Mapping[str, Any] = MappingProxyType({})) -> ad.MinimumTimeOptions:
        """The solver's options.

        Args:
            of_file: options of a problem file, by name; those that are typed go first.
        """
        known = {one.name for one in fields(ad.MinimumTimeOptions)}
        chosen = {**vars(self), **of_file, **given(self)}
        return ad.MinimumTimeOptions(**{name: value for name, value in chosen.items() if name in known})


@group(SOLVER)
class SolverOptions(ToMinimumTimeOptions):
    """Extent of the search; see `MinimumTimeOptions`."""

    method: MethodName | None = option(
        "NAME",
        "mesh: collocation, exact where torques decide, for few joints and joints without a motor; curves: B-splines, "
        "for many joints, where speeds decide, and among obstacles; profiles: every joint's own fastest profile, where "
        "limits of acceleration or jerk decide. By default chosen by the problem.",
    )
    search: SearchLevel = option(
        "HOW",
        "Extent of the search: normal, quick (a third of it), or thorough, which takes five times as long and "
        "misses less.",
        default="normal",
    )
    starts: int | None = option(
        "N",
        "Guesses of the global search, whatever the level; by default as many as suit the robot "
        "(armdyn doctor ROBOT --policy).",
    )
    time_limit: float = option("S", "Time limit of the whole solve \\[s].", default=300.0)
    max_intervals: int = option(
        "N", "Intervals of the finest mesh, used where a coarser one is not enough.", default=160
    )
    seed: int = option("N", "Seed of the random guesses.", default=0)


@group()
class CurveOptions(SolverOptions):
    """Extent of the search, and the time that is given for calm joints."""

    calm: float = option(
        "SHARE",
        "Part of the time that may be given for calm joints, where motions are curves (arms of more than three joints, "
        "or velocity limits that shape the motion): joints travel no farther than they need, and turn back less. 0: "
        "the fastest.",
        default=1e-3,
    )


@group()
class SearchOptions(CurveOptions):
    """Extent of the search, and the choice of a reserve for feedback."""

    for_tracking: bool = flag(
        "Choose the torque reserve (--reserve) with which likely arms settle soonest, under the default controller at "
        "1 kHz: those of a file of armdyn identify, else payload 20 % off, with and without friction."
    )

    def solved(
        self,
        problem: ad.MinimumTimeProblem,
        options: ad.MinimumTimeOptions,
        likely: Callable[[], Sequence[ad.Robot]],
        progress: Callable[[str], None],
    ) -> tuple[ad.Solution, ad.ReserveCurve | None]:
        """The solution, and the reserve curve if the reserve was to be chosen.

        Args:
            problem: the motion.
            options: the solver's.
            likely: makes the arms that must settle; none: `likely_plants`.
            progress: called with the progress in words.

        Raises:
            KeyboardInterrupt: Ctrl-C came before a reserve had a motion.
            ProblemError: a reserve is given, too.
        """
        if not self.for_tracking:
            return ad.solve_minimum_time(problem, options, progress), None
        if problem.kinematic or any(problem.reserves.effort):
            other = "--kinematic" if problem.kinematic else "--reserve"
            raise ProblemError(f"--for-tracking chooses the torque reserve: leave out {other}")
        from armdyn.studies.reserve import FINE_RESERVES

        arms = likely()
        own: Any = {"plants": arms, "reserves": FINE_RESERVES, "duration": _WATCHED} if arms else {}
        curve = ad.reserve_curve(problem, options=options, progress=progress, **own)
        if curve.best is None:
            if curve.interrupted:
                raise KeyboardInterrupt
            return ad.solve_minimum_time(problem, options, progress), curve
        return curve.solutions[curve.best.reserve], curve


def mintime(
    task: ProblemOptions,
    search: SearchOptions,
    results: ResultOptions,
    require: list[str] | None = REQUIRE,
    no_costs: bool = flag(
        "With --preset: do not solve again without each necessary condition for its cost.",
        rich_help_panel=LIMITS,
    ),
) -> Answer:
    """Fastest motion between two poses that the actuators allow.

    Solves many guesses, resolves the best one to exact switching times, and replays its torques through Pinocchio's
    forward dynamics with two independent integrators. Beyond three joints, and where velocity limits decide, the motion
    is a smooth curve with a proven lower bound on the duration.

    Certified: Pontryagin's conditions hold along the motion, or it is proven to be at most 0.1 % slower than the
    fastest possible. Where the switches are not resolved, the conditions count as kept if to first order no change of
    the motion saves 0.01 % of its time. With obstacles, via points or path limits they are not checked.

    With --preset the conditions of the robot's controller are limits, too. The motion is checked as the controller sees
    it, and solved again without each necessary condition that it meets, for the cost of that condition.

    Exit code 0: the motion is usable: it reaches the goal and satisfies all limits. 3: it is not, or the controller of
    --preset would refuse it, and the output says why. 4: it is, but --require certified (or extremal, or gap:0.5%) is
    not met.

    [dim]armdyn mintime rr --payload 0.1006
    armdyn mintime rr --obstacle sphere:0.05@0.34,0,-0.12
    armdyn mintime rr --reserve 0.1 --velocity-reserve 0.03
    armdyn mintime rr --payload 0.1006 --for-tracking
    armdyn mintime rr --limit tip-speed=2 --limit torque-rate=50
    armdyn mintime rr --goal-pose tip:0.35,0,0.1
    armdyn mintime panda --q-start ready --q-goal 1,0.2,0.5,-1.5,0.3,2,-0.5
    armdyn mintime problem.toml
    armdyn mintime results/identify-rrr/identified.toml --q-start 0,0,0 --q-goal 1,0,0 --for-tracking
    armdyn mintime ur5 --q-start home --q-goal 90deg,-45deg,60deg,-90deg,0,0 --preset ur5[/]
    """
    required = requirements_of(require)
    from armdyn.optimal.answer.solution import minimum_time_summary
    from armdyn.optimal.answer.words import solution_title, solution_words, standing
    from armdyn.optimal.saving import with_saving

    try:
        problem = task.problem()
    except ad.ContactError as error:
        _show_contacts(error, task.robot.robot, results)
        raise
    task.path_constraints.expect_bodies()
    if no_costs and problem.preset is None:
        raise ProblemError("--no-costs is about the conditions of --preset, which is not given")
    arm, options = problem.robot, search.options(task.solver_options)
    folder = results.folder("mintime", task.robot.robot)
    with working(f"minimum time of {arm.name}") as progress:
        solution, curve = search.solved(problem, options, lambda: task.likely, progress)
        left = min(3 * _CHEAP, options.time_limit - solution.solve_time)
        if solution.solve_time < _CHEAP and left > 0:
            progress("time that more of the limit that decides most saves")
            with suppress(KeyboardInterrupt):  # the motion is there
                solution = with_saving(solution, replace(options, time_limit=left))
        accepted, controller_facts, controller_words = _by_controller(solution, progress, not no_costs)
        reserves, reserve_choice = _by_reserve(curve)
        summary = cut_short(minimum_time_summary(solution) | reserves | controller_facts)
        motions, obstacles = {"trajectory": solution.trajectory}, solution.problem.obstacles
        written = results.write(folder, arm, motions, summary, solution_title(solution), obstacles, progress=progress)
        written = written.with_files([] if results.no_figure else _write_reserves(curve, folder, arm.name))
    missing = missing_of(required, solution.usable, standing(solution))
    facts = {"robot": arm.name, **carried_facts(arm), **friction_facts(arm), **summary, "missing": missing}
    words = carried_words(arm, solution.problem.goal_pose) | friction_words(arm) | reserve_words(solution.problem)
    words |= {name: in_options(said) for name, said in solution_words(solution).items()}
    words |= controller_words | reserve_choice | missing_words(missing) | written.words
    shown, usable = facts_table(f"{arm.name}: minimum time", words), solution.usable and accepted
    return judged(facts, shown, usable=usable, as_required=not missing, files=written.files)


def _show_contacts(error: ad.ContactError, name: str, results: ResultOptions) -> None:
    """Write a page with the pose for which a problem is refused into the folder of --out; without one, a hint."""
    hint = "--out DIR writes a page that shows the pose, with the bodies that touch in red"
    if results.output.out is not None and not results.no_report:
        from armdyn.show.replay import write_contacts

        folder = results.output.folder("mintime", name, ["contacts.html"])
        folder.mkdir(parents=True, exist_ok=True)
        hint = f"{write_contacts(error, folder / 'contacts.html')} shows the pose, with the bodies that touch in red"
    warnings.warn(hint, ad.ArmdynWarning, stacklevel=2)


def _by_controller(
    solution: ad.Solution, progress: Callable[[str], None], costs: bool
) -> tuple[bool, dict[str, object], dict[str, str]]:
    """Check of a solution by its preset, and cost of the preset's necessary conditions.

    Args:
        solution: of a minimum-time problem.
        progress: called with the progress in words.
        costs: solve it without each necessary condition, too.

    Returns:
        Whether the controller accepts the motion, the facts for JSON, and the words for `facts_table`; True and nothing
        without a preset or a motion.
    """
    preset = solution.problem.preset
    if preset is None or not solution.moves:
        return True, {}, {}
    from armdyn.studies.preset_costs import condition_costs

    found = preset.check(solution.trajectory)
    solved = solution.usable and solution.status is not ad.Status.INTERRUPTED
    priced = condition_costs(solution, None, progress) if costs and solved else ()
    ignored = [row for row in found.offences if not row.necessary]
    lines = [str(found), *(f"recommended, not kept: {row}" for row in ignored[:3])]
    words = {"controller": "\n".join(lines)} | ({"its conditions cost": "\n".join(map(str, priced))} if priced else {})
    facts = found.facts() | {"costs": [asdict(cost) | {"said": cost.said} for cost in priced]}
    return found.ok, {"controller": facts}, words


def _by_reserve(curve: ad.ReserveCurve | None) -> tuple[dict[str, object], dict[str, str]]:
    """A reserve curve as JSON, and the chosen reserve and the settled times of each in words; nothing without one."""
    if curve is None:
        return {}, {}
    best, rows = curve.best, [row.facts() for row in curve.rows]
    if best is None:
        return {"for_tracking": {"best": None, "rows": rows}}, {"for tracking": "no reserve has a usable motion"}
    count = len(curve.plants)
    lines = ["      motion    mean   worst  settled [s]"]
    for row in curve.rows:
        times = f"{row.mean:6.3f}  {row.worst:6.3f}"
        settled = times if math.isfinite(row.worst) else f"{row.count} of {len(row.settled)} settle"
        lines.append(f"{row.reserve:<5g} {row.duration:.4f}  {settled}")
    last = f"the last of {count} arms settles after {best.worst:.3f} s"
    text = f"reserve {best.reserve:g}: {last if best.count == count else f'{best.count} of {count} arms settle'}"
    words = {"for tracking": text, "by reserve": "\n".join(lines)}
    return {"for_tracking": {"best": best.facts(), "rows": rows}}, words


def _write_reserves(curve: ad.ReserveCurve | None, folder: Path, title: str) -> list[Path]:
    """The curve's figure, reserve.png; none without a row."""
    if curve is None or not curve.rows:
        return []
    from armdyn.show.figures.loops import plot_reserves
    from armdyn.show.plots import save_figure

    return [save_figure(plot_reserves([row.facts() for row in curve.rows], title), folder / "reserve.png")]
