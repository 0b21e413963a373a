"""Problem files on the command line, where they stand for a robot and its task."""

from __future__ import annotations

from dataclasses import MISSING, fields, is_dataclass
from typing import TYPE_CHECKING, Any

from armdyn.cli.parsing.positions import degrees_are_on
from armdyn.errors import ProblemError

if TYPE_CHECKING:
    from armdyn.optimal.problem_files import ProblemFile


def is_problem_file(name: str) -> bool:
    """Whether the name of a robot is that of a problem file."""
    return name.lower().endswith(".toml")


def is_study_file(name: str) -> bool:
    """Whether a TOML file has neither [robot] nor [problem], and so is a study file, or none of both.

    Raises:
        ArmdynError: it cannot be read.
    """
    from armdyn.parsing.toml import read_toml

    return not {"robot", "problem"} & read_toml(name).values.keys()


def problem_file(name: str) -> ProblemFile:
    """The tables of a problem file.

    Raises:
        ProblemError: it cannot be read.
    """
    from armdyn.optimal.problem_files import read_problem_file

    return read_problem_file(name)


def refuse_beside_a_file(name: str, *groups: Any) -> None:
    """Refuse options beside a problem file or a study file that says the same itself.

    Args:
        name: the file.
        groups: of such options, as they were given.

    Raises:
        ProblemError: one of them is not as by default; or --degrees was given.
    """
    if degrees_are_on():
        raise ProblemError(f"--degrees: {name} says units itself: 1.57, or '90deg'")
    for group in groups:
        for field in fields(group):
            value = getattr(group, field.name)
            if is_dataclass(value):
                refuse_beside_a_file(name, value)
            elif field.default is not MISSING and value != field.default:
                option = "arm" if field.name == "part" else field.name.replace("_", "-")
                raise ProblemError(f"--{option}: {name} says this itself; write it there")
