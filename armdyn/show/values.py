"""Renderer of values: notebook cards, figures and reports; registered in `armdyn.rendering`."""

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import singledispatch
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from armdyn.arguments import path_of
from armdyn.arrays import Array
from armdyn.control.tracking.run import Run
from armdyn.models import Robot
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.answer.solution import Solution, minimum_time_summary
from armdyn.optimal.answer.words import solution_title, solution_words
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.reprs import joints_of
from armdyn.show.figures.style import COLORS, INK, LOOK, literal
from armdyn.show.markup import Html, element, inline_svg, join
from armdyn.show.page.scene import joint_poses
from armdyn.show.plots import plot_trajectories, svg_text
from armdyn.show.results import source_name, write_report
from armdyn.trajectory import Trajectory

_MOST_SAMPLES = 600
"""Most samples that are drawn; a longer motion is resampled at even times."""
_AXES = "xyz"
_MOST_ROWS = 40
"""Joints that a table shows."""
_CELL = "text-align:left;padding:.1em .9em .1em 0;vertical-align:top"


@singledispatch
def card(value: object) -> str:
    """HTML card of a value for notebooks.

    Args:
        value: a Robot, MinimumTimeProblem, Solution, Trajectory or Run.

    Raises:
        TypeError: it is none of these.
    """
    raise TypeError(f"a notebook has no card for {type(value).__name__}")


@card.register
def _robot(robot: Robot) -> Html:
    facts = {"from": source_name(robot.source), "tip": robot.tip}
    if robot.payload is not None:
        facts["payload"] = f"{robot.payload.mass:g} kg"
    if robot.locked:
        facts["locked"] = ", ".join(f"{name} = {value:g}" for name, value in robot.locked.items())
    if robot.friction.present:
        facts["friction"] = "applied"
    title = f"{robot.name}: {joints_of(robot.nv)}"
    start = np.clip(np.zeros(robot.nv), robot.limits.position_lower, robot.limits.position_upper)
    picture = robot_picture(robot, [start])
    return _card(title, facts, _joints(robot.joint_names, robot.limits), _svg(picture, title))


@card.register
def _problem(problem: MinimumTimeProblem) -> Html:
    names = problem.robot.joint_names
    ends = {"start": problem.q_start, "goal": problem.q_goal}
    facts = {"to do": "from start to goal in minimum time" + (" and effort" if problem.pays_effort else "")}
    if problem.path_constraint_names:
        facts["path constraints"] = ", ".join(problem.path_constraint_names)
    if problem.reserves.any:
        facts["kept for feedback"] = "part of the limits; those below are reduced by it"
    title = f"Minimum time of {problem.robot.name}"
    picture = robot_picture(problem.robot, list(problem.poses))
    table = _joints(names, problem.limits, {name: np.asarray(value) for name, value in ends.items()})
    return _card(title, facts, table, _svg(picture, f"{title}: poses"))


@card.register
def _solution(solution: Solution) -> Html:
    sliding, said = solution.problem.robot.slides.tolist(), solution_title(solution)
    picture = motion_picture(solution.trajectory, solution.problem.limits, solution.phases is not None, sliding)
    return _card(said, solution_words(solution), _svg(picture, f"{said}, the motion"))


@card.register
def _motion(motion: Trajectory) -> Html:
    title = motion.name or "Trajectory"
    names = motion.joint_names or tuple(f"joint {i + 1}" for i in range(motion.v.shape[1]))
    facts = {"duration": f"{motion.duration:.6f} s", "samples": f"{motion.t.size}"}
    head = ("joint", "from", "to", "largest speed", "largest torque")
    columns = motion.v.shape[1]
    q = motion.q[:, :columns] if motion.q.shape[1] >= columns else np.full_like(motion.v, np.nan)
    rows = [
        (name, *(f"{x:.4g}" for x in (q[0, i], q[-1, i], np.abs(motion.v[:, i]).max(), np.abs(motion.tau[:, i]).max())))
        for i, name in enumerate(names[:_MOST_ROWS])
    ]
    return _card(title, facts, _table(head, rows), _svg(motion_picture(motion, None), title))


@card.register
def _run(run: Run) -> Html:
    title = run.trajectory.name or "Run of a loop"
    facts = {
        "status": run.message,
        "settled": "no" if run.settled_time is None else f"after {run.settled_time:.4f} s",
        **run.words(),
    }
    return _card(title, facts, _svg(motion_picture(run.trajectory, None), title))


def _card(title: str, facts: Mapping[str, str], *parts: Html) -> Html:
    return element("div", element("b", title), _table((), list(facts.items())), *parts, style="max-width:60em")


def _joints(names: Sequence[str], limits: JointLimits, more: Mapping[str, Array] | None = None) -> Html:
    """Table of the joints: limits and further numbers, one row per joint."""
    more = more or {}
    head = ("joint", *more, "position [rad or m]", "velocity [rad/s or m/s]", "torque [N m or N]")
    rows = [
        (name, *(f"{values[i]:.4g}" for values in more.values()), *own)
        for i, (name, own) in enumerate(zip(names[:_MOST_ROWS], limits.words(), strict=False))
    ]
    return _table(head, rows)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Html:
    top = [element("tr", *(element("th", text, style=_CELL) for text in head))] if head else []
    body = [element("tr", *(element("td", text, style=_CELL) for text in row)) for row in rows]
    return element("table", join([*top, *body]))


def _svg(figure: Figure, label: str) -> Html:
    text = svg_text(figure)
    prefix = f"armdyn-{hashlib.sha256(text.encode()).hexdigest()[:10]}"  # two cells of one page may show the same value
    return element("div", inline_svg(text, prefix, label, {INK: "currentColor"}), style="overflow-x:auto")


def motion_picture(
    motion: Trajectory, limits: JointLimits | None, resolved: bool = True, sliding: Sequence[bool] = ()
) -> Figure:
    """Position, velocity and torque over time.

    Args:
        motion: the drawn one.
        limits: drawn, too; None: none.
        resolved: its switching times are exact, not a mesh's or a curve's; else the legend says so.
        sliding: which joints slide; empty: none does.
    """
    unresolved = () if resolved else (0,)
    figure = plot_trajectories([_thinned(motion)], limits=limits, unresolved=unresolved, sliding=sliding)
    figure.set_size_inches(6.0, 5.4 + 1.4 * (len(figure.axes) - 3))
    return _clear(figure)


@rc_context(LOOK)
def robot_picture(robot: Robot, poses: Sequence[Array]) -> Figure:
    """An arm's joints and tip, joined by lines, seen along the axis of the world in which it extends least.

    Args:
        robot: the arm.
        poses: joint positions [rad or m], each of shape (nv,), the first drawn faintest.
    """
    lines = [_skeleton(robot, q) for q in poses]
    spread = np.ptp(np.concatenate(lines), axis=0)
    across, up = sorted(np.argsort(spread, kind="stable")[1:])  # z, where it is seen, goes up
    figure = Figure(figsize=(3.4, 3.0), layout="constrained")
    axes = figure.add_subplot()
    for i, line in enumerate(lines):
        shade = 1.0 if len(lines) == 1 else 0.35 + 0.65 * i / (len(lines) - 1)
        last = i == len(lines) - 1
        name = "" if len(lines) == 1 else "start" if i == 0 else "goal" if last else f"via {i}"
        axes.plot(line[:, across], line[:, up], "-o", color=COLORS[0], alpha=shade, markersize=3.5, linewidth=1.8)
        if name:
            axes.annotate(name, (line[-1, across], line[-1, up]), xytext=(4, 4), textcoords="offset points")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.12)
    axes.set(xlabel=f"{_AXES[across]} [m]", ylabel=f"{_AXES[up]} [m]")
    axes.set_title(literal(f"tip: {robot.tip[:40]}"), fontsize=9, color=INK)
    return _clear(figure)


def _skeleton(robot: Robot, q: Array) -> Array:
    """Base, joints and tip in the world [m], shape (nv + 2, 3)."""
    poses, tips = joint_poses(robot, np.atleast_2d(q))
    return np.vstack([np.zeros(3), poses[0, :, :3], tips])


def _thinned(motion: Trajectory) -> Trajectory:
    if motion.t.size <= _MOST_SAMPLES:
        return motion
    t = np.linspace(motion.t[0], motion.t[-1], _MOST_SAMPLES)
    at = motion(t)
    return replace(motion, t=t, q=at.q, v=at.v, tau=at.tau, pieces=())


def _clear(figure: Figure) -> Figure:
    """Make the background transparent."""
    figure.patch.set_alpha(0.0)
    for axes in figure.axes:
        axes.patch.set_alpha(0.0)
    return figure


def figure(solution: Solution) -> Figure:
    """See `Solution.plot`."""
    problem, unresolved = solution.problem, () if solution.phases else (0,)
    return plot_trajectories(
        [solution.trajectory], limits=problem.limits, title=solution_title(solution), unresolved=unresolved,
        sliding=problem.robot.slides.tolist(),
    )  # fmt: skip


def report(solution: Solution, path: str | os.PathLike[str]) -> Path:
    """See `Solution.report`."""
    problem, file = solution.problem, Path(path_of(path, "path"))
    motions, summary = {"minimum time": solution.trajectory}, minimum_time_summary(solution)
    return write_report(file, problem.robot, motions, summary, solution_title(solution), problem.obstacles)
