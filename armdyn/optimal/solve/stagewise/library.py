"""The method's C for an arm: its functions, written by CasADi's instructions, and the files beside this one."""

import ctypes
from importlib.resources import files

from armdyn.codegen.compiled import compiled_library
from armdyn.codegen.lanes import UnwrittenError, in_lanes, prelude, table
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.optimal.program.layout import Parameters
from armdyn.optimal.program.stages import StageFunctions

_PARTS = ("interval.c", "dense.c", "riccati.c", "line_search.c", "interior_point.c")
"""In the order in which they build on each other."""
_OWN = 1500
"""About as many instructions as an arm's function are what the compiler makes of these."""
_HELD = 1e4
"""Weight that judges curvature at the held end: from 1e2 to 1e6 the same share of guesses converges (20 pairs, RRR)."""

_Numbers = ctypes.c_void_p
"""Address of doubles, as numpy gives it: to make a pointer of it takes 20 µs."""
WATCH = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int, *[ctypes.c_double] * 4)
"""(iteration, cost, sum of the equations' errors, error, barrier) to whether to stop."""


class Settings(ctypes.Structure):
    """`Settings` of `interior_point.c`."""

    _fields_ = (
        *((name, ctypes.c_double) for name in ("tolerance", "barrier", "push", "close", "still", "convex")),
        *((name, ctypes.c_int) for name in ("iterations", "after")),
    )


@built_once(maxsize=16)
def stagewise_library(dynamics: Dynamics, compile_mode: bool | None) -> ctypes.CDLL | None:
    """The library of an arm, with `solve` and `values_at` as `interior_point.c` says.

    Args:
        dynamics: with a free last body.
        compile_mode: for `compiled_library`.

    Returns:
        None: there is none, for want of a compiler, of time or of a word for what the dynamics need.
    """
    if compile_mode is False:
        return None
    one = StageFunctions.of(dynamics)
    try:
        source = _source(dynamics.nv, one)
    except UnwrittenError:
        return None
    library = compiled_library(source, sum(f.n_instructions() for f in one.functions) + _OWN, compile_mode)
    if library is not None:
        library.solve.argtypes = [
            ctypes.c_int, ctypes.c_int, _Numbers, _Numbers, _Numbers, ctypes.POINTER(Settings),
            ctypes.c_int, WATCH, _Numbers, _Numbers, _Numbers, ctypes.POINTER(ctypes.c_int),
        ]  # fmt: skip
        library.values_at.argtypes = [ctypes.c_int, *[_Numbers] * 4]
    return library


def _source(joints: int, one: StageFunctions) -> str:
    width = 5 * joints + 1
    sizes = {
        "JOINTS": joints,
        "PARAMETERS": Parameters.size(joints),
        "POINT_JACOBIAN": one.second_order.numel_out(1),
        "POINT_HESSIAN": one.second_order.numel_out(2),
        "JACOBIAN": one.jacobian.nnz(),
        "GRADIENT": one.gradient.nnz(),
        "HESSIAN": one.hessian.nnz(),
        "MIDDLE": one.middle_jacobian.nnz(),
    }
    (down, across), (upper, lower) = one.jacobian.get_triplet(), one.hessian.get_triplet()
    tables = {
        "jacobian_place": [width * i + j for i, j in zip(down, across, strict=True)],
        "middle_place": [width * i + j for i, j in zip(*one.middle_jacobian.get_triplet(), strict=True)],
        "gradient_place": one.gradient.get_triplet()[0],
        "hessian_place": [width * i + j for i, j in zip(upper, lower, strict=True)],
        "hessian_mirror": [width * j + i for i, j in zip(upper, lower, strict=True)],
    }
    return "".join(
        (
            prelude(),
            "#include <stdlib.h>\n#include <string.h>\n",
            f"enum {{ {', '.join(f'{name} = {size}' for name, size in sizes.items())} }};\n",
            f"static const double HELD = {_HELD!r};\n",
            *(table(name, numbers) for name, numbers in tables.items()),
            *(in_lanes(function) for function in one.functions),
            '#pragma GCC optimize("O3")\n',  # loops of known length: they are a tenth of the whole
            *(files(__package__).joinpath(part).read_text() for part in _PARTS),
        )
    )
