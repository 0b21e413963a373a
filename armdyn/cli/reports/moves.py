"""Motions that go side by side: results that were saved, and files of other planners, all of one robot."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from armdyn.cli.reports.saved import Saved, checked, is_given, motion_of, read_saved
from armdyn.cli.reports.subject import SubjectSpec, subject_named, subject_of
from armdyn.errors import ArmdynWarning, FileError, ProblemError, TrajectoryError
from armdyn.models.robots.loads import is_motion_of
from armdyn.show.page.course import ShownMotion
from armdyn.show.page.facts import Facts
from armdyn.show.page.report import Subject

NEAR = 1e-3
"""Motions between poses nearer than this [rad or m] have the same task: text has three digits at least."""


def read_moves(paths: Sequence[Path], spec: SubjectSpec) -> tuple[Subject, list[ShownMotion]]:
    """Read motions with unique names, and their robot, from saved results; of a single result also its reference.

    The robot is the user's, else that of the first result that says one. A motion without a result is looked at,
    where the robot is at hand: whether it keeps its limits.

    Args:
        paths: results of armdyn, and motions as other planners leave them.
        spec: the robot as a user names it, if not as a result does.

    Raises:
        ArmdynError: a file cannot be read, they do not fit together, or no robot is known for a file that needs it.

    Warns:
        ArmdynWarning: a motion is of another arm or payload, or between other poses than the first.
    """
    if missing := [path for path in paths if not path.exists()]:
        raise FileError(missing[0], "no such file")
    own = {path: read_saved(path) for path in paths if not is_given(path)}
    subject = _subject(paths, list(own.values()), spec)
    results = [own[path] if path in own else _given(path, subject) for path in paths]
    moves = _named(results)
    if (robot := subject.robot) is not None:
        moves = [move if move.facts.values else replace(move, facts=checked(robot, move.motion)) for move in moves]
        first, arms = _arms(results[0]), {robot.model_hash}
        arms |= first if is_motion_of(robot, results[0].motion) or robot.model_hash in first else set()
        for one in results:
            if one.motion.model_hashes and not arms & _arms(one) and not is_motion_of(robot, one.motion):
                _warn(f"{one.path}: was computed for another arm, payload or friction than {subject.name}'s")
    if len(results) == 1 and results[0].reference is not None:
        return subject, [*moves, ShownMotion(results[0].reference.name or "reference", results[0].reference, Facts())]
    _tell_other_tasks(moves)
    return subject, moves


def _arms(one: Saved) -> frozenset[str]:
    """`Robot.model_hash` of the arm that moved, and of the controller's model of it."""
    return one.motion.model_hashes | (one.reference.model_hashes if one.reference else frozenset())


def _subject(paths: Sequence[Path], own: Sequence[Saved], spec: SubjectSpec) -> Subject:
    """The arm of the motions."""
    known = next((one for one in own if one.facts.values), own[0] if own else None)
    if known is not None:
        return subject_of(known, spec)
    if spec.robot is None:
        raise ProblemError(
            f"{paths[0]} does not say of which robot it is: name it by --robot, or give a result of armdyn beside it"
        )
    return subject_named(spec.robot, spec)


def _given(path: Path, subject: Subject) -> Saved:
    """The motion of another planner."""
    if subject.robot is None:
        raise ProblemError(f"{path} needs its robot, which is not at hand: name it by --robot")
    return Saved(path, motion_of(subject.robot, path), Facts())


def _named(results: Sequence[Saved]) -> list[ShownMotion]:
    """The motions, each with a name of its own.

    Raises:
        TrajectoryError: they have not the same joints.
    """
    joints = [one.motion.joint_names for one in results]
    for one, names in zip(results, joints, strict=True):
        if one.motion.v.shape[1] != results[0].motion.v.shape[1] or (names and joints[0] and names != joints[0]):
            raise TrajectoryError(
                f"{one.path}: moves {', '.join(names) or f'{one.motion.v.shape[1]} joints'}; {results[0].path} moves "
                f"{', '.join(joints[0]) or f'{results[0].motion.v.shape[1]} joints'}: side by side goes one arm only"
            )
    called = [one.motion.name or one.path.stem for one in results]
    return [
        ShownMotion(name if called.count(name) == 1 else f"{name} ({one.path.resolve().name})", one.motion, one.facts)
        for name, one in zip(called, results, strict=True)
    ]


def _tell_other_tasks(moves: Sequence[ShownMotion]) -> None:
    """Warn of motions whose time is not to be measured by the first's: they begin, or end, elsewhere."""
    first = moves[0].motion
    for move in moves[1:]:
        ends = [("begins", 0)]
        if not ({"settled_time", "arrival_time"} & {*move.facts.values, *moves[0].facts.values}):
            ends.append(("ends", -1))  # a closed loop comes near by its own rule
        for word, k in ends:
            beside = float(np.max(np.abs(move.motion.q[k] - first.q[k])))
            if beside > NEAR:
                _warn(
                    f"{move.name} {word} {beside:.3g} rad or m from where {moves[0].name} {word}: their times are not "
                    "of the same task"
                )


def _warn(what: str) -> None:
    warnings.warn(what, ArmdynWarning, stacklevel=4)
