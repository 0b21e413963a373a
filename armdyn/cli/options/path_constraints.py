"""Options of path constraints, of obstacles, and of controllers' presets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import TYPE_CHECKING, Any

import typer

import armdyn as ad
from armdyn.cli.invocation import is_given
from armdyn.cli.options.groups import LIMITS, SCENE, TASK, PerJoint, flag, group, option
from armdyn.cli.options.poses import positions
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import numbers

if TYPE_CHECKING:
    from armdyn.models.scene.obstacles import Obstacle


def _explained(texts: list[str] | None) -> list[str] | None:
    """`--limit help` lists the limits, and ends."""
    if "help" in (texts or ()):
        from armdyn.optimal.constraints.registry import options

        for name, kind in options().items():
            typer.echo(f"--limit {name}={kind.metavar}\n    {kind.help}")
        raise typer.Exit
    return texts


@group(LIMITS)
class RateOptions:
    """Limits of acceleration and jerk, by the names that a `MinimumTimeProblem` gives them."""

    acceleration_limit: PerJoint = option("A[,A…]", "Acceleration limits \\[rad/s² or m/s²]; by default none.")
    jerk_limit: PerJoint = option(
        "J[,J…]", "Jerk limits \\[rad/s³ or m/s³]: the torque no longer jumps. By default none."
    )


@group(SCENE)
class SceneOptions:
    """Obstacles, and the clearance from them: the texts of the options."""

    obstacle: list[str] | None = option(
        "SHAPE|FILE.json",
        "Something to keep clear of, in the world \\[m]: box:SX,SY,SZ@X,Y,Z (edges, centre), sphere:R@X,Y,Z, "
        "capsule:R@X,Y,Z;X,Y,Z, cylinder:R@X,Y,Z;X,Y,Z, plane:NX,NY,NZ@X,Y,Z "
        "(outward normal), or a file of them, boxes turned too (docs/obstacles.md). May be given again.",
    )
    scene: list[str] | None = option(
        "FILE",
        "Scene to keep clear of: a MoveIt planning scene (.yaml, .scene), whose allowed contacts hold, or the URDF of "
        "a cell (docs/obstacles.md). May be given again.",
    )
    self_collision: bool = flag("Keep the arm's links clear of each other, too.")
    allow_contact: list[str] | None = option(
        "A,B", "Names of a link and an obstacle, or of two links, that may touch. May be given again."
    )
    clearance: float = option("M", "Least distance from obstacles, and between links \\[m].", default=0.005)

    def expect_bodies(self) -> None:
        """Refuse a clearance from nothing.

        Raises:
            ProblemError: --clearance is given without anything to keep clear of.
        """
        if is_given("clearance") and not (self.obstacle or self.scene or self.self_collision):
            raise ProblemError("--clearance is from nothing: give --obstacle, --scene or --self-collision")

    def scene_arguments(self, robot: ad.Robot) -> dict[str, Any]:
        """The scene as arguments of a `MinimumTimeProblem`, or of `ExcitingOptions`.

        Args:
            robot: that moves.

        Raises:
            ProblemError: a text does not fit its option.
        """
        scenes = [ad.load_scene(file, robot) for file in self.scene or ()]
        allowed = (pair for scene in scenes for pair in scene.allowed_contacts)
        return {
            "obstacles": (*obstacles_of(self.obstacle or ()), *(one for scene in scenes for one in scene.obstacles)),
            "self_collision": self.self_collision,
            "allowed_contacts": [*_pairs(self.allow_contact), *allowed],
            "clearance": self.clearance,
        }


def _pairs(texts: Sequence[str] | None) -> list[tuple[str, ...]]:
    return [tuple(name.strip() for name in text.split(",")) for text in texts or ()]


@group()
class PathConstraintOptions(SceneOptions):
    """Via points, obstacles, limits of acceleration and jerk: the texts of the options."""

    via: list[str] | None = option(
        "Q,Q,…|NAME",
        "Pose to pass through, at any time and speed, like --q-start; may be given again, in order.",
        rich_help_panel=TASK,
    )
    end_contact: list[str] | None = option(
        "A,B", "Names that may touch at the start or the goal, as a payload and its table. May be given again."
    )
    rates: RateOptions = field(default_factory=RateOptions)
    kinematic: bool = flag(
        "Leave torques out, as for a URDF without inertias: limits of position, velocity, acceleration and jerk alone.",
        rich_help_panel=LIMITS,
    )
    limit: list[str] | None = option(
        "NAME=X[,X…][@FRAME]",
        "A limit along the way, such as tip-speed=0.25; --limit help lists them. May be given again.",
        rich_help_panel=LIMITS,
        callback=_explained,
    )

    def problem_arguments(self, robot: ad.Robot) -> dict[str, Any]:
        """The path constraints as arguments of a `MinimumTimeProblem`.

        Args:
            robot: that moves.

        Raises:
            ProblemError: a text does not fit its option.
        """
        from armdyn.optimal.constraints.registry import path_constraint_from

        return {
            "via": [positions(text, "--via", robot) for text in self.via or ()],
            **self.scene_arguments(robot),
            "end_contacts": _pairs(self.end_contact),
            **vars(self.rates),
            "kinematic": self.kinematic,
            "path_constraints": [path_constraint_from(text) for text in self.limit or ()],
        }


def obstacles_of(texts: Sequence[str], option: str = "--obstacle") -> tuple[Obstacle, ...]:
    """Parse obstacles of --obstacle, or shapes of another option.

    Raises:
        ProblemError: a text is no shape and no file, or the file has none.
    """
    from armdyn.models.scene.obstacles import SHAPES, load_obstacles

    found: list[Obstacle] = []
    for text in texts:
        kind, colon, rest = text.partition(":")
        if colon and (kind in SHAPES or "@" in rest):
            found.append(_shape(kind, rest, f"{option} {text}"))
        else:
            found += load_obstacles(text)
    return tuple(found)


def _shape(kind: str, text: str, what: str) -> Obstacle:
    """One shape, written SIZES@PLACES."""
    from armdyn.models.scene.obstacles import SHAPES, obstacle_from

    written = {name: f"{name}:{one.option()}" for name, one in SHAPES.items() if one.places}
    if kind not in written:
        raise ProblemError(f"{what}: write {' or '.join(written.values())}")
    shape, (sizes, _, places) = SHAPES[kind], text.partition("@")
    try:
        values, at = numbers(sizes, what), [numbers(place, what) for place in places.split(";")]
    except ProblemError as error:
        raise ProblemError(f"{error}; write {written[kind]}") from None
    counts = [metavar.count(",") + 1 for metavar in shape.sizes.values()]
    if (len(values), len(at)) != (sum(counts), len(shape.places)):
        raise ProblemError(f"{what}: write {written[kind]}")
    each = [values.pop(0) if count == 1 else [values.pop(0) for _ in range(count)] for count in counts]
    entry = dict(zip((*shape.sizes, *shape.places), (*each, *at), strict=True))
    return obstacle_from({"type": kind, **entry}, what)


def preset_named(name: str, interface: str | None = None) -> ad.ControllerPreset:
    """A built-in preset, or that of a file NAME.toml.

    Raises:
        ArmdynError: the preset is unknown, the file describes none, or the interface is unknown.
    """
    if name.lower().endswith(".toml"):
        return ad.ControllerPreset.read(name).on(interface or "")
    return ad.ControllerPreset.named(name, interface or "")


def known_presets(incomplete: str) -> list[str]:
    """Names of presets with a beginning, for shell completion."""
    return [name for name in ad.ControllerPreset.names() if name.startswith(incomplete)]


@group(LIMITS)
class PresetOptions:
    """A controller preset, and its interface."""

    preset: str | None = option(
        "NAME|FILE.toml",
        "Conditions of the robot's controller, such as franka-panda (armdyn presets), or of your own file "
        "(docs/presets.md).",
        autocompletion=known_presets,
    )
    interface: str | None = option(
        "NAME", "Command interface of the controller: position, velocity or torque; by default the preset's first."
    )

    def read(self) -> ad.ControllerPreset | None:
        """The preset; None: no --preset.

        Raises:
            ArmdynError: see `preset_named`; or an interface is given without a preset.
        """
        if self.preset is not None:
            return preset_named(self.preset, self.interface)
        if self.interface is not None:
            raise ProblemError(f"--interface {self.interface} needs --preset NAME (armdyn presets lists them)")
        return None
