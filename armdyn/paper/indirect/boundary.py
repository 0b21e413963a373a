"""The canonical system as a two-point boundary value problem with free final time.

Time is s = t/t_f on [0, 1], and t_f a parameter of the problem: 4 nv + 1 unknown constants against the start
and goal states (4 nv) and H(t_f) = 0. Everything is scaled by a guess, so that a tolerance means the same for
radians and for costates.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_bvp
from scipy.sparse import coo_matrix, csc_matrix
from scipy.sparse.linalg import splu

from armdyn.arrays import Array
from armdyn.locks import cached_property
from armdyn.optimal.problem.status import Status, Stop
from armdyn.paper.indirect.canonical import CanonicalSystem, columns
from armdyn.paper.indirect.newton import Point, Root, SingularError, newton

_NEWTON_STEPS = 40
_SHORTEST_STEP = 2.0**-10


@dataclass(frozen=True, eq=False)
class BoundaryExtremal:
    """A solution of the canonical system, or a guess of one.

    Attributes:
        s: knots as parts of the duration, shape (m,), from 0 to 1.
        y: (q, v, ρ_q, ρ_v) there, shape (4 nv, m).
        duration: t_f [s].
        status: SOLVED, or why not.
        message: the status in words, with the place of the largest residual.
        residual: of the scaled equations, largest over the intervals (Lobatto: root mean square in each).
    """

    s: Array
    y: Array
    duration: float
    status: Status = Status.SOLVED
    message: str = ""
    residual: float = 0.0


class _StopError(Exception):
    """Carries a stop through foreign code."""


@dataclass(frozen=True, eq=False)
class BoundaryProblem:
    """Scaled boundary-value problem.

    Attributes:
        system: the canonical system.
        x_start: (q, v) at the start, shape (2 nv,).
        x_goal: (q, v) at the end, shape (2 nv,).
        weight: w [1/(N m)²].
        lower: torque limits [N m], shape (nv,); -inf for none.
        upper: likewise.
        guess: the scale of the unknowns.
        stop: polled by the solvers.
    """

    system: CanonicalSystem
    x_start: Array
    x_goal: Array
    weight: float
    lower: Array
    upper: Array
    guess: BoundaryExtremal
    stop: Stop

    @cached_property
    def scale(self) -> Array:
        """Scales of q, v, ρ_q and ρ_v, shape (4 nv,): the guess's peaks, one for all joints."""
        peaks = np.max(np.abs(self.guess.y).reshape(4, -1), axis=1)
        return np.repeat(np.maximum(peaks, 1e-9), self.system.nv)

    @property
    def constants(self) -> tuple[Array, Array, Array]:
        """Arguments of the system's Functions after y."""
        return np.array([self.weight]), self.lower, self.upper

    def rate(self, s: Array, z: Array, p: Array) -> Array:
        """dz/ds, shape (4 nv, m), of scaled y, shape (4 nv, m), and p = t_f over the guess's, shape (1,)."""
        scale = self.scale[:, None]
        (rate,) = columns(self.system.rate, z * scale, *self.constants)
        return np.asarray(p[0] * self.guess.duration * rate[:, 0] / scale)

    def jacobian(self, s: Array, z: Array, p: Array) -> tuple[Array, Array]:
        """Jacobians of `rate` by z, shape (4 nv, 4 nv, m), and by p, shape (4 nv, 1, m)."""
        scale = self.scale[:, None]
        (by_y,) = columns(self.system.rate_jacobian, z * scale, *self.constants)
        by_z = p[0] * self.guess.duration * by_y * (self.scale / scale)[:, :, None]
        return by_z, self.rate(s, z, p)[:, None] / p[0]

    def ends(self, first: Array, last: Array, p: Array) -> Array:
        """Misses of start and goal, scaled, and H at the end, shape (4 nv + 1,)."""
        half, scale = self.x_start.size, self.scale
        hamiltonian = self.system.terminal(last * scale, *self.constants)[0]
        return np.concatenate(
            [first[:half] - self.x_start / scale[:half], last[:half] - self.x_goal / scale[:half], [float(hamiltonian)]]
        )

    def ends_jacobian(self, first: Array, last: Array, p: Array) -> tuple[Array, Array, Array]:
        """Jacobians of `ends` by the first and the last z, shape (4 nv + 1, 4 nv) each, and by p."""
        half, size = self.x_start.size, self.scale.size
        at_first, at_last = np.zeros((2, size + 1, size))
        at_first[:half, :half] = at_last[half:size, :half] = np.eye(half)
        at_last[-1] = self.system.terminal(last * self.scale, *self.constants)[1].full().ravel() * self.scale
        return at_first, at_last, np.zeros((size + 1, 1))


def solve_lobatto(problem: BoundaryProblem, tolerance: float, max_nodes: int) -> BoundaryExtremal:
    """Three-stage Lobatto IIIA collocation, of order 4, on a mesh that adapts: `scipy.integrate.solve_bvp`.

    Args:
        problem: with the guess where it starts.
        tolerance: of the relative residual in every interval.
        max_nodes: of the mesh.
    """
    guess = problem.guess

    def rate(s: Array, z: Array, p: Array) -> Array:
        if problem.stop:
            raise _StopError
        return problem.rate(s, z, p)

    try:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            found = solve_bvp(
                rate, problem.ends, guess.s, guess.y / problem.scale[:, None], np.ones(1),
                fun_jac=problem.jacobian, bc_jac=problem.ends_jacobian, tol=tolerance, max_nodes=max_nodes,
            )  # fmt: skip
    except _StopError:
        status = problem.stop.status
        return replace(guess, status=status, message=status.replace("_", " "), residual=np.inf)
    duration = float(found.p[0]) * guess.duration
    worst = int(np.argmax(found.rms_residuals))
    status = {0: Status.SOLVED, 1: Status.ITERATION_LIMIT}.get(found.status, Status.FAILED)
    residual = float(found.rms_residuals[worst])
    message = f"{found.message} Largest residual {residual:.2g} at {found.x[worst]:.4g} of the duration"
    if not duration > 0:
        status, message = Status.FAILED, f"the duration came out as {duration:.3g} s. {message}"
    return BoundaryExtremal(found.x, found.y * problem.scale[:, None], duration, status, message, residual)


def solve_trapezoidal(problem: BoundaryProblem, intervals: int, tolerance: float) -> BoundaryExtremal:
    """Finite differences: the trapezoidal rule (Lobatto IIIA with two stages), of order 2, on an even mesh.

    The equations z_{k+1} − z_k = h/2 (g_k + g_{k+1}) are solved by Newton's method with steps halved until the
    residual falls (Keller, Numerical Methods for Two-Point Boundary-Value Problems, section 3.2).

    Args:
        problem: with the guess where it starts.
        intervals: of the mesh.
        tolerance: of the equations' largest residual.
    """
    s = np.linspace(0, 1, intervals + 1)
    guess = np.array([np.interp(s, problem.guess.s, row) for row in problem.guess.y]) / problem.scale[:, None]
    root = newton(
        lambda unknowns: _trapezoidal(problem, s, unknowns), np.append(guess.T.ravel(), 1.0),
        tolerance=tolerance, steps=_NEWTON_STEPS, shortest=_SHORTEST_STEP, positive=1, stop=problem.stop,
    )  # fmt: skip
    return _extremal(problem, s, root)


def _extremal(problem: BoundaryProblem, s: Array, root: Root) -> BoundaryExtremal:
    """Message with the interval of the largest residual."""
    z, duration = root.unknowns[:-1].reshape(s.size, -1), float(root.unknowns[-1]) * problem.guess.duration
    worst = int(np.argmax(np.abs(root.residual)))
    value = float(np.abs(root.residual[worst]))
    place = s[min(worst // problem.scale.size, s.size - 1)]
    message = f"{root.reason}; largest residual {value:.2g} at {place:.4g} of the duration"
    return BoundaryExtremal(s, z.T * problem.scale[:, None], duration, root.status, message, value)


def _trapezoidal(problem: BoundaryProblem, s: Array, unknowns: Array) -> Point:
    """The equations of all intervals and of the ends; their Jacobian is computed lazily."""
    residual = _trapezoidal_residual(problem, s, unknowns)

    def step() -> Array:
        try:
            return np.asarray(splu(_trapezoidal_jacobian(problem, s, unknowns)).solve(-residual))
        except RuntimeError as error:  # SuperLU's only error for a singular matrix
            raise SingularError from error

    return Point(residual, step)


def _trapezoidal_residual(problem: BoundaryProblem, s: Array, unknowns: Array) -> Array:
    """Residual of all intervals, then of the ends, shape (4 nv m + 1,)."""
    z, p = unknowns[:-1].reshape(s.size, -1).T, unknowns[-1:]
    g = problem.rate(s, z, p)
    defects = np.diff(z, axis=1) - np.diff(s) / 2 * (g[:, :-1] + g[:, 1:])
    return np.concatenate([defects.T.ravel(), problem.ends(z[:, 0], z[:, -1], p)])


def _trapezoidal_jacobian(problem: BoundaryProblem, s: Array, unknowns: Array) -> csc_matrix:
    """Jacobian of the residual: block bidiagonal, t_f in the last column, the ends in the last rows.

    [ A_0 B_0                 a_0 ]
    [     A_1 B_1             a_1 ]
    [          …               …  ]
    [ E_0               E_m    0  ]
    """
    size, m = problem.scale.size, s.size
    z, p = unknowns[:-1].reshape(m, size).T, unknowns[-1:]
    by_z, by_p = problem.jacobian(s, z, p)
    half, eye = np.diff(s)[:, None, None] / 2, np.eye(size)
    left = -eye - half * by_z.transpose(2, 0, 1)[:-1]
    right = eye - half * by_z.transpose(2, 0, 1)[1:]
    by_time = -half[:, :, 0] * (by_p[:, 0, :-1] + by_p[:, 0, 1:]).T
    row, col = np.indices((size, size))
    shift = size * np.arange(m - 1)[:, None, None]
    first, last, _ = problem.ends_jacobian(z[:, 0], z[:, -1], p)
    end_row, end_col = np.indices(first.shape)
    total = size * m + 1
    inner, last_rows = size * (m - 1), size * (m - 1) + end_row
    parts = (
        (left, row + shift, col + shift),
        (right, row + shift, col + shift + size),
        (by_time, np.arange(inner).reshape(m - 1, size), np.full((m - 1, size), total - 1)),
        (first, last_rows, end_col),
        (last, last_rows, inner + end_col),
    )
    data, rows, cols = (np.concatenate([part[i].ravel() for part in parts]) for i in range(3))
    return coo_matrix((data, (rows, cols)), shape=(total, total)).tocsc()
