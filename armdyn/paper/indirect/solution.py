"""Options and solution of `solve_indirect`, and the comparison with the direct method."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

from armdyn.arguments import expect, flag, number, one_of, shown, whole
from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.optimal.problem.options import MAX_STARTS
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.verify.arc import Arc
from armdyn.optimal.verify.costates import Costates
from armdyn.optimal.verify.within_limits import excesses
from armdyn.paper.indirect.bang_bang import BangBangExtremal, BangBangProblem
from armdyn.paper.indirect.boundary import BoundaryExtremal, BoundaryProblem
from armdyn.paper.indirect.canonical import columns
from armdyn.paper.indirect.law import MINIMUM, TorqueLaw
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory

Method = Literal["lobatto", "trapezoidal"]
METHODS: tuple[Method, ...] = ("lobatto", "trapezoidal")

_LIMIT_SLACK = 1e-6
"""Excess over a position or velocity limit, as a part of it, that counts as kept."""
_INSIDE = 1e-6
"""Part of an interval by which torques are read inside it: at its ends they may jump."""


@dataclass(frozen=True, kw_only=True)
class IndirectOptions:
    """Options of `solve_indirect`.

    Attributes:
        law: the torque law: MINIMUM, which minimises H, or another `TorqueLaw`.
        method: "lobatto", three-stage Lobatto IIIA on a mesh that adapts, of order 4; or "trapezoidal",
            finite differences on an even mesh, of order 2.
        bounded: keep the torque limits (saturated law); or have none.
        tolerance: of the boundary value problem's residual (lobatto) or of its equations (trapezoidal).
        intervals: of the trapezoidal mesh.
        max_nodes: of the Lobatto mesh.
        starts: guesses of the search that makes a seed; None: as many as the direct method's.
        seed: of the guesses after the first.
        continuations: number of found optima that are followed to minimum time; the fastest is returned.
        time_limit: wall time [s].
    """

    law: TorqueLaw = MINIMUM
    method: Method = "lobatto"
    bounded: bool = True
    tolerance: float = 1e-6
    intervals: int = 200
    max_nodes: int = 3000
    starts: int | None = None
    seed: int = 0
    continuations: int = 6
    time_limit: float = 60.0

    def __post_init__(self) -> None:
        if not isinstance(self.law, TorqueLaw):
            raise ProblemError(
                f"law is {shown(self.law)}; it must be a value of the class Law, not a name: "
                "armdyn.paper.indirect.MINIMUM, or one like it (see docs/indirect.md)"
            )
        one_of(self.method, METHODS, "method")
        flag(self.bounded, "bounded")
        for name in ("intervals", "max_nodes", "continuations"):
            whole(getattr(self, name), name, least=1)
        if self.starts is not None:
            whole(self.starts, "starts", least=1, most=MAX_STARTS)
        whole(self.seed, "seed", least=0)
        for name in ("tolerance", "time_limit"):
            number(getattr(self, name), name, sign="positive", finite=False)


@brief
@dataclass(frozen=True, eq=False)
class IndirectSolution:
    """An extremal: a motion with costates.

    Attributes:
        success: converged, within position and velocity limits.
        status: SOLVED; INFEASIBLE if it leaves limits outside the equations; or the failure's status.
        message: the status in words, with the place of the largest residual.
        problem: the minimum-time problem.
        options: how.
        duration: t_f [s]; of the last iterate if the solve failed.
        cost: J = ∫ (1 + w/2 τᵀτ) dt [s].
        trajectory: the motion at the knots; the last iterate if the solve failed.
        costates: ρ = (ρ_q, ρ_v) at the trajectory's times, shape (n, 2 nv): [s/rad], [s²/rad], or per metre.
        hamiltonian: H at the trajectory's times, shape (n,), the 1 that time costs among its terms.
        hamiltonian_spread: largest |H|; 0 at an optimum.
        residual: largest of the equations that were solved, scaled.
        arcs: for minimum time, the active limit of every joint and the durations; else empty.
        direct: the direct method's solution that it was seeded with, if its costates are known.
        solve_time: wall time [s].
    """

    success: bool
    status: Status
    message: str
    problem: MinimumTimeProblem
    options: IndirectOptions
    duration: float
    cost: float
    trajectory: Trajectory
    costates: Array
    hamiltonian: Array
    hamiltonian_spread: float
    residual: float
    arcs: tuple[Arc, ...] = ()
    direct: Costates | None = None
    solve_time: float = 0.0


@dataclass(frozen=True, eq=False)
class ExtremalSamples:
    """An extremal and its solution, before the check of limits outside its equations.

    Attributes:
        t: times [s], shape (m,).
        y: (q, v, ρ_q, ρ_v) there, shape (m, 4 nv).
        tau: torques there [N m], shape (m, nv).
        hamiltonian: H there, shape (m,).
        cost: J [s].
        status: of the equations.
        message: of the equations.
        residual: of the equations.
    """

    t: Array
    y: Array
    tau: Array
    hamiltonian: Array
    cost: float
    status: Status
    message: str
    residual: float


def from_extremal(
    problem: MinimumTimeProblem,
    boundary: BoundaryProblem,
    found: BoundaryExtremal,
    options: IndirectOptions,
    direct: Costates | None,
) -> IndirectSolution:
    """The solution of an extremal, converged or not.

    Args:
        problem: the minimum-time problem.
        boundary: the solved problem; its law and weight give the torque.
        found: the extremal.
        options: how.
        direct: its seed.
    """
    if not (found.duration > 0 and np.all(np.isfinite(found.y))):  # nothing to show but where it began
        guess = boundary.guess
        found = replace(found, s=guess.s, y=guess.y, duration=guess.duration)
    tau = columns(boundary.system.torque, found.y, *boundary.constants)[0][:, 0]
    hamiltonian = columns(boundary.system.hamiltonian, found.y, tau, np.array([boundary.weight]))[0][0, 0]
    t = found.s * found.duration
    message = found.message
    if options.law.remark and found.status is Status.SOLVED:
        message += f"; H varies by {np.ptp(hamiltonian):.3g}: {options.law.remark}"
    squares = CubicSpline(t, np.sum(tau**2, axis=0)).integrate(0, found.duration)
    cost = float(found.duration + problem.effort_weight / 2 * squares)
    samples = ExtremalSamples(t, found.y.T, tau.T, hamiltonian, cost, found.status, message, found.residual)
    return checked(problem, options, samples, direct)


def from_arcs(
    problem: MinimumTimeProblem,
    shooting: BangBangProblem,
    found: BangBangExtremal,
    options: IndirectOptions,
    direct: Costates | None,
) -> IndirectSolution:
    """The solution of converged arcs; a jump of the torque is two samples one ulp apart.

    Args:
        problem: the minimum-time problem.
        shooting: the solved arcs.
        found: the arcs.
        options: how.
        direct: its seed.
    """
    t = found.t.copy()
    t[:-1, -1] = np.nextafter(t[1:, 0], 0)
    tau = np.repeat(shooting.torques(found.arcs), t.shape[1], axis=0)
    y = found.y.reshape(t.size, -1)
    hamiltonian = columns(shooting.system.hamiltonian, y.T, tau.T, np.zeros(1))[0][0, 0]
    samples = ExtremalSamples(
        t.ravel(), y, tau, hamiltonian, found.duration, found.status, found.message, found.residual
    )
    return replace(checked(problem, options, samples, direct), arcs=found.arcs)


def checked(
    problem: MinimumTimeProblem, options: IndirectOptions, samples: ExtremalSamples, direct: Costates | None
) -> IndirectSolution:
    """The solution, if it keeps the limits on position and velocity that went into no equation.

    Args:
        problem: the minimum-time problem.
        options: how.
        samples: the extremal.
        direct: its seed.
    """
    n = problem.robot.nv
    robot, t, q, v = problem.robot, samples.t, samples.y[:, :n], samples.y[:, n : 2 * n]
    motion = Trajectory(t, q, v, samples.tau, robot.joint_names, "indirect", robot.model_hash)
    status, message = samples.status, samples.message
    if status is Status.SOLVED and (left := _limit_left(problem, motion)):
        status, message = Status.INFEASIBLE, f"{left}: the canonical system knows torque limits only"
    return IndirectSolution(
        success=status is Status.SOLVED,
        status=status,
        message=f"{t[-1]:.9g} s; {message}",
        problem=problem,
        options=options,
        duration=float(t[-1]),
        cost=samples.cost,
        trajectory=motion,
        costates=samples.y[:, 2 * n :],
        hamiltonian=samples.hamiltonian,
        hamiltonian_spread=float(np.max(np.abs(samples.hamiltonian))),
        residual=samples.residual,
        direct=direct,
    )


def _limit_left(problem: MinimumTimeProblem, motion: Trajectory) -> str:
    """Largest violation of a position or velocity limit, in words; "": none."""
    _, *others = excesses(problem.limits, motion, dense=1)
    excess = max(others, key=lambda one: one.share)
    if excess.share <= _LIMIT_SLACK:
        return ""
    worst = excess.worst(problem.robot)
    return f"joint {worst.joint!r} leaves its {excess.limit} by {worst.value:.2g} of it at t = {worst.time:.4g} s"


@dataclass(frozen=True)
class Comparison:
    """Differences of two solutions at equal parts of their durations, each against the peak of its kind.

    Attributes:
        duration: |difference| of t_f against t_f.
        q: largest of the positions.
        v: of the velocities.
        tau: of the torques, a millionth inside the ends of the direct method's intervals.
        costate_q: of ρ_q.
        costate_v: of ρ_v.
    """

    duration: float
    q: float
    v: float
    tau: float
    costate_q: float
    costate_v: float


def compare_with_direct(indirect: IndirectSolution, direct: Costates | None = None) -> Comparison:
    """Compare an indirect solution with a direct one.

    Args:
        indirect: one solution; between its samples costates are linear, which costs about 1e-4 of their peak.
        direct: the other, as `Solution.costates`; None: the one that seeded the first.

    Raises:
        ProblemError: an argument is no solution, or has no motion.
    """
    expect(indirect, IndirectSolution, "indirect", "the result of solve_indirect")
    direct = indirect.direct if direct is None else expect(direct, Costates, "direct", "Solution.costates")
    if direct is None:
        raise ProblemError("the indirect solution was not seeded by a direct one: give direct=")
    n, motion = direct.q.shape[1], indirect.trajectory
    stretch = indirect.duration / direct.duration
    at = motion(stretch * direct.t)
    inside = np.array([_INSIDE, 1 - _INSIDE])
    ends = direct.t[:-1, None] + np.diff(direct.t)[:, None] * inside
    costates = np.array([np.interp(stretch * direct.t, motion.t, row) for row in indirect.costates.T]).T

    def difference(found: Array, known: Array) -> float:
        return float(np.max(np.abs(found - known)) / max(np.max(np.abs(known)), 1e-300))

    return Comparison(
        duration=abs(stretch - 1),
        q=difference(at.q, direct.q),
        v=difference(at.v, direct.v),
        tau=difference(motion(stretch * ends).tau, direct.tau),
        costate_q=difference(costates[:, :n], direct.costate[:, :n]),
        costate_v=difference(costates[:, n:], direct.costate[:, n:]),
    )
