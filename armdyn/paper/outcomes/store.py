"""Outcomes on disk: a JSON and an npz file each, whole or not there.

They are read only if inputs and content match the digests in the JSON file.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path

from armdyn.errors import FileError, TrajectoryError
from armdyn.files import read_json, write_whole
from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.checking import outcome_from
from armdyn.paper.outcomes.outcome import Outcome
from armdyn.paper.printed.loop import DURATION, GAINS
from armdyn.trajectory import Trajectory

_FORMAT = "armdyn-outcome-2"
_HEAD = ("format", "fingerprint", "case", "trajectory")

MAX_BYTES = 2**22
"""Largest JSON file of an outcome that is read [bytes]; usual ones have some ten thousand."""


def fingerprint(case: Case) -> str:
    """Hash of an outcome's inputs: the case, its robot's URDF and poses, armdyn's version."""
    inputs = {
        "format": _FORMAT,
        "version": version("armdyn"),
        "case": asdict(case),
        "urdf": case.robot().urdf,
        "q_start": case.q_start,
        "q_goal": case.q_goal,
        "gains": asdict(GAINS),
        "duration": DURATION,
    }
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def save_outcome(folder: Path, outcome: Outcome) -> Path:
    """Write NAME.json and NAME.npz of an outcome. The JSON file comes last: where it is, both are.

    Args:
        folder: made if it is not there.
        outcome: the outcome.

    Returns:
        The JSON file.

    Raises:
        DiskFullError: there is no room for a file.
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{outcome.case.name}.json"
    path.unlink(missing_ok=True)
    motion = outcome.trajectory
    if motion is not None:
        motion = replace(motion, model_hash=outcome.case.robot().model_hash)
        motion.save(path.with_suffix(".npz"))
    content: dict[str, object] = {
        "format": _FORMAT,
        "fingerprint": fingerprint(outcome.case),
        "case": asdict(outcome.case),
        "time": outcome.time,
        "success": outcome.success,
        "status": outcome.status,
        "message": outcome.message,
        "facts": outcome.facts,
        "summary": outcome.summary,
        "trajectory": motion is not None,
    }
    content["digest"] = _digest(content, motion)
    return write_whole(path, (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())


def load_outcome(folder: Path, case: Case) -> Outcome | None:
    """Read the outcome that `save_outcome` wrote.

    Args:
        folder: where.
        case: whose.

    Returns:
        None if there is nothing, it is damaged or was changed, or it came from other inputs or another version.
    """
    path = folder / f"{case.name}.json"
    try:
        content = read_json(path, MAX_BYTES)
        if not isinstance(content, dict) or content.get("fingerprint") != fingerprint(case):
            return None
        motion = Trajectory.load(path.with_suffix(".npz")) if content.get("trajectory") is True else None
        if content.pop("digest", None) != _digest(content, motion):
            return None
        fields = {name: value for name, value in content.items() if name not in _HEAD}
        return outcome_from(case, fields, motion)
    except (FileError, TrajectoryError, ValueError):
        return None


def _digest(content: Mapping[str, object], motion: Trajectory | None) -> str:
    """A hash of a JSON file's other content, and of the motion."""
    digest = hashlib.sha256(json.dumps(content, sort_keys=True, allow_nan=False).encode())
    if motion is not None:
        for array in (motion.t, motion.q, motion.v, motion.tau):
            digest.update(repr(array.shape).encode() + array.tobytes())
    return digest.hexdigest()
