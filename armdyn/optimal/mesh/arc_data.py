"""Data of the program of a structure of arcs: initial guess and bounds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.optimal.mesh.grid import Density, distribute, layered
from armdyn.optimal.mesh.layout import Layout
from armdyn.optimal.mesh.solver import NlpData
from armdyn.optimal.mesh.unknowns import Scales, bounds, to_unknowns
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.arc import HELD, POSITION, VELOCITY, Arc, Mode
from armdyn.trajectory import Trajectory

_SHORTEST = 1e-9
"""Least duration of an arc, scaled."""


@dataclass(frozen=True, eq=False)
class ArcNlpData(NlpData):
    """Initial guess, bounds and parameters of the program of some arcs.

    Attributes:
        arcs: structure of the arcs.
        scales: scales of the unknowns.
        density: density of the mesh; None: intervals in proportion to the arcs' lengths.
        arc_of: index of each interval's arc, shape (N,).
        part: part of its arc that each interval is, shape (N,).
    """

    arcs: tuple[Arc, ...]
    scales: Scales
    density: Density | None
    arc_of: Index
    part: Array

    @property
    def spare(self) -> int:
        """Number of free unknowns minus number of equations; negative if the structure is overdetermined."""
        return int(np.sum(np.less(*self.x_bounds)) - np.sum(np.equal(*self.g_bounds)))


def assemble_arcs(
    task: Task,
    arcs: Sequence[Arc],
    guess: Trajectory,
    layout: Layout,
    intervals: int,
    warm: bool = False,
    offset: Array | float = 0.0,
    density: Density | None = None,
) -> ArcNlpData:
    """Data of the nonlinear program of a structure.

    Args:
        task: the problem and its settings.
        arcs: the structure, and guesses of its durations.
        guess: initial states, at the times of the guessed durations.
        layout: layout of the program.
        intervals: number of intervals of the whole mesh.
        warm: see `solve_phases`; so offset and density.
        offset: offset of the end state from the goal, (q, v), shape (2 nv,).
        density: density of the mesh.
    """
    problem, numbers, N = task.problem, task.policy.arcs, intervals
    scales = Scales.of(problem, guess)
    durations = np.array([arc.duration for arc in arcs])
    density = density or layered(guess, problem.robot.friction, numbers)
    arc_of, part = distribute(durations, N, density, numbers.per_arc)
    x = to_unknowns(guess, layout, durations[arc_of] * part / durations.sum(), scales)
    lower, upper = bounds(problem, layout, N, scales)
    narrowed = _Narrowed(problem, layout, scales, lower, upper)
    if warm:
        narrowed.loosen(arcs, N)
    narrowed.to(arcs, arc_of)
    for bound in (lower, upper):
        bound[layout.states(N)[-1]] += offset / np.repeat([scales.length, scales.speed], layout.nv)
    times = layout.times(N)
    x[times] = np.append(durations[arc_of], durations[-1]) / scales.time
    lower[times] = _SHORTEST
    return ArcNlpData(
        arcs=tuple(arcs),
        scales=scales,
        density=density,
        arc_of=arc_of,
        part=part,
        x=np.clip(x, lower, upper),
        p=scales.parameters(part, scales.weights(problem.effort_weight), task.dynamics.last_body),
        x_bounds=(lower, upper),
        g_bounds=_equation_bounds(arcs, arc_of, layout),
    )


def _equation_bounds(arcs: Sequence[Arc], arc_of: Index, layout: Layout) -> tuple[Array, Array]:
    """Bounds of the equations: zero, but free between the durations of arcs and where 0 = 0."""
    least = np.zeros((arc_of.size, layout.rows))
    least[np.flatnonzero(np.diff(arc_of)), -1] = -np.inf  # every arc has a duration of its own
    for i in range(layout.nv):
        held = np.array([arcs[a].modes[i] in POSITION for a in arc_of.tolist()])
        least[np.ix_(held, layout.defects[:, layout.knot.q][:, i])] = -np.inf
    return least.ravel(), -least.ravel()


@dataclass(frozen=True, eq=False)
class _Narrowed:
    """Bounds, narrowed in place to the modes of the arcs."""

    problem: MinimumTimeProblem
    layout: Layout
    scales: Scales
    lower: Array
    upper: Array

    def loosen(self, arcs: Sequence[Arc], intervals: int) -> None:
        """Drop the position limits of touches, except at the touch.

        Near a touch the states of a fine mesh are so near the limit that multipliers would spread over them.
        """
        q = self.layout.knot.q
        for i, mode in {touch for arc in arcs for touch in arc.touches if touch[1] in POSITION}:
            bound, infinity = (self.upper, np.inf) if mode is Mode.POSITION_UPPER else (self.lower, -np.inf)
            for states in (self.layout.states(intervals)[1:-1], self.layout.inner_states(intervals)):
                bound[states[..., q][..., i]] = infinity

    def to(self, arcs: Sequence[Arc], arc_of: Index) -> None:
        """Fix every joint to its mode in every interval."""
        N, layout, limits = arc_of.size, self.layout, self.problem.limits
        knots, inner, torques = layout.states(N), layout.inner_states(N), layout.torques(N)
        for k in range(N):
            arc, last = arcs[arc_of[k]], k == N - 1
            for i, mode in enumerate(arc.modes):
                if mode in HELD:
                    bound = limits.actuators.upper if mode is Mode.UPPER else limits.actuators.lower
                    self._fix(torques[k, :, i], bound[i] / self.scales.effort[i])
                if k > 0 and arc_of[k - 1] != arc_of[k]:
                    self._hold(knots[k], i, mode)  # the limit is active from the knot on
                self._hold(inner[k], i, mode)
                if not last:
                    self._hold(knots[k + 1], i, mode)  # Radau's last stage is the next knot
            if not last and arc_of[k + 1] != arc_of[k]:
                for i, mode in arc.touches:
                    self._hold(knots[k + 1], i, mode)

    def _hold(self, states: Index, i: int, mode: Mode) -> None:
        """Fix joint i to its limit in states of shape (…, 2 nv)."""
        limits, q, v = self.problem.limits, states[..., self.layout.knot.q], states[..., self.layout.knot.v]
        if mode in VELOCITY:
            self._fix(v[..., i], (1 if mode is Mode.VELOCITY_UPPER else -1) * limits.velocity[i] / self.scales.speed)
        if mode in POSITION:
            bound = limits.position_upper if mode is Mode.POSITION_UPPER else limits.position_lower
            self._fix(q[..., i], bound[i] / self.scales.length)
            self._fix(v[..., i], 0.0)

    def _fix(self, places: Index, values: Array | float) -> None:
        self.lower[places] = self.upper[places] = values
