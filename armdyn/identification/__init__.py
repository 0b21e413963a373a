"""Identification: inertias, friction and payload of an arm from logs of its motions."""

from armdyn.lazy import facade

__getattr__, __dir__, __all__ = facade(__name__, __file__)
