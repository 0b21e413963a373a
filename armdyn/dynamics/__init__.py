"""Equations of motion: Pinocchio's in CasADi, and by hand."""

from armdyn.dynamics.symbolic import Dynamics

__all__ = ["Dynamics"]
