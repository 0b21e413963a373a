"""Nonlinear programs of meshes and curves as values for other solvers, built as `solve_minimum_time` builds them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import expect, numbers, whole
from armdyn.arrays import Array, Index
from armdyn.errors import ProblemError
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curve import Basis, Curve, CurveLeg
from armdyn.optimal.curves.excess import sampled
from armdyn.optimal.curves.layout import CurveSpec, curve_layout
from armdyn.optimal.curves.nlp_data import assemble_curve
from armdyn.optimal.curves.program import build, rows_of
from armdyn.optimal.curves.solve import straight_curve, units_of
from armdyn.optimal.mesh.assembly import Block, Program, build_nlp
from armdyn.optimal.mesh.direct import assemble_mesh, legs_of
from armdyn.optimal.mesh.ipopt import NlpData
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.task import Task
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory

MOST_INTERVALS = 10_000
"""Largest number of intervals of a program: beyond, its expressions take gigabytes."""
_Unknowns = dict[str, tuple[Index, ArrayLike]]
"""Indices and units of the unknowns of one kind, shape (places, nv) or (places, 1), by names with the place as {}."""


@brief
@dataclass(frozen=True, eq=False)
class MotionProgram:
    """Nonlinear program of a motion: minimise f(x) with lower ≤ x ≤ upper and row_lower ≤ g(x) ≤ row_upper.

    Attributes:
        x: unknowns, scaled, a symbol of shape (n,).
        f: cost, an expression in x: the duration over the guess's, and weighted squares of the torques.
        g: equations and path constraints, an expression of shape (m,).
        names: name of each unknown, such as "q[3].joint1" of knot 3.
        lower: lower bounds of the unknowns, shape (n,).
        upper: upper bounds of the unknowns, shape (n,).
        units: SI value of each unknown where it is one, shape (n,).
        row_names: name of each row, such as "interval[3] end v.joint1", a defect.
        row_lower: lower bounds of the rows, shape (m,).
        row_upper: upper bounds of the rows, shape (m,).
        guess: initial unknowns, shape (n,).
        motion_of: function from unknowns, shape (n,), to their motion, which `trajectory` calls.
    """

    x: ca.MX
    f: ca.MX
    g: ca.MX
    names: tuple[str, ...]
    lower: Array
    upper: Array
    units: Array
    row_names: tuple[str, ...]
    row_lower: Array
    row_upper: Array
    guess: Array
    motion_of: Callable[[Array], Trajectory] = field(repr=False)

    @property
    def nlp(self) -> dict[str, ca.MX]:
        """The expressions as `casadi.nlpsol` takes them."""
        return {"x": self.x, "f": self.f, "g": self.g}

    @property
    def bounds(self) -> dict[str, Array]:
        """Guess and bounds as a solver of `casadi.nlpsol` takes them."""
        own = {"x0": self.guess, "lbx": self.lower, "ubx": self.upper}
        return own | {"lbg": self.row_lower, "ubg": self.row_upper}

    def trajectory(self, x: ArrayLike) -> Trajectory:
        """The motion of unknowns, neither replayed nor checked.

        Args:
            x: unknowns, shape (n,) or (n, 1), such as a solver's.

        Raises:
            ProblemError: no numbers, or another number of unknowns.
        """
        values = numbers(x.full() if isinstance(x, ca.DM) else x, "x", f"{len(self.names)} unknowns").ravel()
        if values.size != len(self.names):
            raise ProblemError(f"x has {values.size} unknowns; the program has {len(self.names)}")
        return self.motion_of(values)


def build_mesh(
    problem: MinimumTimeProblem, intervals: int | None = None, guess: Trajectory | None = None
) -> MotionProgram:
    """Build the program of a collocation mesh, as `solve_minimum_time` does for up to three joints.

    Args:
        problem: the minimum-time problem.
        intervals: number of equal intervals, distributed over the legs between via points; None: those of the solve.
        guess: initial guess; None: the straight path.

    Raises:
        ProblemError: an argument is none, or the guess has another number of joints.
    """
    task, intervals = _task(problem, intervals, guess)
    constraints = TightenedConstraints.of(task)
    data = assemble_mesh(task, guess or spline(task.problem, []), intervals, constraints)
    nlp = build_nlp(task.dynamics, task.scheme, intervals, constraints.rows(task.problem))
    layout, by, n = data.layout, data.by, task.problem.robot.nv
    states, middles = layout.states(intervals), layout.middles(intervals)
    unknowns: _Unknowns = {
        "q[{}]": (states[:, :n], by.length),
        "v[{}]": (states[:, n:], by.speed),
        "middle q[{}]": (middles[:, :n], by.length),
        "middle v[{}]": (middles[:, n:], by.speed),
        "tau[{}]": (layout.torques(intervals), by.effort),
        "T[{}]": (layout.times(intervals)[:, None], by.time),
    }
    return _built(task, nlp, data, unknowns, lambda x: data.motion(x, task.problem.robot.joint_names))


def build_curve(
    problem: MinimumTimeProblem, intervals: int | None = None, guess: Trajectory | None = None
) -> MotionProgram:
    """Build the program of a B-spline curve, as `solve_minimum_time` does for more than three joints.

    Args:
        problem: the minimum-time problem, of an arm without passive joints.
        intervals: number of intervals of each leg between via points; None: that of the solve.
        guess: initial guess; None: the straight path.

    Raises:
        ProblemError: an argument is none, a joint is passive, or the guess has another number of joints.
    """
    task, intervals = _task(problem, intervals, guess, on_curves=True)
    if np.any(task.problem.limits.passive):
        raise ProblemError("a curve's torques are those of inverse dynamics, and a passive joint has none; build_mesh")
    curve, spec = straight_curve(task, intervals), CurveSpec.of(task)
    if guess is not None:
        curve = _along(task.problem, guess, curve.legs[0].basis)
    shape, rows = curve_layout(task.problem, curve, spec.constraints), rows_of(task.problem, spec.constraints)
    scales = units_of(task.problem, curve, shape, rows)
    data, units = assemble_curve(task, curve, spec, shape, scales), shape.units(*scales)
    unknowns: _Unknowns = {}
    for leg in shape.legs:
        own = f"[{leg},{{}}]" if len(shape.legs) > 1 else "[{}]"
        unknowns[f"point{own}"] = shape.points(leg), units[shape.points(leg)]
        unknowns[f"tau{own}"] = shape.torques(leg), task.problem.limits.actuators.half_range
        unknowns[f"T{own}"] = np.array([[shape.duration(leg)]]), scales[1]
    program = build(task.dynamics, shape, rows, False)
    return _built(task, program, data, unknowns, lambda x: sampled(task, shape.curve(curve, x * units)))


def _task(
    problem: MinimumTimeProblem, intervals: int | None, guess: Trajectory | None, on_curves: bool = False
) -> tuple[Task, int]:
    """The task with the guess, without machine code, which others' solvers do not call, and the checked intervals."""
    expect(problem, MinimumTimeProblem, "problem")
    guesses = () if guess is None else (expect(guess, Trajectory, "guess"),)
    posed = problem.without_torques() if problem.kinematic else problem
    task = Task.of(posed, MinimumTimeOptions(guesses=guesses, compile=False))
    own = task.policy.curves.intervals if on_curves else task.intervals
    least = len(problem.poses) - 1
    return task, whole(own if intervals is None else intervals, "intervals", least=least, most=MOST_INTERVALS)


def _along(problem: MinimumTimeProblem, guess: Trajectory, basis: Basis) -> Curve:
    """A curve near a motion."""
    durations = legs_of(problem, guess, basis.intervals * (len(problem.poses) - 1)).durations
    starts = guess.t[0] + np.cumsum(durations) - durations
    legs = (CurveLeg(basis, guess(t + T * basis.places).q, float(T)) for t, T in zip(starts, durations, strict=True))
    return Curve(tuple(legs))


def _parts(count: int, joints: tuple[str, ...]) -> list[str]:
    """Endings of the names of several numbers at one place."""
    if count == len(joints):
        return [f".{joint}" for joint in joints]
    return [""] if count == 1 else [f".{k}" for k in range(count)]


def _built(
    task: Task, program: Program, data: NlpData, unknowns: _Unknowns, motion: Callable[[Array], Trajectory]
) -> MotionProgram:
    names, units, joints = [""] * len(data.x), np.ones(len(data.x)), task.problem.robot.joint_names
    for name, (index, unit) in unknowns.items():
        units[index] = unit
        for k, row in enumerate(index):
            for place, part in zip(row, _parts(row.size, joints), strict=True):
                names[place] = f"{name.format(k)}{part}"
    x, p, f, g = (program.functions[name] for name in "xpfg")
    f, g = ca.substitute([f, g], [p], [ca.DM(data.p)])
    rows = tuple(_rows(program.blocks, joints))
    return MotionProgram(x, f, g, tuple(names), *data.x_bounds, units, rows, *data.g_bounds, data.x, motion)


def _rows(blocks: tuple[Block, ...], joints: tuple[str, ...]) -> Iterator[str]:
    """Names of the rows: kind, leg if there are several of the kind, place, and joint or number."""
    several, seen = Counter(block.name for block in blocks if block.rows), Counter[str]()
    for block in blocks:
        leg = f"{seen[block.name]}," if several[block.name] > 1 else ""
        seen[block.name] += 1
        parts = _parts(block.rows, joints)
        if block.name == "interval":
            parts = [
                *(f" {where} {kind}.{joint}" for where in ("middle", "end") for kind in "qv" for joint in joints),
                " T",
            ]
        yield from (
            f"{block.name}[{leg}{k}]{part}" for k in range(1 if block.summed else block.places) for part in parts
        )
