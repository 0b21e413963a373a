"""Unknowns of a program and the motion that they stand for."""

import numpy as np
import pytest

from armdyn.dynamics import Dynamics
from armdyn.optimal.program.assembly import build_nlp
from armdyn.optimal.program.unknowns import Scales, to_trajectory, to_unknowns
from armdyn.optimal.task.scheme import Scheme
from armdyn.trajectory import Trajectory
from problems import paper_arm

SCHEMES = [
    Scheme(control=control, dynamics=form) for control in ("linear", "constant") for form in ("forward", "inverse")
]


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_unknowns_and_back(scheme):
    random = np.random.default_rng(1)
    t = np.linspace(0, 1, 7)
    tau = np.repeat(random.normal(size=(1, 2)), 7, axis=0)  # constant, so that every control can say it
    motion = Trajectory(t, random.normal(size=(7, 2)), random.normal(size=(7, 2)), tau)
    layout = build_nlp(Dynamics(paper_arm("rr"), free_last_body=True), scheme, 6).layout
    scales, fractions = Scales(1.0, 2.0, 3.0, np.array([3.0, 4.0])), np.full(6, 1 / 6)
    back = to_trajectory(to_unknowns(motion, layout, fractions, scales), layout, fractions, scales, ())
    # Scaling there and back: an ulp or two.
    np.testing.assert_allclose(back(t).q, motion.q, atol=1e-14)
    np.testing.assert_allclose(back(t).v, motion.v, atol=1e-12)
    np.testing.assert_allclose(back(t).tau, motion.tau, atol=1e-14)
