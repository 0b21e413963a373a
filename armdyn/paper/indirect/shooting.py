"""Bang-bang extremals by multiple shooting on the switching times.

Unknown are ρ(0), the y at which every later arc starts, and the arcs' durations; the equations say that arcs
join, that the last arc ends in the goal, that the switching function of the joint that switches is zero there,
and that H is zero. They are as many as the unknowns, and Newton's method solves them to rounding (Bulirsch 1971;
Stoer and Bulirsch, Introduction to Numerical Analysis, section 7.3.5). Arcs are integrated by Dormand-Prince
8(5,3), all at once, together with their variational equations, whose right-hand sides CasADi derives: the
Jacobian is as accurate as the residual.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.integrate import solve_ivp

from armdyn.arrays import Array
from armdyn.optimal.problem.status import Status
from armdyn.paper.indirect.bang_bang import RTOL, BangBangExtremal, BangBangProblem, guess_arcs, with_samples
from armdyn.paper.indirect.canonical import columns
from armdyn.paper.indirect.newton import Point, SingularError, newton

_ROUGH, _NEAR = 1e-8, 1e-4
"""The integrator's tolerance until the residual is below the second number: it takes a third of the steps."""
_NEWTON_STEPS = 30
_SHORTEST_STEP = 2.0**-7
_ROUNDS = 5
"""Most corrections of a structure by the signs of S."""


def shoot(problem: BangBangProblem, guess: BangBangExtremal) -> BangBangExtremal:
    """Newton's method on the durations, then the signs of S; where these contradict, again with their structure.

    Args:
        problem: the minimum-time problem.
        guess: its arcs and their starts.
    """
    found = guess
    for _ in range(_ROUNDS):
        found = with_samples(problem, _solve(problem, found))
        # S is zero at its switches up to the tolerance of the equations.
        if found.status is not Status.SOLVED or found.wrong_sign <= 1e3 * problem.tolerance:
            return found
        again = guess_arcs(problem, *found.path)
        if [arc.modes for arc in again.arcs] == [arc.modes for arc in found.arcs]:
            break
        found = again
    message = f"{found.message}; a switching function has the wrong sign by {found.wrong_sign:.2g} (of H)"
    return replace(found, status=Status.FAILED, message=message)


def _solve(problem: BangBangProblem, guess: BangBangExtremal) -> BangBangExtremal:
    """Newton's method, by an integrator that is rough first."""
    equations = ShootingEquations.of(problem, guess)
    m = len(guess.arcs)
    near = newton(
        lambda unknowns: equations.at(unknowns, _ROUGH), equations.unknowns(guess),
        tolerance=_NEAR, steps=_NEWTON_STEPS, shortest=_SHORTEST_STEP, positive=m, stop=problem.stop,
    )  # fmt: skip
    root = near
    if near.status is Status.SOLVED:
        root = newton(
            lambda unknowns: equations.at(unknowns, RTOL), near.unknowns, tolerance=problem.tolerance,
            steps=_NEWTON_STEPS - near.steps, shortest=_SHORTEST_STEP, positive=m, stop=problem.stop,
        )  # fmt: skip
    starts, lengths = equations.parts(root.unknowns)
    durations = (float(length) * equations.time for length in lengths)
    worst = float(np.max(np.abs(root.residual)))
    return BangBangExtremal(
        arcs=tuple(replace(arc, duration=d) for arc, d in zip(guess.arcs, durations, strict=True)),
        switches=guess.switches,
        starts=starts * equations.scale,
        status=root.status,
        message=f"{root.reason}; switching times of {m} arcs, largest residual {worst:.2g}",
        residual=worst,
    )


@dataclass(frozen=True, eq=False)
class ShootingEquations:
    """The equations of m arcs that join, scaled.

    Unknowns, shape (4 nv m − 2 nv + m,): the arcs' starts, of the first of which (q, v) are known, one after the
    other, then the arcs' lengths. Equations, as many: every arc but the last ends where the next one starts, the
    last one in the goal; S of the joint that switches is zero; H is zero.

    Attributes:
        problem: the minimum-time problem.
        tau: torques of the arcs [N m], shape (m, nv).
        switches: the joint that switches after each arc but the last.
        scale: unit of y, shape (4 nv,).
        time: unit of the arcs' lengths [s].
    """

    problem: BangBangProblem
    tau: Array
    switches: tuple[int, ...]
    scale: Array
    time: float

    @classmethod
    def of(cls, problem: BangBangProblem, guess: BangBangExtremal) -> Self:
        """The equations of a guess's structure; its peaks, one for all joints, are the scale.

        Args:
            problem: the minimum-time problem.
            guess: its arcs and their starts.
        """
        n = problem.system.nv
        peaks = np.max(np.abs(guess.starts).reshape(-1, 4, n), axis=(0, 2))
        reach = np.max(np.abs(np.concatenate([problem.x_start, problem.x_goal])).reshape(2, 2, n), axis=(0, 2))
        scale = np.repeat(np.maximum(peaks, [*np.maximum(reach, 1e-3), 1e-9, 1e-9]), n)
        return cls(problem, problem.torques(guess.arcs), guess.switches, scale, guess.duration)

    def unknowns(self, guess: BangBangExtremal) -> Array:
        """Scaled starts and lengths of the arcs of a guess, in one vector."""
        return np.concatenate([(guess.starts / self.scale).ravel()[self._known.size :], guess.lengths / self.time])

    def parts(self, unknowns: Array) -> tuple[Array, Array]:
        """Scaled starts, shape (m, 4 nv), and lengths, shape (m,)."""
        m = len(self.tau)
        return np.concatenate([self._known, unknowns[:-m]]).reshape(m, -1), unknowns[-m:]

    def at(self, unknowns: Array, rtol: float) -> Point:
        """Residual and linear solver.

        Args:
            unknowns: where.
            rtol: of the integrator.
        """
        starts, lengths = self.parts(unknowns)
        parts = (self._joins(starts, lengths, rtol), self._switching(starts), self._hamiltonian(starts))
        residual = np.concatenate([part[0] for part in parts])
        jacobian = np.concatenate([part[1] for part in parts])[:, self._known.size :]

        def step() -> Array:
            try:
                return np.asarray(np.linalg.solve(jacobian, -residual))
            except np.linalg.LinAlgError as error:
                raise SingularError from error

        return Point(residual, step)

    @property
    def _known(self) -> Array:
        """(q, v) at the start, scaled, shape (2 nv,)."""
        x = self.problem.x_start
        return np.asarray(x / self.scale[: x.size])

    def _joins(self, starts: Array, lengths: Array, rtol: float) -> tuple[Array, Array]:
        """Defects of the arcs' ends, and their derivatives by all starts and lengths: bidiagonal, lengths last.

        [ Y_0 −1             ẏ_0         ]
        [     Y_1 −1             ẏ_1     ]
        [          …                 …   ]
        """
        scale, (m, size) = self.scale, starts.shape
        ends, by_start = _integrate(self.problem, starts * scale, lengths * self.time, self.tau, rtol)
        rates = columns(self.problem.system.flow, ends.T, self.tau.T)[0][:, 0].T * self.time / scale
        by_start = by_start * scale / scale[:, None]
        goal = self.problem.x_goal
        to = np.concatenate([starts[1:].ravel(), goal / scale[: goal.size]])
        jacobian = np.zeros((m * size, m * size + m))
        for a in range(m):
            own = slice(a * size, (a + 1) * size)
            jacobian[own, own] = by_start[a]
            jacobian[own, m * size + a] = rates[a]
            if a < m - 1:
                jacobian[own, (a + 1) * size : (a + 2) * size] = -np.eye(size)
        return (ends / scale).ravel()[: to.size] - to, jacobian[: to.size]  # the goal has no costates

    def _switching(self, starts: Array) -> tuple[Array, Array]:
        """S of the joint that switches, times its torque's jump, and by all starts and lengths."""
        m, size = starts.shape
        residual, jacobian = np.zeros(m - 1), np.zeros((m - 1, m * size + m))
        jumps = self.problem.upper - self.problem.lower
        for a, i in enumerate(self.switches):
            value, slope = (x.full() for x in self.problem.system.switching(starts[a + 1] * self.scale))
            residual[a] = value[i, 0] * jumps[i]
            jacobian[a, (a + 1) * size : (a + 2) * size] = slope[i] * self.scale * jumps[i]
        return residual, jacobian

    def _hamiltonian(self, starts: Array) -> tuple[Array, Array]:
        """H, which is constant, where it costs no integration, and by all starts and lengths."""
        m, size = starts.shape
        value, slope = (x.full() for x in self.problem.system.hamiltonian(starts[0] * self.scale, self.tau[0], 0.0))
        jacobian = np.zeros((1, m * size + m))
        jacobian[0, :size] = slope[0] * self.scale
        return value.ravel(), jacobian


def _integrate(problem: BangBangProblem, starts: Array, lengths: Array, tau: Array, rtol: float) -> tuple[Array, Array]:
    """Ends of all arcs, shape (m, 4 nv), and their derivatives by the starts, shape (m, 4 nv, 4 nv)."""
    m, size = starts.shape
    scale = np.maximum(np.max(np.abs(starts), axis=0), 1e-9)

    def rate(s: float, flat: Array) -> Array:
        both = flat.reshape(m, size, size + 1)
        flow, by_y = columns(problem.system.flow_jacobian, both[:, :, 0].T, tau.T)
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
