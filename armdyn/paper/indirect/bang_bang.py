"""Bang-bang extremals: arcs on which every torque is at a limit, with states and costates along them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.integrate import solve_ivp

from armdyn.arrays import Array
from armdyn.optimal.problem.status import Status, Stop
from armdyn.optimal.verify.arc import Arc, Mode
from armdyn.paper.indirect.canonical import CanonicalSystem, columns

RTOL = 1e-12
"""Tolerance of the integrator: durations are to hold to 1e-10."""
_SAMPLES = 48
"""Samples per arc, for the signs of S and in the solution."""


@dataclass(frozen=True, eq=False)
class BangBangProblem:
    """Bang-bang problem.

    Attributes:
        system: the canonical system.
        x_start: (q, v) at the start, shape (2 nv,).
        x_goal: (q, v) at the end, shape (2 nv,).
        lower: torque limits [N m], shape (nv,).
        upper: likewise.
        tolerance: of the scaled equations.
        stop: polled before every step of Newton's method.
    """

    system: CanonicalSystem
    x_start: Array
    x_goal: Array
    lower: Array
    upper: Array
    tolerance: float
    stop: Stop

    def torques(self, arcs: Sequence[Arc]) -> Array:
        """Torques of every arc [N m], shape (arcs, nv)."""
        upper = np.array([[mode is Mode.UPPER for mode in arc.modes] for arc in arcs])
        return np.where(upper, self.upper, self.lower)


@dataclass(frozen=True, eq=False)
class BangBangExtremal:
    """Arcs and the states and costates along them; or a guess of them.

    Attributes:
        arcs: durations [s] and modes, each Mode.UPPER or Mode.LOWER, or Mode.PASSIVE.
        switches: the joint that switches after each arc but the last.
        starts: y where the arcs start, shape (arcs, 4 nv).
        status: SOLVED, or why not.
        message: the status in words.
        residual: of the scaled equations, largest.
        t: times of the samples [s], shape (arcs, k); one at which two arcs join is in both.
        y: there, shape (arcs, k, 4 nv).
        wrong_sign: largest decrease of H at a sample if one torque went to its other limit.
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
    def lengths(self) -> Array:
        """Durations of the arcs [s], shape (arcs,)."""
        return np.array([arc.duration for arc in self.arcs])

    @property
    def duration(self) -> float:
        """t_f [s]."""
        return sum(arc.duration for arc in self.arcs)

    @property
    def path(self) -> tuple[Array, Array]:
        """All samples, each time once: times [s], shape (m,), and y, shape (4 nv, m)."""
        t = np.concatenate([self.t[:, :-1].ravel(), self.t[-1, -1:]])
        y = np.concatenate([self.y[:, :-1].reshape(-1, self.y.shape[2]), self.y[-1, -1:]])
        return t, y.T


def guess_arcs(problem: BangBangProblem, t: Array, y: Array) -> BangBangExtremal:
    """Structure by the signs of S, along an extremal of about minimum time.

    Args:
        problem: whose system is used.
        t: times [s], increasing, shape (m,).
        y: there, shape (4 nv, m).
    """
    values = columns(problem.system.switching, y)[0][:, 0]
    passive = problem.lower == problem.upper  # no sign of S moves its torque
    values = np.where(passive[:, None], 0.0, values)
    modes = [Mode.UPPER if row[0] < 0 else Mode.LOWER for row in values]
    modes = [Mode.PASSIVE if idle else mode for mode, idle in zip(modes, passive, strict=True)]
    events = _sign_changes(t, values)
    arcs, begin = [], float(t[0])
    for at, i in events:
        arcs.append(Arc(at - begin, tuple(modes)))
        modes[i] = Mode.LOWER if modes[i] is Mode.UPPER else Mode.UPPER
        begin = at
    arcs.append(Arc(float(t[-1]) - begin, tuple(modes)))
    at_starts = [float(t[0]), *(at for at, _ in events)]
    starts = np.array([np.interp(at_starts, t, row) for row in y]).T
    return BangBangExtremal(tuple(arcs), tuple(i for _, i in events), starts)


def _sign_changes(t: Array, values: Array) -> list[tuple[float, int]]:
    """Times [s] and rows of the sign changes of lines between samples, in order of time."""
    events: list[tuple[float, int]] = []
    for i, row in enumerate(values):
        for k in np.flatnonzero(np.signbit(row[1:]) != np.signbit(row[:-1])):
            share = row[k] / (row[k] - row[k + 1])
            events.append((float(t[k] + share * (t[k + 1] - t[k])), i))
    return sorted(events)


def with_samples(problem: BangBangProblem, found: BangBangExtremal) -> BangBangExtremal:
    """Sample an extremal along its arcs, with the worst sign of S there.

    Args:
        problem: the minimum-time problem.
        found: of which arcs and their starts count.
    """
    tau, m, size = problem.torques(found.arcs), *found.starts.shape
    lengths = found.lengths

    def rate(s: float, flat: Array) -> Array:
        flow = columns(problem.system.flow, flat.reshape(m, size).T, tau.T)[0][:, 0]
        return np.asarray((flow * lengths).T.ravel())

    s = np.linspace(0, 1, _SAMPLES)
    run = solve_ivp(rate, (0, 1), found.starts.ravel(), "DOP853", rtol=RTOL, atol=1e-2 * RTOL, t_eval=s)
    if not run.success:
        return replace(found, status=Status.FAILED, message="an arc cannot be integrated")
    y = run.y.reshape(m, size, -1).transpose(0, 2, 1)
    begins = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    values = columns(problem.system.switching, y.reshape(-1, size).T)[0][:, 0].T.reshape(m, s.size, -1)
    # Toward the other limit H changes by S times the way there.
    gain = values * (tau - (problem.lower + problem.upper - tau))[:, None]
    return replace(found, t=begins[:, None] + lengths[:, None] * s, y=y, wrong_sign=max(0.0, float(np.max(gain))))
