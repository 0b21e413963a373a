"""Files of a run in one folder: trajectory, figure, report, and result.json, which explains the run's numbers.

A figure takes matplotlib and a report meshcat: each is loaded when it is drawn.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from platform import python_version
from typing import Any

import numpy as np

from armdyn.arguments import listener
from armdyn.errors import FileError, ResultError, reraised
from armdyn.files import as_json, read_json, write_whole
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.obstacles import Obstacle, obstacle_entry, payload_entry
from armdyn.models.values.actuator_limits import torque_speed_entry
from armdyn.models.values.placement import pose_entry
from armdyn.show.page.facts import Facts
from armdyn.trajectory import Trajectory

_FORMAT = "armdyn-result-1"
_UNITS = {
    "time": "s", "position": "rad or m", "velocity": "rad/s or m/s", "torque": "N m or N", "mass": "kg",
    "sensitivity to payload_mass": "s/kg", "sensitivity to effort": "s/(N m) or s/N",
    "sensitivity to velocity": "s/(rad/s) or s/(m/s)",
}  # fmt: skip

_AT_WORK = ("pin", "casadi", "numpy", "scipy")
"""Whose versions are kept besides armdyn's."""

_PACKAGES = {
    "example-robot-data": "example-robot-data/robots",
    "armdyn": "armdyn/models/robots/urdf",
    "robot_descriptions": "robot_descriptions",
}
"""Packages with robots, and their folders of robots."""

_ABSOLUTE = re.compile(r"/|~|[A-Za-z]:/|\.{1,2}/")

MAX_BYTES = 8 * 2**20
"""Largest result that is read [bytes]: of hostile JSON each byte may take forty in memory."""


def model_facts(robot: Robot) -> dict[str, object]:
    """Description of the arm for JSON: data to rebuild it from its name, and its limits.

    Numbers that are not finite are null; units are those of `_UNITS`.
    """
    limits, payload, friction = robot.limits, robot.payload, robot.friction
    return {
        "name": robot.name,
        "source": source_name(robot.source),
        "hash": robot.model_hash,
        "joints": list(robot.joint_names),
        "tip": robot.tip,
        "payload": None if payload is None else payload_entry(payload) | {"frame": payload.frame},
        "tool": None if robot.options.tool is None else payload_entry(robot.options.tool),
        "mount": None if robot.options.mount is None else pose_entry(np.array(robot.options.mount), turned=True),
        "locked": {name: float(q) for name, q in robot.locked.items()},
        "limits": as_json(limits.rows),
        "torque_speed": torque_speed_entry(limits.actuators),
        "sliding": robot.slides.tolist(),
        "armature": np.asarray(robot.model.armature, dtype=float).tolist(),
        "friction": {
            name: each.tolist() for name, each in zip(("damping", "coulomb"), friction.per_joint(robot.nv), strict=True)
        }
        | {"width": friction.listed_width},
    }


def source_name(source: str) -> str:
    """Source of a robot without private folders: a package and the path in it, or a file.

    Args:
        source: a path, or words such as "ArmSpec 'rr'", which stay as they are.
    """
    path = source.replace("\\", "/")
    for package, folder in _PACKAGES.items():
        if f"/{folder}/" in path:
            return f"{package}: {path.rpartition(f'/{folder}/')[2]}"
    return path.rpartition("/")[2] if _ABSOLUTE.match(path) else source


def _file_from(folder: Path, source: str) -> str:
    """Relative path from a folder to a robot's file; empty for robots of packages or without a file.

    Args:
        folder: of the result.
        source: of the robot.
    """
    if source_name(source) not in (source, Path(source).name) or not Path(source).is_file():
        return ""
    return Path(os.path.relpath(Path(source).resolve(), folder.resolve())).as_posix()


@cache
def _versions() -> dict[str, str]:
    """Versions of packages and of Python; to read their metadata takes 10 ms, and a run's files are several."""
    return {name: version(name) for name in _AT_WORK} | {"python": python_version()}


def result_head(robot: Robot) -> dict[str, Any]:
    """Head of every result: format, package versions, units, arm."""
    return {
        "format": _FORMAT,
        "armdyn": version("armdyn"),
        "versions": dict(_versions()),
        "units": _UNITS,
        "model": model_facts(robot),
    }


def save_result(path: str | os.PathLike[str], robot: Robot, facts: dict[str, object]) -> Path:
    """Write a run's facts with the format, armdyn's version, the arm's hash and the units; whole or not at all.

    Args:
        path: the file.
        robot: that moved.
        facts: as JSON; numbers finite.

    Returns:
        The path written.

    Raises:
        OSError: the folder cannot be written.
        ValueError: a number is not finite, or a fact has a name that is taken.
    """
    head = result_head(robot)
    folder, named = Path(path).parent, Facts(facts).part("request").part("options").text("robot")
    head["model"] |= {"file": _file_from(folder, robot.source)}
    if named.lower().endswith(".toml"):
        head["model"]["table"] = _file_from(folder, named)
    if taken := head.keys() & facts.keys():
        raise ValueError(f"facts must not be called {', '.join(sorted(taken))}")
    return write_whole(path, (json.dumps(head | facts, indent=1, allow_nan=False) + "\n").encode())


def save_results(folder: Path, robot: Robot, facts: dict[str, object], files: Sequence[Path]) -> list[Path]:
    """Write result.json, which names the files of a run, into their folder; returns all of them.

    Raises:
        OSError: the folder cannot be written.
        ValueError: see `save_result`.
    """
    every = [*files, folder / "result.json"]
    save_result(every[-1], robot, {**facts, "files": [file.name for file in every]})
    return every


def load_result(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a file of `save_result`.

    Returns:
        The facts, and the keys `format`, `armdyn`, `units` and `model`.

    Raises:
        ResultError: the file is missing or too large, no JSON, of an unknown version, in other units, or lacks the
            model's hash.
    """
    with reraised(ResultError, "", FileError):
        content = read_json(path, MAX_BYTES)
    form = content.get("format") if isinstance(content, dict) else None
    if not isinstance(content, dict) or form != _FORMAT:
        raise ResultError(f"{path}: not a result of format {_FORMAT} but {str(form)[:80]!r}")
    if content.get("units") != _UNITS:
        raise ResultError(f"{path}: in units {str(content.get('units'))[:200]}; armdyn writes {_UNITS}")
    model = content.get("model")
    if not isinstance(model, dict) or not isinstance(model.get("hash"), str):
        raise ResultError(f"{path}: does not say of which model it is")
    facts: dict[str, Any] = content
    return facts


DRAWN = {"figure": ("figure.png", "figure.pdf"), "report": ("report.html",)}
"""Drawings of a motion, with their files."""


def file_names(parts: Iterable[str], motions: Iterable[str]) -> list[str]:
    """The files that `write_run` writes."""
    return [*(f"{name}.npz" for name in motions), *(name for part in parts for name in DRAWN[part]), "result.json"]


def write_run(
    folder: Path,
    robot: Robot,
    motions: Mapping[str, Trajectory],
    summary: dict[str, object],
    title: str,
    obstacles: Sequence[Obstacle] = (),
    *,
    parts: Collection[str] = tuple(DRAWN),
    progress: Callable[[str], None] | None = None,
) -> list[Path]:
    """Write the motions (trajectory.npz), figure.png, figure.pdf, report.html and result.json.

    Args:
        folder: made if it is not there.
        robot: that moved.
        motions: its motions by the names of their files; drawn together.
        summary: facts of result.json, besides the files.
        title: of the figure and the report.
        obstacles: drawn in the report, and said in result.json.
        parts: the drawings, of `DRAWN`.
        progress: called with the name of the current step.

    Returns:
        The files written.

    Raises:
        OSError: the folder cannot be written.
    """
    progress = listener(progress)
    folder.mkdir(parents=True, exist_ok=True)
    own = {
        # A controller's reference was made for its own model of the arm.
        name: motion if name == "reference" and motion.model_hash else replace(motion, model_hash=robot.model_hash)
        for name, motion in motions.items()
    }
    scene = {"obstacles": [obstacle_entry(each) for each in obstacles]} if obstacles else {}
    facts = {"title": title, **summary, **scene}
    files = [motion.save(folder / f"{name}.npz") for name, motion in own.items()]
    save_results(folder, robot, facts, files)  # complete if Ctrl-C ends the drawing
    if "figure" in parts:
        progress("drawing the figure")
        from armdyn.show.plots import plot_trajectories, save_figures

        unresolved = (0,) if Facts(summary).unresolved else ()
        figure = plot_trajectories(
            list(own.values()), limits=robot.limits, title=title, unresolved=unresolved, sliding=robot.slides.tolist()
        )
        files += save_figures(figure, folder / "figure", ("png", "pdf"))
    if "report" in parts:
        progress("writing the report")
        files.append(write_report(folder / "report.html", robot, motions, summary, title, obstacles))
    return save_results(folder, robot, facts, files)


def write_report(
    path: Path,
    robot: Robot,
    motions: Mapping[str, Trajectory],
    summary: Mapping[str, object],
    title: str,
    obstacles: Sequence[Obstacle],
) -> Path:
    """Write the page of a run; see `write_run`. Its first motion is judged, the others are its ghosts.

    Raises:
        FileError: the folder cannot be written.
    """
    from armdyn.show.page.motions import ShownMotion, Subject
    from armdyn.show.page.report import report_of, write_page

    moves = [ShownMotion(motion.name or name, motion, Facts()) for name, motion in motions.items()]
    moves[0] = replace(moves[0], facts=Facts({**result_head(robot), **summary}))
    return write_page(path, report_of(Subject.of(robot, obstacles), moves, title))
