"""Bang-bang extremals by multiple shooting on the switching times.

Unknown are ρ(0), the y at which every later arc starts, and the arcs' durations; the equations say that arcs
join, that the switching function of the joint that switches is zero there, that the last arc ends in the goal,
and that H is zero. They are as many as the unknowns, and Newton's method solves them to rounding (Bulirsch 1971;
Stoer and Bulirsch, Introduction to Numerical Analysis, section 7.3.5). Arcs are integrated by Dormand-Prince
8(5,3), all at once, together with their variational equations, whose right-hand sides CasADi derives: the
Jacobian is as accurate as the residual.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from armdyn.optimal.arcs.arc import Arc, Mode
from armdyn.optimal.indirect.canonical import CanonicalSystem, sampled
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop

Array = NDArray[np.float64]

_RTOL = 1e-12
"""Of the integrator: durations are to hold to 1e-10."""
_ROUGH, _NEAR = 1e-8, 1e-4
"""The same until the residual is below the second number: it takes a third of the steps."""
_NEWTON_STEPS = 30
_SHORTEST_STEP = 2.0**-7
_ROUNDS = 5
"""Of a structure that is corrected by the signs of S."""
_SAMPLES = 48
"""Per arc, on which the signs of S are looked at and which the answer has."""


@dataclass(frozen=True, eq=False)
class BangBang:
    """Arcs and the states and costates along them.

    Attributes:
        arcs: durations [s] and modes, each Mode.UPPER or Mode.LOWER.
        switches: the joint that switches after each arc but the last.
        starts: y where the arcs start, shape (arcs, 4 nv).
        status: SOLVED, or why not.
        message: the same for people.
        residual: of the scaled equations, largest.
        t: times of the samples [s], shape (arcs, k); a joint of two arcs is in both.
        y: there, shape (arcs, k, 4 nv).
        wrong_sign: what H could still fall by if one torque went to its other limit, at worst of the samples.
    """

    arcs: tuple[Arc, ...]
    switches: tuple[int, ...]
    starts: Array
    status: Status = Status.FAILED
    message: str = ""
    residual: float = np.inf
    t: Array = field(default_factory=lambda: np.empty((0, 0)))
    y: Array = field(default_factory=lambda: np.empty((0, 0, 0)))
    wrong_sign: float = np.inf

    @property
    def duration(self) -> float:
        """t_f [s]."""
        return sum(arc.duration for arc in self.arcs)


@dataclass(frozen=True, eq=False)
class ShootingProblem:
    """What is to be solved.

    Attributes:
        system: the canonical system.
        x_start: (q, v) at the start, shape (2 nv,).
        x_goal: (q, v) at the end, shape (2 nv,).
        lower: torque limits [N m], shape (nv,).
        upper: likewise.
        tolerance: of the scaled equations.
        stop: asked at every evaluation.
    """

    system: CanonicalSystem
    x_start: Array
    x_goal: Array
    lower: Array
    upper: Array
    tolerance: float
    stop: Stop

    def torques(self, arcs: Sequence[Arc]) -> Array:
        """Of every arc [N m], shape (arcs, nv)."""
        upper = np.array([[mode is Mode.UPPER for mode in arc.modes] for arc in arcs])
        return np.where(upper, self.upper, self.lower)


def guess_arcs(problem: ShootingProblem, t: Array, y: Array) -> BangBang:
    """The structure that the signs of S say, along an extremal of about minimum time.

    Args:
        problem: whose system and limits are used.
        t: times [s], increasing, shape (m,).
        y: there, shape (4 nv, m).
    """
    n = problem.system.nv
    values = sampled(problem.system.switching, y)[0][:, 0]
    modes = [Mode.UPPER if row[0] < 0 else Mode.LOWER for row in values]
    events: list[tuple[float, int]] = []
    for i in range(n):
        for k in np.flatnonzero(np.signbit(values[i, 1:]) != np.signbit(values[i, :-1])):
            share = values[i, k] / (values[i, k] - values[i, k + 1])
            events.append((float(t[k] + share * (t[k + 1] - t[k])), i))
    events.sort()
    arcs, begin = [], float(t[0])
    for at, i in events:
        arcs.append(Arc(at - begin, tuple(modes)))
        modes[i] = Mode.LOWER if modes[i] is Mode.UPPER else Mode.UPPER
        begin = at
    arcs.append(Arc(float(t[-1]) - begin, tuple(modes)))
    at_starts = [float(t[0]), *(at for at, _ in events)]
    starts = np.array([np.interp(at_starts, t, row) for row in y]).T
    return BangBang(tuple(arcs), tuple(i for _, i in events), starts)


def shoot(problem: ShootingProblem, guess: BangBang) -> BangBang:
    """Newton's method on the durations, then the signs of S; where they object, again with what they say.

    Args:
        problem: what is to be solved.
        guess: its arcs and their starts.
    """
    found = guess
    for _ in range(_ROUNDS):
        found = _sample(problem, _newton(problem, found))
        # S is zero at its switches up to the tolerance of the equations.
        if found.status is not Status.SOLVED or found.wrong_sign <= 1e3 * problem.tolerance:
            return found
        knots = np.concatenate([found.t[:, :-1].ravel(), found.t[-1, -1:]])
        y = np.concatenate([found.y[:, :-1].reshape(-1, found.y.shape[2]), found.y[-1, -1:]])
        again = guess_arcs(problem, knots, y.T)
        if [arc.modes for arc in again.arcs] == [arc.modes for arc in found.arcs]:
            break
        found = again
    message = f"{found.message}; a switching function has the wrong sign by {found.wrong_sign:.2g} (of H)"
    return replace(found, status=Status.FAILED, message=message)


def _newton(problem: ShootingProblem, guess: BangBang) -> BangBang:
    system, n, m = problem.system, problem.system.nv, len(guess.arcs)
    tau = problem.torques(guess.arcs)
    peaks = np.max(np.abs(guess.starts).reshape(m, 4, n), axis=(0, 2))
    reach = np.max(np.abs(np.concatenate([problem.x_start, problem.x_goal])).reshape(2, 2, n), axis=(0, 2))
    scale = np.repeat(np.maximum(peaks, [*np.maximum(reach, 1e-3), 1e-9, 1e-9]), n)
    time = guess.duration
    starts, lengths = guess.starts / scale, np.array([arc.duration for arc in guess.arcs]) / time
    starts[0, : 2 * n] = problem.x_start / scale[: 2 * n]

    def equations(starts: Array, lengths: Array, rtol: float) -> tuple[Array, Array]:
        """Residual, shape (4 n m + m,) less the known start, and its Jacobian."""
        ends, by_start = _integrate(problem, starts * scale, lengths * time, tau, rtol)
        rates = sampled(system.flow, ends.T, tau.T)[0][:, 0].T * time / scale
        by_start = by_start * scale / scale[:, None]
        size = 4 * n
        block = (m - 1) * size
        rows = block + 2 * n + m
        residual, jacobian = np.zeros(rows), np.zeros((rows, m * size + m))
        for a in range(m):
            own, at = slice(a * size, (a + 1) * size), a * size
            kept = size if a < m - 1 else 2 * n
            to = starts[a + 1] if a < m - 1 else problem.x_goal / scale[: 2 * n]
            residual[at : at + kept] = (ends[a] / scale)[:kept] - to
            jacobian[at : at + kept, own] = by_start[a][:kept]
            jacobian[at : at + kept, m * size + a] = rates[a][:kept]
            if a < m - 1:
                after = slice(at + size, at + 2 * size)
                jacobian[at : at + size, after] -= np.eye(size)
                i = guess.switches[a]
                value, slope = (x.full() for x in system.switching(starts[a + 1] * scale))
                bound = problem.upper[i] - problem.lower[i]
                residual[block + 2 * n + a] = value[i, 0] * bound
                jacobian[block + 2 * n + a, after] = slope[i] * scale * bound
        # H is constant: it is asked where it costs no integration.
        value, slope = (x.full() for x in system.hamiltonian(starts[0] * scale, tau[0], 0.0))
        residual[-1] = value.item()
        jacobian[-1, :size] = slope[0] * scale
        return residual, jacobian[:, 2 * n :]  # the start is known

    status, reason = Status.ITERATION_LIMIT, f"no convergence in {_NEWTON_STEPS} Newton steps"
    rtol = _ROUGH
    residual, jacobian = equations(starts, lengths, rtol)
    for _ in range(_NEWTON_STEPS):
        if np.max(np.abs(residual)) <= _NEAR and rtol > _RTOL:
            rtol = _RTOL
            residual, jacobian = equations(starts, lengths, rtol)
        if np.max(np.abs(residual)) <= problem.tolerance:
            status, reason = Status.SOLVED, "Newton's method on the switching times converged"
            break
        if problem.stop:
            status = Status.INTERRUPTED if problem.stop.interrupted else Status.TIME_LIMIT
            reason = status.replace("_", " ")
            break
        try:
            step = np.linalg.solve(jacobian, -residual)
        except np.linalg.LinAlgError:
            status, reason = Status.FAILED, "the Jacobian of the switching times is singular"
            break
        d_starts = np.concatenate([np.zeros(2 * n), step[:-m]]).reshape(m, -1)
        shrink = -step[-m:] / lengths
        length = min(1.0, 0.9 / max(float(np.max(shrink)), 1e-9))  # durations stay positive
        while length >= _SHORTEST_STEP:
            tried = starts + length * d_starts, lengths + length * step[-m:]
            after, slope = equations(*tried, rtol)
            if np.linalg.norm(after) < (1 - length / 10) * np.linalg.norm(residual):
                break
            length /= 2
        else:
            status, reason = Status.FAILED, "Newton's method on the switching times is stuck"
            break
        (starts, lengths), residual, jacobian = tried, after, slope
    arcs = tuple(replace(arc, duration=float(d) * time) for arc, d in zip(guess.arcs, lengths, strict=True))
    worst = float(np.max(np.abs(residual)))
    message = f"{reason}; {m} arcs, largest residual {worst:.2g}"
    return BangBang(arcs, guess.switches, starts * scale, status, message, worst)


def _integrate(problem: ShootingProblem, starts: Array, lengths: Array, tau: Array, rtol: float) -> tuple[Array, Array]:
    """Ends of all arcs, shape (m, 4 nv), and their derivatives by the starts, shape (m, 4 nv, 4 nv)."""
    m, size = starts.shape
    scale = np.maximum(np.max(np.abs(starts), axis=0), 1e-9)

    def rate(s: float, flat: Array) -> Array:
        both = flat.reshape(m, size, size + 1)
        flow, by_y = sampled(problem.system.flow_jacobian, both[:, :, 0].T, tau.T)
        out = np.empty_like(both)
        out[:, :, 0] = flow[:, 0].T
        out[:, :, 1:] = by_y.transpose(2, 0, 1) @ both[:, :, 1:]
        return (out * lengths[:, None, None]).ravel()

    first = np.concatenate([starts[:, :, None], np.broadcast_to(np.eye(size), (m, size, size))], axis=2)
    size_of = np.concatenate([scale[:, None], scale[:, None] / scale], axis=1)
    tolerance = np.broadcast_to(size_of, (m, size, size + 1)).ravel() * rtol
    run = solve_ivp(rate, (0, 1), first.ravel(), "DOP853", rtol=rtol, atol=tolerance, t_eval=[1.0])
    end = run.y[:, -1] if run.success else np.full(first.size, np.nan)
    both = end.reshape(m, size, size + 1)
    return both[:, :, 0], both[:, :, 1:]


def _sample(problem: ShootingProblem, found: BangBang) -> BangBang:
    """The same with samples along the arcs and the worst sign of S there."""
    tau, m, size = problem.torques(found.arcs), *found.starts.shape
    lengths = np.array([arc.duration for arc in found.arcs])

    def rate(s: float, flat: Array) -> Array:
        flow = sampled(problem.system.flow, flat.reshape(m, size).T, tau.T)[0][:, 0]
        return np.asarray((flow * lengths).T.ravel())

    s = np.linspace(0, 1, _SAMPLES)
    run = solve_ivp(rate, (0, 1), found.starts.ravel(), "DOP853", rtol=_RTOL, atol=1e-2 * _RTOL, t_eval=s)
    if not run.success:
        return replace(found, status=Status.FAILED, message="an arc cannot be integrated")
    y = run.y.reshape(m, size, -1).transpose(0, 2, 1)
    begins = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    values = sampled(problem.system.switching, y.reshape(-1, size).T)[0][:, 0].T.reshape(m, s.size, -1)
    # Toward the other limit H changes by S times the way there.
    gain = values * (tau - (problem.lower + problem.upper - tau))[:, None]
    return replace(found, t=begins[:, None] + lengths[:, None] * s, y=y, wrong_sign=max(0.0, float(np.max(gain))))
