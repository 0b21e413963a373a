"""Transcription scheme: collocation method, torque parametrisation, form of the dynamics."""

from dataclasses import dataclass
from typing import Literal

from armdyn.optimal.task.tableau import TABLEAUS, Tableau

Control = Literal["linear", "constant", "stage"]
DynamicsForm = Literal["forward", "inverse"]


@dataclass(frozen=True)
class Scheme:
    """Transcription scheme: collocation method, torque parametrisation, form of the dynamics.

    Attributes:
        method: name of a tableau.
        control: torque between knots. Linear and constant both stay within their bounds everywhere;
            "stage", a value for every stage, does so only where it is fixed, as on the arcs of a known
            structure.
        dynamics: "forward", acceleration from the articulated-body algorithm; or "inverse", torque from
            recursive Newton-Euler with the accelerations as unknowns.
        compile: derivatives as machine code: always, never, or where it costs little (see `compiled`).
    """

    method: str = "lobatto3"
    control: Control = "linear"
    dynamics: DynamicsForm = "forward"
    compile: bool | None = None

    @property
    def tableau(self) -> Tableau:
        """Coefficients of the collocation method."""
        return TABLEAUS[self.method]
