"""Stagewise solver: the condensed program of an arm on a mesh, solved by the C library."""

import ctypes
from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.program.condensed import has_condensed
from armdyn.optimal.program.layout import CondensedLayout, Layout
from armdyn.optimal.solve.ipopt import STATUS
from armdyn.optimal.solve.solver import NlpData, NlpResult
from armdyn.optimal.solve.stagewise.library import MONITOR, Settings, stagewise_library
from armdyn.optimal.task.options import SolverSettings
from armdyn.optimal.task.tableau import Scheme

_POLL = 10
"""Iterations between polls of the stopping condition: half a millisecond; taking Python's lock may wait for threads."""
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
        layout: layout of the unknowns, equations and parameters.
        intervals: number of intervals.
        settings: tolerance, iteration limit, barrier, push, verbosity.
    """

    library: ctypes.CDLL
    layout: CondensedLayout
    intervals: int
    settings: SolverSettings

    @classmethod
    def of(cls, dynamics: Dynamics, scheme: Scheme, intervals: int, settings: SolverSettings) -> Self | None:
        """Set up the method; None if the scheme does not fit or no library is available; see `compiled_library`.

        Args:
            dynamics: dynamics with a symbolic last body.
            scheme: transcription scheme.
            intervals: number of intervals.
            settings: tolerance, iteration limit, barrier, push, verbosity.
        """
        if not has_condensed(scheme) or scheme.control != "constant":
            return None
        library = stagewise_library(dynamics, scheme.compile)
        if library is None:
            return None
        return cls(library, CondensedLayout(Layout(dynamics.nv, scheme)), intervals, settings)

    def solve(self, data: NlpData, stop: Stop, middles: tuple[Array, Array] | None = None) -> NlpResult:
        """Solve one program.

        Args:
            data: the program in numbers; first and last state have equal bounds, all equations are zero.
            stop: stopping condition, polled every few iterations.
            middles: lower and upper bounds of the states in the middle of the intervals, each of shape (2 nv, N); None:
                no bounds.

        Raises:
            MemoryError: out of memory.
        """
        own, size, rows, x = self.settings, len(data.x), self._equations, data.x
        lower, upper = data.x_bounds
        if middles is not None:
            lower, upper = np.append(lower, middles[0].T), np.append(upper, middles[1].T)
        slacks = len(lower) - size
        w, z, lam, count = (
            np.append(x, np.zeros(slacks)),
            np.zeros(size + slacks),
            np.zeros(rows + slacks),
            ctypes.c_int(),
        )
        given = [np.ascontiguousarray(numbers, dtype=float) for numbers in (data.p, lower, upper)]
        raised: list[BaseException] = []

        def monitor(iteration: int, cost: float, infeasible: float, error: float, barrier: float) -> bool:
            try:
                if own.verbose:
                    print(f"{iteration:4d} {cost:14.8f} {infeasible:9.2e} {error:9.2e} {barrier:8.1e}")  # noqa: T201
                return bool(stop)
            except BaseException as failure:  # cannot pass through C: raised after its return
                raised.append(failure)
                return True

        code = self.library.solve(
            self.intervals, slacks > 0, *map(_pointer, given), ctypes.byref(self._settings),
            1 if own.verbose else _POLL, MONITOR(monitor), *map(_pointer, (w, lam, z)), ctypes.byref(count),
        )  # fmt: skip
        if raised:
            raise raised[0]
        if code == len(_STATUSES):
            raise MemoryError
        word, found = _STATUSES[code], (w[:size], z[:size], lam[:rows])
        return NlpResult.of(STATUS.get(word, Status.FAILED), word.replace("_", " "), stop, count.value, data, found)

    def equations(self, x: Array, p: Array) -> Array:
        """Values of the program's equations at unknowns and parameters."""
        return self._values(x, p)[0]

    def middles(self, x: Array, p: Array) -> Array:
        """States in the middle of the intervals, one column each, shape (2 nv, N)."""
        return self._values(x, p)[1].reshape(self.intervals, -1).T

    @property
    def _settings(self) -> Settings:
        own = self.settings
        close, still, after = 0.0, 0.0, 0
        if (accepted := own.acceptable) is not None:
            close = accepted.tolerance
            still, after = (0.0, 0) if accepted.cost is None else (accepted.cost, accepted.after)
        push = own.push or 0.0
        return Settings(own.tolerance, own.barrier, push, close, still, own.convex, own.max_iterations, after)

    @property
    def _equations(self) -> int:
        return 2 * self.layout.full.nv * self.intervals

    def _values(self, x: Array, p: Array) -> tuple[Array, Array]:
        equations, middles = np.empty(self._equations), np.empty(self._equations)
        given = [np.ascontiguousarray(numbers, dtype=float) for numbers in (p, x)]
        self.library.values_at(self.intervals, *map(_pointer, (*given, equations, middles)))
        return equations, middles


def _pointer(numbers: Array) -> int:
    return numbers.ctypes.data
