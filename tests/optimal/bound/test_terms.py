"""Inertia, slopes and gravity over boxes, against Pinocchio at points in them."""

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from armdyn.dynamics import Dynamics
from armdyn.optimal.bound.enclosure import terms_over
from armdyn.optimal.bound.interval import Interval
from optimal.bound.arms import ARMS, drawn

ROUNDING = 1e-11
"""Of Pinocchio's own numbers, in kg m² and N m: some hundred operations on numbers below a hundred."""


@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize("radius", [0.0, 0.01, 0.3])
def test_terms_contain_pinocchios_values(arm, radius):
    robot = ARMS[arm]()
    model, dynamics, rng = robot.model, Dynamics(robot), np.random.default_rng(0)
    middle = rng.uniform(-1.5, 1.5, (5, robot.nv))
    boxes = Interval(middle - radius, middle + radius)
    terms = terms_over(dynamics, boxes)
    q_symbol = ca.SX.sym("q", robot.nv)
    slope = ca.Function("slope", [q_symbol], [ca.jacobian(ca.vec(dynamics.crba(q_symbol)), q_symbol)])
    rows, columns = np.tril_indices(robot.nv)
    for _ in range(40):
        q = drawn(rng, boxes)
        share = (q - boxes.centre) / np.where(boxes.radius > 0, boxes.radius, 1.0)
        for i in range(len(q)):
            full = robot.configuration(q[i])
            inertia = np.array(pin.crba(model, model.createData(), full))
            inertia = np.triu(inertia) + np.triu(inertia, 1).T
            gravity = pin.computeGeneralizedGravity(model, model.createData(), full)
            inertia_derivatives = np.array(slope(q[i])).reshape(robot.nv, robot.nv, robot.nv)
            linear = np.einsum("kab,k->ab", terms.inertia_gradient[i].lower, share[i])
            fall = np.einsum("ka,k->a", terms.gravity_gradient[i].lower, share[i])
            for part, value in (
                (terms.inertia[i], inertia - linear),
                (terms.gravity[i], gravity - fall),
                (terms.inertia_derivatives[i], inertia_derivatives[rows, columns]),
            ):
                assert np.all(part.lower <= value + ROUNDING) and np.all(value <= part.upper + ROUNDING)
