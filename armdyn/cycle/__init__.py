"""Cycles: moves, grasps, releases and waits in order, as fast as possible together."""

from armdyn.lazy import facade

__getattr__, __dir__, __all__ = facade(__name__, __file__)
