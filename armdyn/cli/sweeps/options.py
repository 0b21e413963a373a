"""Options of a robot's sweep over payload."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import typer

import armdyn as ad
from armdyn import models
from armdyn.cli.options.groups import given, option
from armdyn.cli.options.robot import PayloadPlace, RobotArgument, known_names
from armdyn.cli.parsing.panels import SOLVER
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import numbers

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, kw_only=True)
class PayloadsOptions:
    """What the robot carries, one after the other, and where.

    Attributes:
        payload: the masses [kg] as text; None: the paper's.
        place: where each is.
    """

    panel: ClassVar[str] = PayloadPlace.panel

    payload: str | None = option("KG,KG,…", "Point masses that the arm carries \\[kg]. r, rr, rrr: the paper's ten.")
    place: PayloadPlace = field(default_factory=PayloadPlace)

    def masses(self, robot: str) -> list[float]:
        """The masses [kg] that a robot is to carry, each once, increasing.

        Raises:
            ProblemError: none is given for a robot that is not the paper's.
        """
        if self.payload is not None:
            return sorted(set(numbers(self.payload, "--payload")))
        if robot not in models.PLANAR_ARMS:
            raise ProblemError(f"give --payload with the masses [kg] that {robot} is to carry, such as 0,0.5,1")
        from armdyn.paper import PAYLOADS

        return sorted(PAYLOADS)


@dataclass(frozen=True, kw_only=True)
class SweepOptions:
    """How much is searched for each payload; see `MinimumTimeOptions`."""

    panel: ClassVar[str] = SOLVER

    starts: int | None = option("N", "Guesses of every search; by default the first has mintime's, the others few.")
    time_limit: float = option("S", "For each payload \\[s].", default=300.0)

    def options(self, of_file: Mapping[str, Any]) -> ad.MinimumTimeOptions:
        """Options of every search.

        Args:
            of_file: options of a problem file, by name; those of the command line go first.
        """
        return ad.MinimumTimeOptions(**{"time_limit": self.time_limit, **of_file, **given(self)})


@dataclass(frozen=True, kw_only=True)
class SweptOptions(RobotArgument):
    """A robot, or a file that says of many cases what is done in each."""

    robot: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT|STUDY.toml",
            help="A robot or a problem file, as mintime takes them, or a study file (docs/sweeps.md).",
            show_default=False,
            autocompletion=known_names,
        ),
    ]
