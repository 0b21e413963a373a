"""Equations of motion: Pinocchio's in CasADi, and by hand."""

from typing import TYPE_CHECKING

from armdyn.lazy import facade

if TYPE_CHECKING:
    from armdyn.dynamics.numeric import forward_dynamics, inverse_dynamics
    from armdyn.dynamics.symbolic import Dynamics
else:
    __getattr__, __dir__ = facade(
        __name__,
        {
            "numeric": "forward_dynamics inverse_dynamics",
            "symbolic": "Dynamics",
        },
    )

__all__ = ["Dynamics", "forward_dynamics", "inverse_dynamics"]
