"""A loop along which the arm's load changes, as one loop of a few more joints.

The simulated loop has one plant and one law. Here both are chosen among several by weights, one per load: 1 for the
load that the arm carries, 0 for the others. The law reads the weights from its row, and returns them as torques of
joints that do not move, which are decided, delayed and held as all torques are. So integrals, filters, observers and
delayed torques go on over a change.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.arrays import Array
from armdyn.control.loop.loop import Law
from armdyn.dynamics.driven import Driven, Plant, Tables, drive


class Loaded(NamedTuple):
    """Plant, observer's model and law while one load is carried."""

    plant: Plant
    model: Plant | None
    law: Law


@dataclass(frozen=True, eq=False)
class ChangingLoad:
    """Several loads, and which of them is carried at each tick.

    Attributes:
        loads: distinct ones.
        which: index of the load over each tick, shape (n,); the last for good.
        delay: ticks from a reading to its torque.
    """

    loads: Sequence[Loaded]
    which: NDArray[np.intp]
    delay: int

    @property
    def law(self) -> ca.Function:
        """The law of the load that is carried when its torque acts; then the weights."""
        functions = [one.law.function for one in self.loads]
        nv, more = functions[0].size1_out(0), len(functions)
        q, v, integral = (ca.SX.sym(name, nv + more) for name in ("q", "v", "integral"))
        pending = ca.SX.sym("pending", nv + more, self.delay)
        row, weights = ca.SX.sym("row", functions[0].size1_in(4)), ca.SX.sym("weights", more)
        own = (q[:nv], v[:nv], integral[:nv], ca.vec(pending[:nv, :]), row)
        if _alike(functions):  # it has no numbers of an arm, but in its rows
            tau = functions[0](*own)
        else:
            tau = ca.horzcat(*(function(*own) for function in functions)) @ weights
        arguments = [q, v, integral, ca.vec(pending), ca.vertcat(row, weights)]
        return ca.Function("law", arguments, [ca.vertcat(tau, weights)])

    def drive(self, tables: Tables, scalars: Mapping[str, object]) -> Driven:
        """Run the loop.

        Args:
            tables: of the loop, with the rows of the last load.
            scalars: see `armdyn.dynamics.driven.drive`.
        """
        if len(self.loads) == 1:
            plant, model, law = self.loads[0]
            return drive(plant, law.function, model, tables, scalars)
        models = [one.model for one in self.loads if one.model is not None]
        plant, model = _arm([one.plant for one in self.loads]), _arm(models) if models else None
        driven = drive(plant, self.law, model, self.tables(tables), scalars)
        nv = driven.q.shape[1] - len(self.loads)
        arrays = {name: getattr(driven, name)[:, :nv] for name in ("q", "v", "tau", "estimate", "clipped")}
        return driven._replace(**arrays)

    def tables(self, tables: Tables) -> Tables:
        """Tables of the loop with one further joint per load; each tick has its row of the law of the carried load."""
        weights = np.eye(len(self.loads))[self.which]
        acting = np.minimum(np.arange(len(self.loads[0].law.rows)) + self.delay, len(self.which) - 1)
        rows = np.stack([one.law.rows for one in self.loads])[self.which[acting], np.arange(len(acting))]
        first = weights[np.minimum(np.arange(self.delay), len(weights) - 1)]
        none, nv = np.zeros(len(self.loads)), tables.lower.size
        return tables._replace(
            rows=np.hstack([rows, weights[acting]]),
            q_reference=_widened(tables.q_reference, none),
            start=_widened(tables.start.reshape(-1, nv), none).ravel(),
            first=np.hstack([tables.first, first]),
            lower=np.append(tables.lower, none),
            upper=np.append(tables.upper, none + 1),
            integral_gain=np.append(tables.integral_gain, none),
            noise=_widened(tables.noise, none) if tables.noise.size else tables.noise,
        )


def _widened(table: Array, none: Array) -> Array:
    return np.hstack([table, np.broadcast_to(none, (len(table), none.size))])


def _arm(arms: Sequence[Plant]) -> Plant:
    """Dynamics that select the arm by indices appended to the joint torques."""
    functions = [one.function for one in arms]
    nv, more = functions[0].size1_out(0), len(arms)
    q, v, tau = (ca.SX.sym(name, nv + more) for name in ("q", "v", "tau"))
    sizes = [one.parameters.size for one in arms]
    p = ca.SX.sym("p", sum(sizes))
    own, weights = ca.vertsplit(p, np.cumsum([0, *sizes]).tolist()), tau[nv:]
    state = q[:nv], v[:nv], tau[:nv]
    if _alike(functions):  # a load is numbers of one function
        a = functions[0](*state, ca.horzcat(*own) @ weights)
    else:
        a = ca.horzcat(*(function(*state, part) for function, part in zip(functions, own, strict=True))) @ weights
    function = ca.Function("loaded", [q, v, tau, p], [ca.vertcat(a, ca.SX.zeros(more))])
    return Plant(function, np.concatenate([one.parameters for one in arms]))


def _alike(functions: Sequence[ca.Function]) -> bool:
    return len({function.serialize() for function in functions}) == 1
