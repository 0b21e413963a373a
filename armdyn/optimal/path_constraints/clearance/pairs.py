"""Rows that ask for distances between capsules around links and what these must keep clear of."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from armdyn.codegen.compiled import compiled
from armdyn.codegen.deadline import ask
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.models.scene.distance import Solid, from_segment, least_over_segment
from armdyn.models.scene.obstacles import Capsule, Obstacle
from armdyn.optimal.path_constraints.rows import Where
from armdyn.optimal.program.interval import IntervalFunctions, IntervalView, nonzeros_of

Kinds = tuple[type[Obstacle], ...]


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
class PairRows:
    """Distances [m] at a part of every interval; that part and the obstacles are the numbers.

    Attributes:
        pairs: whose distances are rows.
        kinds: of the obstacles.
        where: in every interval.
    """

    pairs: tuple[Pair, ...]
    kinds: Kinds = ()
    where: Where = "every"

    @property
    def numbers(self) -> int:
        """The part of the interval, and those of the obstacles."""
        return 1 + sum(kind.count for kind in self.kinds)

    def functions(self, place: IntervalView) -> IntervalFunctions:
        """The rows and their derivatives."""
        return _distance_rows(place, self.pairs, self.kinds)


@built_once(maxsize=16)
def distances_at(dynamics: Dynamics, pairs: tuple[Pair, ...], kinds: Kinds = ()) -> ca.Function:
    """Function of q [rad or m], shape (nv,), and the obstacles' numbers: the distance of every pair [m]."""
    q, scene = ca.SX.sym("q", dynamics.nv), ca.SX.sym("scene", sum(kind.count for kind in kinds))
    return ca.Function("distances", [q, scene], [ca.cse(_distances(dynamics, q, scene, pairs, kinds))])


@built_once(maxsize=16)
def _distance_rows(place: IntervalView, pairs: tuple[Pair, ...], kinds: Kinds) -> IntervalFunctions:
    """Distances at a part s of an interval.

    Differentiated by q, and by the chain rule from there to the interval's unknowns: a third of the operations.
    """
    one = place.stages()
    y, p, s, n = one.y, one.p, ca.SX.sym("s"), one.dynamics.nv
    here = one.position(s)
    position = ca.Function("position", [y, p, s], [here])
    values, slopes, bends_at = _by_positions(one.dynamics, pairs, kinds, place.compile)

    by_q, pulls = ca.SX.sym("by_q", slopes.sparsity_out(0)), ca.SX.sym("pull", n)
    bends = ca.SX.sym("bend", n, n)
    motion = ca.jacobian(here, y)
    jacobian = ca.sparsify(by_q @ motion)
    hessian = ca.triu(ca.sparsify(motion.T @ bends @ motion + ca.hessian(ca.dot(pulls, here), y)[0]))
    chain = (
        ca.Function("distance_chain", [y, p, s, by_q], [nonzeros_of(jacobian)]),
        ca.Function("distance_chain2", [y, p, s, bends, pulls], [nonzeros_of(hessian)]),
    )
    own, part, count = ca.MX.sym("y", y.numel()), p.numel(), values.numel_in(1)
    given, sigma, weights = ca.MX.sym("p", part + 1 + count), ca.MX.sym("sigma"), ca.MX.sym("lam", len(pairs))
    inputs, world = [own, given[:part], given[part]], given[part + 1 :]
    there = position(*inputs)
    second = chain[1](*inputs, *bends_at(there, world, weights))
    return IntervalFunctions(
        defects=ca.Function("distance_values", [own, given], [values(there, world)]),
        cost=None,
        jacobian=ca.Function("distance_jacobian", [own, given], [chain[0](*inputs, slopes(there, world))]),
        jacobian_pattern=jacobian.sparsity(),
        hessian=ca.Function("distance_hessian", [own, given, sigma, weights], [second]),
        hessian_pattern=hessian.sparsity(),
    )


def _by_positions(
    dynamics: Dynamics, pairs: tuple[Pair, ...], kinds: Kinds, compile_: bool | None
) -> tuple[ca.Function, ca.Function, ca.Function]:
    """Distances of (q, scene), their slopes by q, and, weighted, their bends and gradient."""
    at, lam = ca.SX.sym("q", dynamics.nv), ca.SX.sym("lam", len(pairs))
    scene = ca.SX.sym("scene", sum(kind.count for kind in kinds))
    distances = ca.cse(_distances(dynamics, at, scene, pairs, kinds))
    ask()  # for many pairs each of these takes half a second
    slopes = ca.cse(ca.jacobian(distances, at))
    ask()
    bend, pull = ca.hessian(ca.dot(lam, distances), at)
    ask()
    bend = ca.cse(bend)
    ask()
    slopes_at, bends_at = compiled(
        (
            ca.Function("slopes", [at, scene], [slopes]),
            ca.Function("bends", [at, scene, lam], [ca.densify(bend), pull]),
        ),
        compile_,
    )
    return ca.Function("distances", [at, scene], [distances]), slopes_at, bends_at


def _distances(dynamics: Dynamics, q: ca.SX, scene: ca.SX, pairs: tuple[Pair, ...], kinds: Kinds) -> ca.SX:
    poses = dynamics.placements(q)
    ends = np.cumsum([0, *(kind.count for kind in kinds)]).tolist()
    solids = [kind.symbolic(scene[ends[i] : ends[i + 1]]) for i, kind in enumerate(kinds)]

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
