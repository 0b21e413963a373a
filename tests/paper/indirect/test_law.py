"""Laws as values: keys of caches, refused as names, and one that the core does not know."""

import pickle
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.paper import IndirectOptions, solve_indirect
from armdyn.paper.indirect import MINIMUM, TorqueLaw
from armdyn.paper.indirect.canonical import canonical_system
from oracles import robot_named
from problems import cart

FREE = IndirectOptions(bounded=False)


def dearer(symbols):
    return -symbols.switching / (4 * symbols.weight)


def time_and_four_efforts(symbols):
    return 1 + 2 * symbols.weight * ca.sumsqr(symbols.tau)


FOURFOLD = TorqueLaw("fourfold", dearer, time_and_four_efforts, minimises=False)
"""The law of 4 w."""


def test_equal_laws_have_one_system():
    assert hash(replace(MINIMUM)) == hash(MINIMUM)
    rr = robot_named("rr")
    assert canonical_system(rr, replace(MINIMUM)) is canonical_system(rr)
    assert canonical_system(rr, FOURFOLD) is not canonical_system(rr)


def test_it_goes_to_other_processes():
    options = IndirectOptions()
    assert pickle.loads(pickle.dumps(options)) == options
    assert options.law is MINIMUM


@pytest.mark.parametrize("name", ["minimum", "printed", None])
def test_a_name_is_refused(name):
    with pytest.raises(ProblemError, match=r"a value of the class Law, not a name.*MINIMUM"):
        IndirectOptions(law=name)


def test_another_law_is_solved_and_commented():
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], effort_weight=0.5)
    law = replace(FOURFOLD, seed_weight=lambda problem: 2.0, remark="it has to")
    found = solve_indirect(problem, options=replace(FREE, law=law))
    assert found.success, found.message
    # Minimum of T + 6 (4 w) d²/T³, with w = ½ and d = 2 m; H with its L is 0.
    assert found.duration == pytest.approx((18 * 2.0 * 4) ** 0.25, rel=1e-9)
    assert found.hamiltonian_spread < 1e-9
    assert "H varies by" in found.message and found.message.endswith("it has to")
    # The law does not minimise the problem's J, and the message says so.
    t, u = found.trajectory.t, found.trajectory.tau[:, 0]
    assert found.cost == pytest.approx(found.duration + 0.25 * np.trapezoid(u**2, t), rel=1e-3)  # a sum over samples
