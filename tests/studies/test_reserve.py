"""Settled time against reserve: shapes, the choice, refused arguments."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.show.figures.loops import plot_reserves
from armdyn.studies.reserve import Settling
from problems import paper_arm, paper_problem


@pytest.fixture(scope="module")
def curve():
    return ad.reserve_curve(paper_problem("rr"), [ad.Lqr(), ad.ComputedTorque()], reserves=(0.0, 0.15), duration=1.0)


def test_it_equals_track(curve):
    # One row again, by hand: the motion that keeps 15 %, on the heaviest arm that rubs.
    row = next(row for row in curve.rows if row.reserve == 0.15 and isinstance(row.controller, ad.Lqr))
    problem = paper_problem("rr", reserve=0.15)
    motion = ad.solve_minimum_time(problem).trajectory
    assert row.duration == pytest.approx(motion.duration, rel=1e-8)
    run = ad.track(problem.robot, curve.solutions[0.15].trajectory, ad.Lqr(), curve.plants[-1], duration=1.0)
    assert row.settled[-1] == run.settled_time
    assert row.worst == max(row.settled) and row.mean == pytest.approx(np.mean(row.settled))


def test_a_reserve_costs_the_motion_and_helps_the_arm(curve):
    none, some = curve.of(curve.rows[0].controller)
    assert some.duration > none.duration
    assert some.worst < none.worst
    assert curve.best.reserve == 0.15


def test_six_likely_arms():
    robot = paper_arm("rr", 0.1)
    plants = ad.likely_plants(robot)
    masses = [plant.payload.mass for plant in plants]
    assert masses == pytest.approx([0.08, 0.1, 0.12] * 2)
    assert [plant.friction.present for plant in plants] == [False] * 3 + [True] * 3
    damping, coulomb = plants[-1].friction.per_joint(2)
    assert damping == pytest.approx([0.003] * 2) and coulomb == pytest.approx([0.06] * 2)  # of 3 N m
    by_hand = ad.Dynamics(paper_arm("rr", 0.08)).crba([0.3, 0.4])
    assert ad.Dynamics(plants[0]).crba([0.3, 0.4]) == pytest.approx(by_hand, rel=1e-12)
    assert len(ad.likely_plants(ad.Robot.from_spec(ad.ArmSpec.paper("rr")))) == 2


def test_feedback_has_the_problems_limits():
    # A problem with lesser limits than the robot's: the loop must not take more either.
    curve = ad.reserve_curve(paper_problem("rr", effort_limit=2.0), plants=[paper_arm("rr")], reserves=(0.2,))
    run = curve.rows[0].runs[0]
    assert np.abs(run.trajectory.tau).max() <= 2.0
    assert np.abs(curve.solutions[0.2].trajectory.tau).max() == pytest.approx(1.6)


def test_the_best_is_where_most_settle_and_then_the_soonest():
    row = Settling(0.0, ad.Lqr(), 0.2, (0.3, 0.4), ())
    rows = (row, replace(row, reserve=0.1, settled=(0.25, None)), replace(row, reserve=0.2, settled=(0.39, 0.39)))
    assert ad.ReserveCurve(rows, {}, ()).best.reserve == 0.2
    assert ad.ReserveCurve((), {}, ()).best is None
    assert rows[1].worst == np.inf and rows[1].facts()["worst"] is None and rows[1].facts()["settled"] == 1


@pytest.mark.parametrize("reserves", [(), (1.0,), (-0.1, 0.1), ("a",), (np.nan,)])
def test_reserves_out_of_range(reserves):
    with pytest.raises(ProblemError, match="reserves"):
        ad.reserve_curve(paper_problem("rr"), reserves=reserves)


def test_others_are_refused():
    with pytest.raises(ProblemError, match="problem"):
        ad.reserve_curve(paper_arm("rr"))
    with pytest.raises(ProblemError, match="controllers"):
        ad.reserve_curve(paper_problem("rr"), [ad.PidGains(1.0, 1.0, 1.0)], reserves=(0.1,))


def test_the_figure_says_where_not_all_settle(curve):
    rows = [row.facts() for row in curve.rows]
    rows[0] = rows[0] | {"worst": None, "mean": None, "settled": 4}
    figure = plot_reserves(rows, "two controllers")
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert "4 of 6" in texts and any(text.startswith("best: 0.15") for text in texts)
