"""The policy as a table: what depends on the kind of problem, and that every number says why."""

import math

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.task.policy import Policy
from armdyn.optimal.task.policy.tuned import rows
from problems import paper_problem

UR5 = {"q_start": [0, -1, 1, -1, -1.5, 0], "q_goal": [-1.5, -1.8, 1.6, -0.4, 0.3, 1.0]}
BALL = ad.Sphere((0.3, 0.0, -0.1), 0.05)


def problem(kind):
    if kind == "ur5":
        return ad.MinimumTimeProblem(ad.Robot.from_library("ur5"), **UR5)
    arm, _, more = kind.partition(" ")
    extra = {
        "": {},
        "ball": {"obstacles": [BALL]},
        "jerk": {"jerk_limit": 1e5},
        "effort": {"effort_weight": 1.0},
        "via": {"via": [np.zeros(len(arm))]},
    }
    return paper_problem(arm, **extra[more])


TABLE = {
    # kind: starts, dynamics, condensed, graded, tie, flat, linear, again, refined, kept
    "r": (1, "forward", True, False, 0.0, None, False, False, 4, None),
    "rr": (16, "forward", True, False, 0.0, None, False, True, 4, None),
    "rrr": (40, "forward", True, False, 0.0, None, False, True, 4, None),
    "rr ball": (12, "forward", False, False, 0.0, 1e-4, False, False, 4, None),
    "rr jerk": (16, "forward", False, False, 0.0, 1e-4, True, True, 4, None),
    "rr via": (16, "forward", False, False, 0.0, None, False, True, 4, None),
    "rr effort": (16, "forward", True, False, 0.0, None, False, True, 4, None),
    "ur5": (4, "inverse", False, True, 1e-2, 1e-5, False, False, 2, 1e-6),
}


@pytest.mark.parametrize("kind", TABLE)
def test_what_depends_on_the_kind_of_problem(kind):
    policy = Policy.of(problem(kind))
    program, search = policy.program, policy.search
    found = (
        search.starts, program.dynamics, program.condensed, program.graded, program.tie,
        program.flat, program.linear, search.again, search.refined, program.kept,
    )  # fmt: skip
    assert found == TABLE[kind]


def test_every_number_says_its_unit_its_reason_and_its_cases():
    table = list(Policy.of(problem("rr")).rows())
    names = [name for name, *_ in table]
    assert len(names) == len(set(names)) > 100
    for name, value, unit, why, cases in table:
        assert unit and why and cases, name
        assert value is None or isinstance(value, (bool, int, float, str, tuple)), name
        assert not isinstance(value, float) or math.isfinite(value), name


def test_a_number_is_changed_in_a_copy():
    policy = Policy.of(problem("rr"))
    other = policy.changed("search", starts=3)
    assert (other.search.starts, policy.search.starts) == (3, 16)
    assert other.program == policy.program


def test_the_scheme_is_the_options_unless_they_leave_it_open():
    policy = Policy.of(problem("rr jerk"))
    assert policy.scheme(ad.MinimumTimeOptions()).control == "linear"  # a jerk limit forbids jumps
    chosen = ad.MinimumTimeOptions(dynamics="inverse", method="radau3", compile=False)
    scheme = Policy.of(problem("rr")).scheme(chosen)
    assert (scheme.dynamics, scheme.method, scheme.control, scheme.compile) == ("inverse", "radau3", "constant", False)


def test_what_is_no_group_has_no_rows():
    with pytest.raises(TypeError, match="no group"):
        list(rows(1.0))
