"""Equations of motion: Pinocchio's in CasADi, and by hand."""

from armdyn.dynamics.numeric import forward_dynamics, inverse_dynamics
from armdyn.dynamics.symbolic import Dynamics

__all__ = ["Dynamics", "forward_dynamics", "inverse_dynamics"]
