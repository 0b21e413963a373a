"""Stagewise interior-point method of the search, in C: compiled for an arm, and called."""

import ctypes
from dataclasses import dataclass
from importlib.resources import files
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.codegen.compiled import compiled_library
from armdyn.codegen.lanes import UnwrittenError, in_lanes, prelude, table
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.optimal.mesh.ipopt import POLL, STATUS, NlpData, NlpResult
from armdyn.optimal.mesh.layout import Parameters
from armdyn.optimal.mesh.stages import StageFunctions
from armdyn.optimal.problem.options import Scheme, SolverSettings
from armdyn.optimal.problem.status import Status, Stop

_PARTS = ("dense.c", "interval.c", "riccati.c", "line_search.c", "interior_point.c")
"""The .c files, in the order of their dependence."""
_OWN = 1500
"""Equivalent size of the .c files in instructions of the arm's functions, for the estimate of the compile time."""
_HELD = 1e4
"""Weight of the held end in inertia correction: from 1e2 to 1e6 the same share of guesses converges (20 pairs, RRR)."""

_Numbers = ctypes.c_void_p
"""Address of doubles as an integer: a ctypes pointer takes 20 µs to make."""
MONITOR = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int, *[ctypes.c_double] * 4)
"""Callback: (iteration, cost, sum of constraint violations, error, barrier) to whether to stop."""


class Settings(ctypes.Structure):
    """Mirror of `Settings` in `interior_point.c`."""

    _fields_ = (
        *((name, ctypes.c_double) for name in ("tolerance", "barrier", "push", "close", "still", "convex")),
        *((name, ctypes.c_int) for name in ("iterations", "after")),
    )


@built_once(maxsize=16)
def stagewise_library(dynamics: Dynamics, compile_mode: bool | None) -> ctypes.CDLL | None:
    """Compiled library of an arm, with `solve` and `values_at` of `interior_point.c`.

    Args:
        dynamics: dynamics with a symbolic last body.
        compile_mode: mode for `compiled_library`.

    Returns:
        None without a compiler, without time, or for dynamics with an operation that has no C form.
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
            ctypes.c_int, MONITOR, _Numbers, _Numbers, _Numbers, ctypes.POINTER(ctypes.c_int),
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
        "hessian_place": [i + j * (j + 1) // 2 for i, j in zip(upper, lower, strict=True)],
    }
    return "".join(
        (
            prelude(),
            "#include <stdlib.h>\n#include <string.h>\n",
            f"enum {{ {', '.join(f'{name} = {size}' for name, size in sizes.items())} }};\n",
            f"static const double HELD = {_HELD!r};\n",
            *(table(name, numbers) for name, numbers in tables.items()),
            *(in_lanes(function) for function in one.functions),
            '#pragma GCC optimize("O3")\n',  # loops of known length: a tenth of the run time
            *(files(__package__).joinpath(part).read_text() for part in _PARTS),
        )
    )


_STATUSES = (
    "Solve_Succeeded",
    "Solved_To_Acceptable_Level",
    "Maximum_Iterations_Exceeded",
    "User_Requested_Stop",
    "Restoration_Failed",
    "Invalid_Number_Detected",
    "Search_Direction_Becomes_Too_Small",
)
"""Statuses of `solve` in C, as IPOPT names them."""


@dataclass(frozen=True, eq=False)
class Stagewise:
    """Solver of a condensed program with constant torques, interval by interval.

    Without `settings.convex` the method and its constants are IPOPT's, and the iterations and the optimum are the same
    from nearly every guess, at a tenth of the time per iteration. It is reentrant.

    Attributes:
        library: C library of the arm.
        joints: number of joints.
        intervals: number of intervals.
        settings: tolerance, iteration limit, barrier, push, verbosity.
    """

    library: ctypes.CDLL
    joints: int
    intervals: int
    settings: SolverSettings

    @classmethod
    def of(cls, dynamics: Dynamics, scheme: Scheme, intervals: int, settings: SolverSettings) -> Self | None:
        """Set up the method; None if torques are linear or no library is available; see `compiled_library`.

        Args:
            dynamics: dynamics with a symbolic last body.
            scheme: transcription scheme.
            intervals: number of intervals.
            settings: tolerance, iteration limit, barrier, push, verbosity.
        """
        if scheme.control != "constant":
            return None
        library = stagewise_library(dynamics, scheme.compile)
        if library is None:
            return None
        return cls(library, dynamics.nv, intervals, settings)

    def solve(self, data: NlpData, stop: Stop, middles: tuple[Array, Array] | None = None) -> NlpResult:
        """Solve one program.

        Args:
            data: the program in numbers; first and last state have equal bounds, all equations are zero.
            stop: stopping condition, polled every few iterations.
            middles: lower and upper bounds of the states in the middle of the intervals, each of shape (N, 2 nv); None:
                no bounds.

        Raises:
            MemoryError: out of memory.
        """
        size, rows, x = len(data.x), 2 * self.joints * self.intervals, data.x
        lower, upper = data.x_bounds
        if middles is not None:
            lower, upper = np.append(lower, middles[0]), np.append(upper, middles[1])
        slacks, count = len(lower) - size, ctypes.c_int()
        w, z, lam = np.append(x, np.zeros(slacks)), np.zeros(size + slacks), np.zeros(rows + slacks)
        given = [np.ascontiguousarray(numbers, dtype=float) for numbers in (data.p, lower, upper)]
        raised: list[BaseException] = []

        def monitor(iteration: int, cost: float, infeasible: float, error: float, barrier: float) -> bool:
            try:
                return bool(stop)
            except BaseException as failure:  # cannot pass through C: raised after its return
                raised.append(failure)
                return True

        code = self.library.solve(
            self.intervals, slacks > 0, *map(_pointer, given), ctypes.byref(self._settings),
            POLL, MONITOR(monitor), *map(_pointer, (w, lam, z)), ctypes.byref(count),
        )  # fmt: skip
        if raised:
            raise raised[0]
        if code == len(_STATUSES):
            raise MemoryError
        word, found = _STATUSES[code], (w[:size], z[:size], lam[:rows])
        return NlpResult.of(STATUS.get(word, Status.FAILED), word.replace("_", " "), stop, count.value, data, found)

    def values(self, x: Array, p: Array) -> tuple[Array, Array]:
        """Defects, shape (2 nv N,), and states in the middle of the intervals, shape (N, 2 nv)."""
        equations, middles = np.empty((2, 2 * self.joints * self.intervals))
        given = [np.ascontiguousarray(numbers, dtype=float) for numbers in (p, x)]
        self.library.values_at(self.intervals, *map(_pointer, (*given, equations, middles)))
        return equations, middles.reshape(self.intervals, -1)

    @property
    def _settings(self) -> Settings:
        own = self.settings
        close, still, after = 0.0, 0.0, 0
        if (accepted := own.acceptable) is not None:
            close = accepted.tolerance
            still, after = (0.0, 0) if accepted.cost is None else (accepted.cost, accepted.after)
        push = own.push or 0.0
        return Settings(own.tolerance, own.barrier, push, close, still, own.convex, own.max_iterations, after)


def _pointer(numbers: Array) -> int:
    return numbers.ctypes.data
