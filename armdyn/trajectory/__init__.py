"""Trajectories, the one result of solvers and simulations, and their formats."""

from armdyn.lazy import facade

__getattr__, __dir__, __all__ = facade(__name__, __file__)
