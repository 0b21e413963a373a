"""Torques where legs begin and end, beyond their first and last Gauss points: nothing else holds them there."""

import casadi as ca

from armdyn.optimal.flat.basis import WINDOW
from armdyn.optimal.flat.equations import BODY
from armdyn.optimal.path_constraints.rows import RowValues, StageRows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.interval import Stages, only_present


def end_torque_rows(problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
    """Rows at the beginning and the end of every leg, of problems with regions: their legs may be short."""
    legs = range(len(problem.poses) - 1) if problem.regional else ()
    ends = (("first", 0), ("last", -1))
    return tuple(StageRows(_torques, (stage,), where=where, leg=leg) for leg in legs for where, stage in ends)  # type: ignore[arg-type]


def end_torque_values(problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
    """Torque limits over half the torques' ranges."""
    actuators = problem.limits.actuators
    bounds = RowValues(actuators.lower / actuators.half_range, actuators.upper / actuators.half_range)
    return (bounds,) * len(end_torque_rows(problem))


def _torques(stages: Stages, numbers: ca.SX, stage: int) -> ca.SX:
    """Torques at a stage by inverse dynamics, over half their ranges."""
    n, dynamics = stages.dynamics.nv, stages.dynamics
    first = WINDOW**2 + 1 + 2 * n
    body = only_present(dynamics, stages.p[first : first + BODY])
    scaled: ca.SX = dynamics.rnea(stages.q[:, stage], stages.v[:, stage], stages.a[:, stage], body) / stages.effort
    return scaled
