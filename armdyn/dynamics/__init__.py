"""Equations of motion: Pinocchio's, in CasADi and in numbers."""

from armdyn.lazy import facade

__getattr__, __dir__, __all__ = facade(__name__, __file__)
