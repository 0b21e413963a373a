"""Rows of an interval: derivatives by the chain rule over its stages are those by its unknowns."""

import casadi as ca
import numpy as np
import pytest

import armdyn as ad
from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.constraints.goal_region import region_rows
from armdyn.optimal.constraints.rows import StageRows
from armdyn.optimal.constraints.stages import differentiated
from armdyn.optimal.curves.equations import CurveInterval, _torques
from problems import paper_arm

ROBOT = paper_arm("rrr")
PLACE = CurveInterval(Dynamics(ROBOT, free_last_body=True), False)
REGION = ad.GoalPose(ROBOT.tip, np.eye(4), tolerance=[0.01] * 6)


@pytest.mark.parametrize(
    "rows", [region_rows(ROBOT, REGION, "every", None, (1, 2, 3)), StageRows(_torques, (0,))], ids=["region", "torques"]
)
def test_the_chain_rule(rows):
    one, numbers = PLACE.stages(), ca.SX.sym("numbers", rows.numbers)
    p = ca.vertcat(one.p, numbers)
    direct = differentiated("direct", one.y, p, rows.expression(one, numbers, *rows.arguments), None, False)
    chained = rows.functions(PLACE)
    random = np.random.default_rng(3)
    y, given = random.uniform(0.2, 1, one.y.numel()), random.uniform(0.2, 1, p.numel())
    lam = random.normal(size=direct.defects.numel_out(0))
    np.testing.assert_allclose(chained.defects(y, given), direct.defects(y, given), rtol=1e-12)
    for name, arguments in (("jacobian", (y, given)), ("hessian", (y, given, 1.0, lam))):
        matrices = []
        for functions in (direct, chained):
            pattern = getattr(functions, f"{name}_pattern")
            matrices.append(ca.DM(pattern, getattr(functions, name)(*arguments)).full())
        scale = np.max(np.abs(matrices[0]))
        np.testing.assert_allclose(matrices[1], matrices[0], rtol=1e-10, atol=1e-12 * scale)
