"""Time-optimal and closed-loop motion of robot arms, from a URDF."""

from armdyn.lazy import facade
from armdyn.rendering import Renderer, register_renderer


def _renderer() -> Renderer:
    from armdyn.show import values

    return values


register_renderer(_renderer)

__version__ = "0.2.0"
__getattr__, __dir__, __all__ = facade(__name__, __file__)
__all__ += ["__version__"]
