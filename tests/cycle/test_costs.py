"""Costs of a cycle's conditions against cycles without them."""

import pytest

import armdyn as ad
from armdyn.cycle.costs import _simpler
from armdyn.errors import ProblemError
from cycles import HERE, planar, planar_solved

QUICK = ad.MinimumTimeOptions(search="quick", bound=False)


@pytest.fixture(scope="module")
def costs():
    return {(cost.step, cost.condition): cost for cost in ad.cycle_costs(planar_solved(), QUICK)}


@pytest.mark.slow
def test_rests_cost_their_time(costs):
    assert costs[2, "its rest"].saved == 0.2
    assert costs[4, "its rest"].saved == 0.1


@pytest.mark.slow
def test_limits_cost_by_their_multipliers(costs):
    solved = planar_solved()
    most = next(name for name, _ in solved.decides if name != "rests")
    cost = costs[0, f"10 % more of {most}"]
    assert cost.about
    raised = solved.cycle.robot.limits.effort_upper * 1.01
    faster = solved.cycle.dwell + sum(
        ad.solve_minimum_time(leg.solution.problem.variant(effort_limit=raised), QUICK).duration for leg in solved.legs
    )
    named = [one for one in costs.values() if one.about]
    assert sum(one.saved for one in named) / 10 == pytest.approx(solved.duration - faster, rel=0.05)


@pytest.mark.slow
def test_the_nearest_branches_are_no_better(costs):
    assert costs[0, "taking the nearest branch at every stop"].saved <= 1e-9


@pytest.mark.slow
def test_planning_for_the_heaviest_payload_costs_the_loss_of_the_other_moves(costs):
    solved = planar_solved()
    loaded = solved.cycle.arms[2]
    total = solved.cycle.dwell
    for leg in solved.legs:
        start, goal = leg.solution.problem.poses
        total += ad.solve_minimum_time(ad.MinimumTimeProblem(loaded, q_start=start, q_goal=goal), QUICK).duration
    saved = costs[0, "planning every move for the heaviest payload"].saved
    assert saved == pytest.approx(solved.duration - total, abs=1e-6)
    assert saved < -0.01
    assert "-" in str(costs[0, "planning every move for the heaviest payload"])


@pytest.mark.slow
def test_a_stop_without_a_need_costs_the_time_that_passing_saves():
    robot = planar().robot
    between = ad.Move([0.5, 0.3], name="between")
    solved = ad.solve_cycle(ad.Cycle(robot, start=[0, 0], steps=[between, ad.Move([1, 0.5])]), QUICK)
    (cost,) = [one for one in ad.cycle_costs(solved, QUICK) if one.condition == "the stop at its end"]
    through = ad.MinimumTimeProblem(robot, q_start=[0, 0], q_goal=[1, 0.5], via=[[0.5, 0.3]])
    assert cost.step == 1
    assert cost.saved == pytest.approx(solved.duration - ad.solve_minimum_time(through, QUICK).duration, abs=1e-6)
    assert cost.saved > 0.01


def test_costs_are_of_usable_cycles():
    broken = ad.solve_cycle(planar(obstacles=[ad.Sphere(HERE, 0.02)]), QUICK)
    with pytest.raises(ProblemError, match="usable"):
        ad.cycle_costs(broken)


def test_each_condition_of_a_move_is_left_out_once():
    move = ad.Move([1.0, -0.4], via=([0.2, 0.1], [0.4, 0.3]), retreat=0.02, approach=0.03, speed=0.5)
    simpler = dict(_simpler(move))
    assert list(simpler) == ["via 1", "via 2", "straight retreat", "straight approach", "speed of 0.5 m/s"]
    assert simpler["via 1"].via == move.via[1:] and simpler["via 2"].via == move.via[:1]
    assert simpler["straight retreat"].retreat is None and simpler["straight retreat"].approach == move.approach
    assert simpler["straight approach"].approach is None and simpler["straight approach"].speed == 0.5
    assert simpler["speed of 0.5 m/s"].speed is None and simpler["speed of 0.5 m/s"].via == move.via
