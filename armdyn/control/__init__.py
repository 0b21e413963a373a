"""Control of an arm: sampled and continuous loops, controllers, stability at the goal."""

from armdyn.lazy import facade

__getattr__, __dir__, __all__ = facade(__name__, __file__)
