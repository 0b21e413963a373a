"""A motion as one HTML file: meshcat's viewer, the arm, a player; no server, no network.

meshcat itself writes such a page (`static_html`), but by way of a server process. The same page is
put together here from meshcat's bundle and meshcat's own commands; the player's
controls are ours (`assets/replay.html`).
"""

from __future__ import annotations

import html
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from armdyn.files import write_whole
from armdyn.models import Robot
from armdyn.models.scene.obstacles import Obstacle
from armdyn.show.markup import fill, script_json
from armdyn.show.page.assets import asset, script, viewer_script
from armdyn.show.page.scene import scene_data
from armdyn.show.page.verdict import Level
from armdyn.trajectory import Trajectory

if TYPE_CHECKING:
    from armdyn.optimal import Solution


@dataclass(frozen=True)
class Judged:
    """A motion, and what is known of it.

    Attributes:
        motion: to be shown.
        level: "good", "fair" or "bad"; "none": nothing is known.
        verdict: a few words, such as "certified".
    """

    motion: Trajectory
    level: Level = "none"
    verdict: str = ""

    @classmethod
    def of(cls, one: Trajectory | Solution | Judged) -> Judged:
        """A motion itself, of which nothing is known; or a minimum-time answer, which knows."""
        if isinstance(one, Judged):
            return one
        if isinstance(one, Trajectory):
            return cls(one)
        if not one.usable:
            return cls(one.trajectory, "bad", "not usable")
        return cls(one.trajectory, *(("good", "certified") if one.certified else ("fair", "not certified")))


def write_html(
    robot: Robot,
    trajectories: Sequence[Trajectory | Solution | Judged],
    path: str | os.PathLike[str],
    *,
    fps: float = 60,
    slow_motion: float | None = None,
    obstacles: Sequence[Obstacle] = (),
) -> Path:
    """Write a replay that any browser with WebGL plays, from a file, without a network.

    One trajectory moves the robot in the colours of its URDF. Several move one robot each, in the
    trajectory's colour: one behind the other for a planar arm, else side by side.

    Args:
        robot: what moves.
        trajectories: one or more motions of it; they start together. Of a `Solution`, or a motion that is `Judged`, the
            page says whether it is certified.
        path: the HTML file.
        fps: frames per second of playing time that are stored; the page interpolates between them.
        slow_motion: how many times slower than real time it plays at first; None: about 4 s in all.
        obstacles: drawn where they stand.

    Returns:
        The path written, as given.

    Raises:
        TrajectoryError: there is no trajectory, or one has another number of joints than the robot.
        ProblemError: `fps` is not from 1e-3 to 1e3, or `slow_motion` not from 1e-6 to 1e6.
        OSError: the folder cannot be written.
    """
    fields = replay_fields(robot, trajectories, fps=fps, slow_motion=slow_motion, obstacles=obstacles)
    fields["viewer"] = viewer_script()
    # In one pass: a robot may be called {{viewer}}.
    return write_whole(path, fill(page_template(), fields).encode())


def page_template() -> str:
    """The replay page, with {{viewer}} for `viewer_script` and {{title}} and {{data}} for `replay_fields`."""
    return asset("replay.html").replace("{{scene}}", script("scene.js")).replace("{{player}}", script("player.js"))


def replay_fields(
    robot: Robot,
    trajectories: Sequence[Trajectory | Solution | Judged],
    *,
    fps: float = 60,
    slow_motion: float | None = None,
    obstacles: Sequence[Obstacle] = (),
) -> dict[str, str]:
    """What tells one replay page from another: "title" and "data", ready for `page_template`.

    Args:
        robot: what moves.
        trajectories: as in `write_html`.
        fps: as in `write_html`.
        slow_motion: as in `write_html`.
        obstacles: as in `write_html`.

    Raises:
        TrajectoryError: there is no trajectory, or one has another number of joints than the robot.
        ProblemError: `fps` is not from 1e-3 to 1e3, or `slow_motion` not from 1e-6 to 1e6.
    """
    judged = [Judged.of(one) for one in trajectories]
    motions = [one.motion for one in judged]
    data = scene_data(robot, motions, fps=fps, slow_motion=slow_motion, obstacles=obstacles)
    for arm, one in zip(data["arms"], judged, strict=True):
        arm |= {"level": one.level, "verdict": one.verdict}
    return {"title": html.escape(robot.name), "data": script_json(data)}
