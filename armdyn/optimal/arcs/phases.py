"""Solution of a multi-phase problem: durations of its arcs, the motion on them, and costates."""

from dataclasses import dataclass

from armdyn.arrays import Array, Index
from armdyn.optimal.arcs.arc import Arc
from armdyn.optimal.arcs.grid import Density
from armdyn.optimal.problem.status import Status
from armdyn.optimal.task.tableau import RADAU_5
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory

TABLEAU = RADAU_5
"""Of the arcs: motion is smooth on them, and ninth order leaves nothing to see on a few intervals."""


@brief
@dataclass(frozen=True, eq=False)
class Phases:
    """A solved multi-phase problem.

    Attributes:
        arcs: with the durations found.
        t: times of the knots [s], shape (K + 1,).
        q: positions at the knots, shape (K + 1, nv).
        v: velocities, shape (K + 1, nv).
        costate: ρ = ∂(time to go)/∂(q, v) at the knots, from the multipliers, shape (K + 1, 2 nv).
        tau: torques at the stages, shape (K, stages, nv).
        arc_of: which arc an interval is in, shape (K,).
        stage_q: positions at the stages, shape (K, stages, nv).
        stage_v: velocities at the stages, shape (K, stages, nv).
        stage_costate: ∫ρ over each stage's share of the time, shape (K, stages, 2 nv): what multiplies a
            change of the rates there.
        torque_multiplier: ∂t_f/∂tau at the stages [s/(N m)], shape (K, stages, nv); 0 where it is free.
        state_multiplier: the same for (q, v) at the inner stages [s/rad, s²/rad], shape (K, stages - 1, 2, nv).
        knot_multiplier: the same at the inner knots, shape (K - 1, 2, nv).
        torques: the motion over time by the collocation's polynomials, for `replay_torques` and as a guess.
        laid: what the intervals were laid by; None: the arcs' lengths.
        density: where another mesh needs its intervals; None: unknown, as of an integrator's.
        iterations: of IPOPT.
    """

    arcs: tuple[Arc, ...]
    t: Array
    q: Array
    v: Array
    costate: Array
    tau: Array
    arc_of: Index
    stage_q: Array
    stage_v: Array
    stage_costate: Array
    torque_multiplier: Array
    state_multiplier: Array
    knot_multiplier: Array
    torques: Trajectory
    laid: Density | None = None
    density: Density | None = None
    iterations: int = 0

    @property
    def duration(self) -> float:
        """t_f [s]."""
        return float(self.t[-1])


@dataclass(frozen=True, eq=False)
class Unresolved:
    """Phases that did not converge.

    Attributes:
        message: IPOPT's word for it.
        status: the same as a `Status`.
        iterations: of IPOPT.
        last: where it stood: no solution, at best a guess of one.
    """

    message: str
    status: Status
    iterations: int
    last: Phases
