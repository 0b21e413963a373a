"""Remedies: a line for each missing condition, and none for the others."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.answer.advice import advice
from armdyn.optimal.constraints.constraint import ConstraintReport
from armdyn.optimal.problem.status import Status, Violation
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import ON_CURVE, Certificate
from problems import paper_problem, solved

LANDED = Certificate(1e-9, 1e-9, 0.0)
FAST = Violation("velocity limit", "joint2", 0.05, 5.6e-4)


def said(certificate, kept=(), arcs=False, **options):
    problem = paper_problem("rr").variant(**options)
    followed = Task.of(problem).not_advised(Status.TIME_LIMIT)
    phases = solved("rr").phases if arcs else None
    own = {"problem": problem, "certificate": certificate, "constraint_reports": tuple(kept), "followed": followed}
    return advice(replace(solved("rr"), phases=phases, **own))


@pytest.mark.parametrize(
    ("certificate", "thing", "words"),
    [
        (Certificate(np.inf, np.inf, np.inf), "lands", ["no motion was found", "`starts`", "`time_limit`"]),
        (Certificate(0.2, 0.1, 0.0), "lands", ["does not reach the goal", "`max_intervals`", "`armature`"]),
        (replace(LANDED, limit_violation=5.6e-4, exceeded=FAST), "limits", ["velocity limit of joint2", "0.056 %"]),
        (replace(LANDED, limit_violation=5.6e-4), "limits", ["exceeds a limit"]),
    ],
)
def test_an_unusable_motion_must_become_usable_first(certificate, thing, words):
    lines = said(certificate)
    assert list(lines) == [thing]
    assert all(word in lines[thing] for word in words)


@pytest.mark.parametrize(
    ("options", "why"),
    [({"v_goal": [0.1, 0]}, "in flight"), ({"passive": ["joint2"], "q_goal": [0.1, -0.1]}, "no motor"), ({}, None)],
)
@pytest.mark.filterwarnings("ignore::armdyn.ArmdynWarning")
def test_why_a_motion_could_not_be_slowed_down(options, why):
    line = said(replace(LANDED, limit_violation=5.6e-4, exceeded=FAST), **options)["limits"]
    assert f"{why}" in line if why else "slowed down" not in line


def test_all_that_is_missing_of_usable_is_named():
    missed = ConstraintReport("obstacles", "", 1.0, ("touches",))
    lines = said(Certificate(0.2, 0.1, 5.6e-4), [missed, ConstraintReport("jerk limits", "")])
    assert list(lines) == ["lands", "limits", "conditions"]
    assert "obstacles" in lines["conditions"] and "jerk" not in lines["conditions"]


@pytest.mark.filterwarnings("ignore::armdyn.ArmdynWarning")
def test_a_load_that_the_motors_cannot_hold_is_the_reason_where_no_motion_was_found():
    line = said(Certificate(np.inf, np.inf, np.inf), effort_limit=0.1)["lands"]
    assert "cannot stay at the goal" in line and "`payload`" in line and "`starts`" not in line


def test_among_obstacles_another_path_may_help():
    options, missed = {"obstacles": [ad.Sphere((5, 5, 5), 0.1)]}, ConstraintReport("clearance", "", None, ("touches",))
    for line in (
        said(Certificate(np.inf, np.inf, np.inf), **options)["lands"],
        said(LANDED, [missed], **options)["conditions"],
    ):
        assert "`seed`" in line and "`clearance`" in line and "max_intervals" not in line


@pytest.mark.parametrize(
    ("certificate", "arcs", "options", "words"),
    [
        (LANDED, False, {}, "arcs were not resolved"),
        (LANDED, True, {}, "do not quite satisfy the optimality conditions"),
        (LANDED, False, {"jerk_limit": 1e3}, "not checked with jerk limits"),
        (replace(LANDED, goal_error=1e-5), True, {}, "more than 1e-6 off the goal"),
    ],
)
def test_why_it_is_no_extremal(certificate, arcs, options, words):
    assert words in said(certificate, arcs=arcs, **options)["extremal"]


def test_a_curve_with_a_gap_is_not_advised_to_become_extremal():
    gap = replace(LANDED, remark=ON_CURVE, lower_bound=1.0, gap=0.02)
    assert "faster motion" in said(gap)["gap"]
    assert "extremal" not in said(gap)
    assert "more `starts`" in said(replace(LANDED, remark=ON_CURVE))["extremal"]


@pytest.mark.parametrize(
    ("certificate", "options", "words"),
    [
        (LANDED, {"velocity_limit": np.inf}, "give `velocity_limit`"),
        (LANDED, {}, "ad.lower_bound(problem) gives one"),
        (LANDED, {"effort_weight": 1.0}, "`effort_weight`"),
        (replace(LANDED, goal_error=1e-5).bounded(1.0, 1.0), {}, "not proven"),
        (LANDED.bounded(1.0, 0.9), {}, "faster than the lower bound"),
        (LANDED.bounded(1.0, 1.7), {}, "weak where torque limits decide"),
        (LANDED.bounded(1.0, 1.02), {}, "a gap of 2 %"),
        (LANDED.bounded(1.0, 1.2), {"obstacles": [ad.Sphere((1, 0, 1), 0.1)]}, "the bound ignores obstacles, is by"),
    ],
)
def test_why_there_is_no_small_gap(certificate, options, words):
    assert words in said(certificate, **options)["gap"]


def test_options_that_change_nothing_are_not_advised():
    region = ad.GoalPose("tip", (0.3, 0.0, -0.1), tolerance=(0.02, 0, 0.02, 0, 0, 0))
    options = {"via": [region], "q_start": [-0.5, 0.3], "q_goal": [0.5, -0.3], "velocity_limit": 20.0}
    lines = [
        *said(Certificate(np.inf, np.inf, np.inf), **options).values(),
        *said(Certificate(0.2, 0.1, 5.6e-4), **options).values(),
        *said(replace(LANDED, remark=ON_CURVE), **options).values(),
        *said(replace(LANDED, remark=ON_CURVE).bounded(1.0, 1.02), **options).values(),
    ]
    assert "widen the limits or regions" in lines[0] and len(lines) == 6
    assert not any(name in line for line in lines for name in ("`starts`", "`search`", "`seed`", "`max_intervals`"))


def test_what_the_problem_has_already_is_not_advised():
    robot = paper_problem("rr").robot
    lands, unstable = Certificate(0.2, 0.1, 0.0), Certificate(0.2, 0.1, 0.0, replay="segments", growth=1e9)
    assert "`armature`" not in said(lands, robot=robot.with_armature(0.1))["lands"]
    assert "keep a `reserve`" in said(unstable)["lands"]
    assert "keep a larger `reserve`" in said(unstable, reserve=0.1)["lands"]
    ball = [ad.Sphere((5, 5, 5), 0.1)]
    line = said(Certificate(np.inf, np.inf, np.inf), obstacles=ball, clearance=0.0)["lands"]
    assert "`seed`" in line and "`clearance`" not in line


def test_met_conditions_have_no_advice():
    assert "extremal" not in said(solved("rr").certificate, arcs=True)
    assert "gap" not in said(LANDED.bounded(1.0, 1.0005))
