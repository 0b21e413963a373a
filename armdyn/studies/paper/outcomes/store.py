"""Outcomes on disk: a JSON and an npz file each, whole or not there, and read only if their inputs are the same."""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

import armdyn
from armdyn.errors import TrajectoryError
from armdyn.files import write_whole
from armdyn.studies.paper.outcomes.case import Case
from armdyn.studies.paper.outcomes.outcome import Outcome
from armdyn.studies.paper.printed.loop import DURATION, PAPER_GAINS
from armdyn.trajectory import Trajectory

_FORMAT = "armdyn-outcome-1"


def fingerprint(case: Case) -> str:
    """A hash of all that an outcome depends on: the case, its robot's URDF and poses, armdyn's version."""
    inputs = {
        "format": _FORMAT,
        "version": armdyn.__version__,
        "case": asdict(case),
        "urdf": case.robot().urdf,
        "q_start": case.q_start,
        "q_goal": case.q_goal,
        "gains": asdict(PAPER_GAINS),
        "duration": DURATION,
    }
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def save_outcome(folder: Path, outcome: Outcome) -> Path:
    """Write NAME.json and NAME.npz of an outcome. The JSON file comes last: where it is, both are.

    Args:
        folder: made if it is not there.
        outcome: what is kept.

    Returns:
        The JSON file.

    Raises:
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{outcome.case.name}.json"
    path.unlink(missing_ok=True)
    if outcome.trajectory is not None:
        outcome.trajectory.save(path.with_suffix(".npz"))
    content = {
        "format": _FORMAT,
        "fingerprint": fingerprint(outcome.case),
        "case": asdict(outcome.case),
        "time": outcome.time,
        "success": outcome.success,
        "status": outcome.status,
        "message": outcome.message,
        "facts": outcome.facts,
        "summary": outcome.summary,
        "trajectory": outcome.trajectory is not None,
    }
    return write_whole(path, (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())


def load_outcome(folder: Path, case: Case) -> Outcome | None:
    """What `save_outcome` wrote of a case.

    Args:
        folder: where.
        case: whose.

    Returns:
        None if there is nothing, it is damaged, or it came from other inputs or another version.
    """
    path = folder / f"{case.name}.json"
    try:
        content = json.loads(path.read_bytes())
        if content["fingerprint"] != fingerprint(case):
            return None
        motion = Trajectory.load(path.with_suffix(".npz")) if content["trajectory"] else None
        given = {name: content[name] for name in ("time", "success", "status", "message", "facts", "summary")}
    except (OSError, ValueError, KeyError, TypeError, TrajectoryError):
        return None
    return Outcome(case=case, trajectory=motion, **given)
