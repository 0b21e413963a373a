"""Shim until the real one comes."""

from dataclasses import dataclass

from armdyn.optimal.arcs.grid import Density
from armdyn.optimal.arcs.phases import Array, Phases
from armdyn.optimal.arcs.phases import prepare_phases as _prepare
from armdyn.optimal.arcs.phases import solve_phases as _solve


@dataclass(frozen=True, eq=False)
class PhaseAim:
    offset: Array | float = 0.0
    near: bool = False
    density: Density | None = None
    keep: Phases | None = None


@dataclass(frozen=True)
class Unresolved:
    message: str
    iterations: int


def solve_phases(task, arcs, guess, intervals, aim=PhaseAim()):
    found = _solve(
        task.problem,
        arcs,
        guess,
        task.dynamics,
        task.scheme,
        intervals,
        task.stop,
        aim.offset,
        aim.near,
        aim.density,
        aim.keep,
    )
    return found if found.converged else Unresolved(found.message, found.iterations)


def prepare_phases(task, intervals):
    _prepare(task.dynamics, task.scheme, intervals)
