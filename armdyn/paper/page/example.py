"""One of the six examples on disk: trajectory, figure, replay and summary in a folder of its own."""

from pathlib import Path

from armdyn.paper.outcomes.outcome import Outcome
from armdyn.show.results import write_run


def write_example(folder: Path, outcome: Outcome) -> list[Path]:
    """Write the files of `show.results.write_run` for an example.

    Args:
        folder: made if it is not there.
        outcome: of an example as the paper states it.

    Returns:
        The files written; none if there is no motion.

    Raises:
        OSError: the folder cannot be written.
    """
    case = outcome.case
    if outcome.trajectory is None:
        return []
    what = "minimum time" if case.kind == "minimum_time" else "PID"
    example = f"Example {case.example} (Figure {case.paper_example.figure})"
    title = f"{example}: {case.arm.upper()}, {1000 * case.payload:g} g, {what}"
    return write_run(folder, case.robot(), {"trajectory": outcome.trajectory}, outcome.summary, title)
