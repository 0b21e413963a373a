"""Protocol and registry of output formats."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Protocol

from armdyn.errors import TrajectoryError

if TYPE_CHECKING:
    from armdyn.trajectory.samples import Samples


class OutputFormat(Protocol):
    """A text format of a motion: a frozen dataclass whose fields, if any, are its options, with defaults."""

    name: ClassVar[str]
    """Value of `armdyn export --format`."""
    suffix: ClassVar[str]
    """Of the file, such as ".csv"."""
    summary: ClassVar[str]
    """A few words for `armdyn export --help`."""

    # A class attribute `rate` [Hz] is the default of `armdyn export --rate`, else 1000.

    def text(self, samples: Samples) -> str:
        """Content of the file.

        Raises:
            TrajectoryError: the format cannot express the motion.
        """


FORMATS: dict[str, type[OutputFormat]] = {}
"""Registered formats by name."""


def register(kind: type[OutputFormat]) -> None:
    """Add a format to `FORMATS`.

    Raises:
        TrajectoryError: another format has its name, or the class is incomplete.
    """
    missing = [name for name in ("name", "suffix", "summary", "text") if not hasattr(kind, name)]
    if missing:
        raise TrajectoryError(f"{kind.__name__} is no output format: it has no {', '.join(missing)}")
    if FORMATS.setdefault(kind.name, kind) is not kind:
        raise TrajectoryError(f"there is a format {kind.name!r} already, {FORMATS[kind.name].__name__}")


def joint_names(samples: Samples) -> list[str]:
    """Names by which readers find their joints.

    Raises:
        TrajectoryError: the motion has none.
    """
    if not samples.joint_names:
        raise TrajectoryError(
            "the motion's joint_names is empty, and readers find joints by name; motions that armdyn solves have them"
        )
    return list(samples.joint_names)
