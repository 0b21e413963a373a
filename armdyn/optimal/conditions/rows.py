"""Rows of a nonlinear program along the path: distances from obstacles, accelerations, jerks.

They come after the equations of motion, interval by interval, and leave those as they are: a problem
without such rows has the program of `transcription.build_nlp` itself.
"""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.exclusive import built_once
from armdyn.models.obstacles import Capsule, Obstacle
from armdyn.optimal.conditions.distance import SIZES, Solid, from_segment, least_over_segment, solid
from armdyn.optimal.program.assembly import Nlp, assemble, hessian_function, jacobian_function
from armdyn.optimal.program.compiled import compiled
from armdyn.optimal.program.interval import nonzeros_of, stage_accelerations
from armdyn.optimal.program.layout import Layout, Parameters
from armdyn.optimal.task.scheme import Scheme

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pair:
    """A capsule on a joint, and what it must keep clear of.

    Attributes:
        link: its link's name.
        joint: index in `robot.model.joints`.
        capsule: in the joint's frame.
        other: a capsule in the frame of `other_joint`, or the index of an obstacle.
        other_joint: 0 is the world.
        other_link: name of the other link, if it is one.
    """

    link: str
    joint: int
    capsule: Capsule
    other: Capsule | int
    other_joint: int = 0
    other_link: str = ""


@dataclass(frozen=True)
class PathRows:
    """Which rows a program has besides the equations of motion.

    Attributes:
        pairs: whose distances are rows.
        kinds: of the obstacles, whose numbers are parameters.
        points: at so many points of every interval, evenly from its start.
        accelerations: rows at every stage.
        jerks: rows between every two stages; they come with accelerations.
    """

    pairs: tuple[Pair, ...] = ()
    kinds: tuple[type[Obstacle], ...] = ()
    points: int = 2
    accelerations: bool = False
    jerks: bool = False


def with_rows(nlp: Nlp, dynamics: Dynamics, rows: PathRows) -> Nlp:
    """A program with further rows, after the equations of motion of all intervals, and the obstacles as parameters.

    For every point of an interval the distances [m] of all intervals; then, of all intervals, the scaled
    accelerations and jerks.

    Args:
        nlp: of `build_nlp`.
        dynamics: the same as there.
        rows: which.
    """
    layout, N = nlp.layout, nlp.intervals
    block, size = layout.block, layout.size(N)
    x, own = nlp.functions["x"], nlp.functions["p"]
    whole = ca.MX.sym("p", own.numel() + sum(SIZES[kind] for kind in rows.kinds))
    p, scene = whole[: own.numel()], whole[own.numel() :]
    y = ca.reshape(x[layout.intervals(N).ravel(order="F").tolist()], layout.width, N)
    parameters = Parameters.by_interval(p, N)

    parts: list[tuple[_Rows, list[ca.DM | ca.MX]]] = []
    if rows.pairs:
        one = _distance_rows(dynamics, layout.scheme, rows.pairs, rows.kinds)
        here = ca.repmat(scene, 1, N)
        parts += [(one, [ca.DM.ones(1, N) * k / rows.points, here]) for k in range(rows.points)]
    if rows.accelerations:
        parts.append((_motion_rows(dynamics, layout.scheme, rows.jerks), []))

    sigma, lam = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", N * (nlp.defects + sum(one.size for one, _ in parts)))
    g, jacobian, hessian = [], [], ca.MX(size, size)
    first = nlp.defects * N
    for one, extra in parts:
        count = one.size * N
        g.append(ca.vec(one.values.map(N)(y, parameters, *extra)))
        nonzeros = one.jacobian.map(N)(y, parameters, *extra)
        jacobian.append(assemble(one.jacobian_pattern, (one.size, block), (count, size), nonzeros))
        weights = ca.reshape(lam[first : first + count], one.size, N)
        nonzeros = one.hessian.map(N)(y, parameters, *extra, weights)
        hessian += assemble(one.hessian_pattern, (block, block), (size, size), nonzeros)
        first += count

    plain_g, plain_jacobian = nlp.jacobian(x, p)
    f, plain = ca.Function("plain", [x, own], [nlp.functions["f"], nlp.functions["g"]])(x, p)
    jacobian_all = ca.vertcat(plain_jacobian, *jacobian)
    hessian_all = nlp.hessian(x, p, sigma, lam[: nlp.defects * N]) + hessian
    return replace(
        nlp,
        functions={"x": x, "p": whole, "f": f, "g": ca.vertcat(plain, *g)},
        jacobian=jacobian_function(x, whole, ca.vertcat(plain_g, *g), jacobian_all),
        gradient=ca.Function("gradient", [x, whole], [nlp.gradient(x, p)]),
        hessian=hessian_function(x, whole, sigma, lam, hessian_all),
    )


@dataclass(frozen=True)
class _Rows:
    """Rows of one interval, or of one point of it, and the nonzeros of their derivatives."""

    size: int
    values: ca.Function
    jacobian: ca.Function
    jacobian_pattern: ca.Sparsity
    hessian: ca.Function
    hessian_pattern: ca.Sparsity


def _functions(name: str, rows: ca.SX, y: ca.SX, others: list[ca.SX]) -> _Rows:
    lam = ca.SX.sym("lam", rows.numel())
    jacobian = ca.cse(ca.jacobian(rows, y))
    hessian = ca.cse(ca.triu(ca.hessian(ca.dot(lam, rows), y)[0]))
    return _Rows(
        rows.numel(),
        ca.Function(f"{name}_values", [y, *others], [rows]),
        ca.Function(f"{name}_jacobian", [y, *others], [nonzeros_of(jacobian)]),
        jacobian.sparsity(),
        ca.Function(f"{name}_hessian", [y, *others, lam], [nonzeros_of(hessian)]),
        hessian.sparsity(),
    )


@built_once(maxsize=16)
def _distance_rows(
    dynamics: Dynamics, scheme: Scheme, pairs: tuple[Pair, ...], kinds: tuple[type[Obstacle], ...]
) -> _Rows:
    """Distances at a part s of an interval, on the cubic through positions and velocities of its knots.

    Differentiated by q, and by the chain rule from there to the interval's unknowns: a third of the operations.
    """
    n, layout = dynamics.nv, Layout(dynamics.nv, scheme)
    y, p, s = ca.SX.sym("y", layout.width), ca.SX.sym("p", Parameters.size(n)), ca.SX.sym("s")
    by, (left, _, right) = Parameters.of(p, n), layout.parts(y)
    h = by.fraction * by.time * left[layout.knot.time]
    q = [by.length * knot[layout.knot.q] for knot in (left, right)]
    v = [by.speed * knot[layout.knot.v] for knot in (left, right)]
    rise = q[1] - q[0]
    here = q[0] + s * (h * v[0] + s * (3 * rise - h * (2 * v[0] + v[1]) + s * (h * (v[0] + v[1]) - 2 * rise)))
    place = ca.Function("place", [y, p, s], [here])

    at, lam = ca.SX.sym("q", n), ca.SX.sym("lam", len(pairs))
    scene = ca.SX.sym("scene", sum(SIZES[kind] for kind in kinds))
    distances = ca.cse(_distances(dynamics, at, scene, pairs, kinds))
    slopes = ca.cse(ca.jacobian(distances, at))
    bend, pull = ca.hessian(ca.dot(lam, distances), at)
    values = ca.Function("distances", [at, scene], [distances])
    slopes_at, bends_at = compiled(
        (
            ca.Function("slopes", [at, scene], [slopes]),
            ca.Function("bends", [at, scene, lam], [ca.densify(ca.cse(bend)), pull]),
        ),
        scheme.compile,
    )

    by_q, pulls, bends = ca.SX.sym("by_q", slopes.sparsity()), ca.SX.sym("pull", n), ca.SX.sym("bend", n, n)
    motion = ca.jacobian(here, y)
    jacobian = ca.sparsify(by_q @ motion)
    hessian = ca.triu(ca.sparsify(motion.T @ bends @ motion + ca.hessian(ca.dot(pulls, here), y)[0]))
    chain = (
        ca.Function("distance_chain", [y, p, s, by_q], [nonzeros_of(jacobian)]),
        ca.Function("distance_chain2", [y, p, s, bends, pulls], [nonzeros_of(hessian)]),
    )
    inputs = [ca.MX.sym("y", y.numel()), ca.MX.sym("p", p.numel()), ca.MX.sym("s")]
    world, weights, there = ca.MX.sym("scene", scene.numel()), ca.MX.sym("lam", len(pairs)), place(*inputs)
    every = [*inputs, world]
    return _Rows(
        len(pairs),
        ca.Function("distance_values", every, [values(there, world)]),
        ca.Function("distance_jacobian", every, [chain[0](*inputs, slopes_at(there, world))]),
        jacobian.sparsity(),
        ca.Function("distance_hessian", [*every, weights], [chain[1](*inputs, *bends_at(there, world, weights))]),
        hessian.sparsity(),
    )


@built_once(maxsize=16)
def distances_at(dynamics: Dynamics, pairs: tuple[Pair, ...], kinds: tuple[type[Obstacle], ...] = ()) -> ca.Function:
    """Function of q [rad or m], shape (nv,), and the obstacles' numbers: the distance of every pair [m]."""
    q, scene = ca.SX.sym("q", dynamics.nv), ca.SX.sym("scene", sum(SIZES[kind] for kind in kinds))
    return ca.Function("distances", [q, scene], [ca.cse(_distances(dynamics, q, scene, pairs, kinds))])


def _distances(
    dynamics: Dynamics, q: ca.SX, scene: ca.SX, pairs: tuple[Pair, ...], kinds: tuple[type[Obstacle], ...]
) -> ca.SX:
    poses = dynamics.placements(q)
    ends = np.cumsum([0, *(SIZES[kind] for kind in kinds)]).tolist()
    solids = [solid(kind, scene[ends[i] : ends[i + 1]]) for i, kind in enumerate(kinds)]

    def segment(joint: int, capsule: Capsule) -> tuple[ca.SX, ca.SX]:
        if joint == 0:
            return ca.SX(capsule.a), ca.SX(capsule.b)
        R, origin = poses[:, 4 * joint - 4 : 4 * joint - 1], poses[:, 4 * joint - 1]
        return R @ ca.DM(capsule.a) + origin, R @ ca.DM(capsule.b) + origin

    rows = []
    for pair in pairs:
        if isinstance(pair.other, Capsule):
            other = Solid(from_segment(*segment(pair.other_joint, pair.other)), ca.SX(pair.other.radius))
        else:
            other = solids[pair.other]
        a, b = segment(pair.joint, pair.capsule)
        rows.append(least_over_segment(other.distance, a, b) - pair.capsule.radius - other.thickness)
    return ca.vertcat(*rows)


@built_once(maxsize=16)
def _motion_rows(dynamics: Dynamics, scheme: Scheme, jerks: bool) -> _Rows:
    """Accelerations over speed/T at the stages, then jerks over speed/T² between them."""
    y, p, a = stage_accelerations(dynamics, scheme)
    rows = [ca.vec(a)]
    if jerks:
        fraction = Parameters.of(p, dynamics.nv).fraction
        part = fraction * y[Layout(dynamics.nv, scheme).knot.time]  # of the scale of time
        for i, step in enumerate(np.diff(scheme.tableau.c)):
            rows.append((a[:, i + 1] - a[:, i]) / (step * part))
    return _functions("motion", ca.vertcat(*rows), y, [p])
