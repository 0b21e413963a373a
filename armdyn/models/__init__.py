"""Robot models: specifications, URDF, MJCF, Pinocchio models."""

from armdyn.lazy import facade

__getattr__, __dir__, __all__ = facade(__name__, __file__)
