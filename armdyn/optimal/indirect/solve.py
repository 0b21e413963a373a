"""`solve_indirect`: the paper's second approach, equations (16) to (21), for any arm.

The canonical system of `canonical` is solved as a boundary value problem with free final time, seeded by the
direct method's states and multipliers. With a weight on effort that is all. For minimum time the weight is let
fall, each solution seeding the next, until the saturated torque shows the arcs, whose durations multiple
shooting then finds exactly. An answer satisfies Pontryagin's conditions: it is a local optimum of whatever
basin it was started in, not proven to be the best one.
"""

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.errors import ProblemError
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.arcs.arc import BANG
from armdyn.optimal.arcs.phases import Phases
from armdyn.optimal.indirect.boundary import BoundaryProblem, Extremal, solve_lobatto, solve_trapezoidal
from armdyn.optimal.indirect.canonical import CanonicalSystem, canonical_system
from armdyn.optimal.indirect.shooting import ShootingProblem, guess_arcs, shoot
from armdyn.optimal.indirect.solution import IndirectOptions, IndirectSolution, checked, from_arcs, from_extremal
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop, stopping
from armdyn.optimal.refine.smooth import smooth_optima
from armdyn.optimal.search.starts import spline
from armdyn.optimal.task.options import MinimumTimeOptions

Array = NDArray[np.float64]

_FIRST_WEIGHT, _LAST_WEIGHT, _FALL = 0.5, 2e-3, 0.25
"""Of the continuation, where full torques cost this much against the 1 of time, and from step to step."""
_ROUGH = 1e-3
"""Tolerance on the way to minimum time: good enough to see the arcs."""
_ROUGH_NODES = 1000
_WIDER = 10.0
"""Limits of a seed without limits, against the problem's."""
_SHOT = 1e-10
"""Tolerance of the shooting equations: durations then hold to about as much."""
_STARTS = {1: 1, 2: 6}
_MORE_STARTS = 16
_CANDIDATES = 6
"""Optima of the search that are tried until one is confirmed: some, the best above all, are artefacts of the mesh."""


@dataclass(frozen=True)
class _Seed:
    """An extremal, or nearly, of some weight."""

    extremal: Extremal
    weight: float
    direct: Phases | None


def solve_indirect(
    problem: MinimumTimeProblem, seed: Solution | None = None, options: IndirectOptions | None = None
) -> IndirectSolution:
    """Pontryagin's conditions, solved as equations.

    A time-energy answer is the optimum of least J among those that the search found and the boundary value
    problem confirmed; a minimum-time answer the fastest of those that they lead to as w → 0.

    Args:
        problem: effort_weight > 0 asks for the time-energy optimum, 0 for minimum time. Limits on position
            and velocity are looked at afterwards only.
        seed: a solution of this problem by the direct method, or of one with another weight; None: a few
            guesses are solved by the direct method first.
        options: by default, what suits arms of one to three joints.

    Returns:
        An `IndirectSolution`; look at `success`. Without it, the message says what failed, and where.

    Raises:
        ProblemError: minimum time is asked for without torque limits, the problem has conditions along the way,
            or the seed is of another arm.
    """
    options, started = options or IndirectOptions(), time.perf_counter()
    fastest = problem.effort_weight == 0 and options.law == "minimum"
    if fastest and not options.bounded:
        raise ProblemError("minimum time needs torque limits: bounded=False asks for effort_weight > 0")
    if seed is not None and seed.problem.robot.nv != problem.robot.nv:
        raise ProblemError(f"the seed moves {seed.problem.robot.nv} joints, the problem {problem.robot.nv}")
    if problem.along_the_way:
        raise ProblemError(f"the indirect method knows no {', '.join(problem.along_the_way)}")
    system = canonical_system(problem.robot, options.law)
    best: IndirectSolution | None = None
    given_up: list[str] = []
    with stopping(options.time_limit) as stop:
        seeds = _seeds(problem, seed, options, stop)
        for k, one in enumerate(seeds):
            if best is not None and (stop or (best.success and k >= (options.continuations if fastest else 1))):
                break
            found = (_minimum_time if fastest else _time_energy)(problem, system, one, options, stop)
            if best is None or (not found.success, found.cost) < (not best.success, best.cost):
                best = found
            if not found.success:
                given_up.append(found.message)
        best = best or _no_seed(problem, options, stop)
    if best.success and given_up:
        more = f"{len(given_up)} of {len(seeds)} seeds were given up, the first as: {given_up[0]}"
        best = replace(best, message=f"{best.message}; {more}")
    return replace(best, solve_time=time.perf_counter() - started)


def _seeds(problem: MinimumTimeProblem, seed: Solution | None, options: IndirectOptions, stop: Stop) -> list[_Seed]:
    """What there is to start from, the likeliest first."""
    if seed is not None and seed.phases is not None and options.law == "minimum":
        return [_Seed(_extremal(seed.phases), seed.problem.effort_weight, seed.phases)]
    dynamics, scheme = Dynamics(problem.robot, free_last_body=True), MinimumTimeOptions().scheme(problem.robot.nv)
    weight = _seed_weight(problem, options)
    wider, limits = 1.0 if options.bounded else _WIDER, problem.limits
    bound = wider * limits.effort_lower, wider * limits.effort_upper
    smooth = problem.variant(effort_weight=weight, effort_limit=bound)
    if seed is not None:
        near = resolve(smooth, seed.trajectory, dynamics, scheme, stop)
        found = [near if isinstance(near, Phases) else near.last]  # a guess all the same
    else:
        starts = options.starts or _STARTS.get(problem.robot.nv, _MORE_STARTS)
        most = max(_CANDIDATES, options.continuations)
        found = list(smooth_optima(smooth, dynamics, scheme, starts, options.seed, most, stop).optima)
    return [_Seed(_extremal(phases), weight, phases) for phases in found]


def _seed_weight(problem: MinimumTimeProblem, options: IndirectOptions) -> float:
    """The weight of the time-energy problem whose optimum is nearest."""
    if options.law == "printed":
        # τ = −D⁻¹ρ_v is the law of w = 1; (19), which lacks the factor k = 1/D, that of w = k.
        one = problem.robot.nv == 1
        return 1 / float(Dynamics(problem.robot).crba(problem.q_start)[0, 0]) if one else 1.0
    return problem.effort_weight or _FIRST_WEIGHT * _unit(problem)


def _unit(problem: MinimumTimeProblem) -> float:
    """The effort weight [1/(N m)²] with which full torques cost as much as time."""
    limits = problem.limits
    return float(2 / np.sum(np.maximum(limits.effort_upper**2, limits.effort_lower**2)))


def _extremal(phases: Phases) -> Extremal:
    return Extremal(phases.t / phases.duration, np.hstack([phases.q, phases.v, phases.costate]).T, phases.duration)


def _boundary(
    problem: MinimumTimeProblem,
    system: CanonicalSystem,
    weight: float,
    guess: Extremal,
    options: IndirectOptions,
    stop: Stop,
) -> BoundaryProblem:
    lower, upper = problem.limits.effort_lower, problem.limits.effort_upper
    if not options.bounded:
        lower, upper = np.full_like(lower, -np.inf), np.full_like(upper, np.inf)
    return BoundaryProblem(system, problem.x_start, problem.x_goal, weight, lower, upper, guess, stop)


def _time_energy(
    problem: MinimumTimeProblem, system: CanonicalSystem, seed: _Seed, options: IndirectOptions, stop: Stop
) -> IndirectSolution:
    """The boundary value problem of the problem's own weight."""
    boundary = _boundary(problem, system, problem.effort_weight, seed.extremal, options, stop)
    if options.method == "lobatto":
        found = solve_lobatto(boundary, options.tolerance, options.max_nodes)
    else:
        found = solve_trapezoidal(boundary, options.intervals, options.tolerance)
    return from_extremal(problem, boundary, found, options, seed.direct)


def _minimum_time(
    problem: MinimumTimeProblem, system: CanonicalSystem, seed: _Seed, options: IndirectOptions, stop: Stop
) -> IndirectSolution:
    """Continuation w → 0, then shooting; a seed of minimum time has that way behind it."""
    unit = _unit(problem)
    weight, last, reached = seed.weight, seed.extremal, np.inf
    while weight > 0 and reached > _LAST_WEIGHT * unit:
        boundary = _boundary(problem, system, weight, last, options, stop)
        found = solve_lobatto(boundary, _ROUGH, _ROUGH_NODES)
        if found.status is not Status.SOLVED:
            break
        last, reached, weight = found, weight, _FALL * weight
    limits = problem.limits
    shooting = ShootingProblem(
        system, problem.x_start, problem.x_goal, limits.effort_lower, limits.effort_upper, _SHOT, stop
    )
    bang = shoot(shooting, guess_arcs(shooting, last.s * last.duration, last.y))
    if bang.status is Status.SOLVED:
        return from_arcs(problem, shooting, bang, options, seed.direct)
    how = f"continuation came to w = {reached:.2g} (N m)^-2" if seed.weight > 0 else "from the seed's costates"
    modes = {mode for arc in (seed.direct.arcs if seed.direct and seed.weight == 0 else ()) for mode in arc.modes}
    if other := modes.difference(BANG):
        how += f" (whose arcs have modes that shooting does not know: {', '.join(sorted(other))})"
    failed = replace(last, status=bang.status, message=f"{how}; {bang.message}", residual=bang.residual)
    boundary = _boundary(problem, system, min(reached, _LAST_WEIGHT * unit), last, options, stop)
    return from_extremal(problem, boundary, failed, options, seed.direct)


def _no_seed(problem: MinimumTimeProblem, options: IndirectOptions, stop: Stop) -> IndirectSolution:
    status = Status.FAILED
    if stop:
        status = Status.INTERRUPTED if stop.interrupted else Status.TIME_LIMIT
    motion = spline(problem, [])
    y = np.hstack([motion.q, motion.v, np.zeros((motion.t.size, 2 * problem.robot.nv))])
    message = f"{status.replace('_', ' ')}: the direct method found nothing to start from"
    return checked(
        problem, options, status, message, motion.t, y, motion.tau, np.full(motion.t.size, np.nan),
        cost=np.inf, residual=np.inf, direct=None,
    )  # fmt: skip
