"""Solved cycles against all branches and all orders, one by one."""

import re
from dataclasses import replace
from itertools import pairwise, permutations, product

import numpy as np
import pytest

import armdyn as ad
from armdyn.cycle.summary import cycle_summary
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.errors import CycleError
from armdyn.models.scene.collision import Clearance
from cycles import HERE, THERE, down, planar, planar_solved

QUICK = ad.MinimumTimeOptions(search="quick", bound=False)


def fastest(robot, a, b):
    """Duration of the fastest motion between two positions [s]."""
    return ad.solve_minimum_time(ad.MinimumTimeProblem(robot, q_start=a, q_goal=b), QUICK).duration


@pytest.mark.slow
def test_the_cycle_of_rr_is_the_best_of_its_four_ways():
    cycle, solved = planar(), planar_solved()
    assert solved.usable
    assert solved.success
    robots = [leg.robot for leg in cycle.moves]
    here, there = (
        ad.MinimumTimeProblem(cycle.robot, q_start=[0.1, 0.2], goal_pose=ad.GoalPose(cycle.robot.tip, place)).goals
        for place in (HERE, THERE)
    )
    assert len(here) == len(there) == 2

    start = np.array([0.1, 0.2])
    begins, ends = ([fastest(robots[0], start, a) for a in here], [fastest(robots[2], b, start) for b in there])
    ways = [
        begin + fastest(robots[1], a, b) + end
        for (begin, a), (end, b) in product(zip(begins, here, strict=True), zip(ends, there, strict=True))
    ]
    assert solved.duration == pytest.approx(min(ways) + 0.3, abs=1e-6)
    assert max(ways) > min(ways) + 0.01  # the choice matters


@pytest.mark.slow
def test_a_part_that_is_inside_what_it_may_touch_is_not_said_to_touch_it():
    solved = planar_solved()
    inside = Clearance(-0.06, 0.0, "bolt", "shelf", sure=True)
    legs = tuple(replace(leg, solution=replace(leg.solution, clearance=inside)) for leg in solved.legs)
    checks = cycle_summary(replace(solved, legs=legs), solved.cycle, ())["checks"]
    assert [one["said"] for one in checks if one["name"] == "clear of obstacles"] == [
        "'bolt' is 60.0 mm inside 'shelf'"
    ]
    assert re.fullmatch("within .* rad, each with its payload", checks[1]["said"])


@pytest.mark.slow
def test_the_whole_cycle_is_one_motion_that_each_piece_s_own_arm_repeats():
    solved = planar_solved()
    motion = solved.trajectory
    assert motion.duration == pytest.approx(solved.duration, abs=1e-9)
    assert [piece.name for piece in motion.pieces] == [
        "to the bolt",
        "grasp bolt",
        "to the hole",
        "release bolt",
        "return",
    ]
    assert [piece.load.mass for piece in motion.pieces] == [0, 0.1, 0.1, 0, 0]
    assert [piece.event for piece in motion.pieces] == ["", "grasp", "", "release", ""]
    arms = {leg.robot.model_hash: leg.robot for leg in solved.cycle.moves}
    for part in motion.split():
        arm = arms[part.own_pieces[0].model_hash]
        start, end = part.q[0], part.q[-1]
        if np.array_equal(part.q, np.broadcast_to(start, part.q.shape)):  # a rest
            np.testing.assert_allclose(part.tau[0], inverse_dynamics(arm)(start, 0 * start, 0 * start), atol=1e-9)
        else:
            again = ad.replay_torques(arm, part)
            np.testing.assert_allclose(again.q[-1], end, atol=1e-6)
    np.testing.assert_allclose(motion.q[-1], motion.q[0], atol=1e-5)


def test_moves_that_count_as_landed_are_joined():
    solved = planar_solved()
    solution = solved.legs[1].solution
    motion = solution.trajectory
    ends = motion.v.copy()
    ends[-1] += 0.01  # rad/s: such a move is usable
    late = replace(solved.legs[1], solution=replace(solution, trajectory=replace(motion, v=ends)))
    whole = replace(solved, legs=(solved.legs[0], late, solved.legs[2])).trajectory
    assert whole.duration == pytest.approx(solved.duration, abs=1e-9)


def test_a_cycle_says_its_verdict():
    said = str(planar_solved())
    assert "3 moves" in said
    for what, part in planar_solved().decides[:2]:
        assert f"{what} ({100 * part:.3g} %)" in said  # a share, not a bound, which is rounded up
    assert "rests of 0.3 s" in said
    assert "rr" in repr(planar_solved())


@pytest.mark.slow
def test_a_free_order_is_the_best_of_all_orders():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    places = [(1.0, 0.3), (-0.5, 0.4), (0.4, -0.8)]
    steps = [step for k, q in enumerate(places) for step in (ad.Move(q, name=f"hole {k}"), ad.Wait(0.05))]
    solved = ad.solve_cycle(ad.Cycle(robot, start=[0.1, 0.2], steps=steps, closed=True, order="free"), QUICK)
    stops = [(0.1, 0.2), *places]
    times = {(a, b): fastest(robot, a, b) for a, b in permutations(stops, 2)}
    given = [
        sum(times[way] for way in pairwise([stops[0], *order, stops[0]])) + 3 * 0.05 for order in permutations(places)
    ]
    assert solved.duration == pytest.approx(min(given), abs=1e-6)
    assert max(given) > min(given) + 0.01
    assert solved.legs[-1].leg.name == "return"


@pytest.mark.slow
def test_a_free_order_is_as_fast_as_if_it_were_given():
    """A UR5's joints make whole turns, which are no branches while the order is free: 3.105 s without them."""
    robot, random = ad.Robot.from_library("ur5"), np.random.default_rng(9721)
    steps = []
    for _ in range(3):
        turn, place = ad.Dynamics(robot).frame_placement(random.uniform(-2, 2, 6), robot.tip)
        pose = np.vstack([np.column_stack([turn, place]), [0, 0, 0, 1]])
        steps.append(ad.Move(ad.GoalPose(robot.tip, pose)))
    solved = ad.solve_cycle(ad.Cycle(robot, start="home", steps=steps, closed=True, order="free"), QUICK)
    assert solved.usable
    assert solved.cycle.order == "given"
    assert solved.duration == pytest.approx(ad.solve_cycle(solved.cycle, QUICK).duration, rel=1e-6)
    assert solved.duration < 2.75


def test_a_cycle_in_which_every_branch_touches_something_says_where():
    cycle = planar(obstacles=[ad.Sphere(HERE, 0.02)])
    solved = ad.solve_cycle(cycle, QUICK)
    assert not solved.usable
    assert solved.status == "infeasible"
    assert solved.message.startswith("step 1 (to the bolt): at the goal, ")
    assert np.isnan(solved.duration)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("passed", "said"),
    [
        ({"via": [(0.4, 0.2, 0.3, 0.2)]}, "via[0] is wider than its leg: the goal lies in it"),
        ({"via": [(2.4, 0.2, 0.3, 0.01)]}, "via[0]: frame 'ee_link' of ur5 cannot reach"),
        ({"retreat": 1.2}, "the far end of its retreat of 1.2 m is out of reach: frame 'ee_link'"),
        ({"approach": 1.2}, "the far end of its approach of 1.2 m is out of reach: frame 'ee_link'"),
    ],
)
def test_an_impossible_path_is_reported_at_once(passed, said):
    """A UR5 has thousands of pairs of branches with their whole turns: not each of them is computed."""
    robot = ad.Robot.from_library("ur5")
    here, there = (ad.GoalPose(robot.tip, down(0.4, y, 0.2)) for y in (-0.2, 0.2))
    via = [ad.GoalPose(robot.tip, down(*at), tolerance=[wide] * 6) for *at, wide in passed.get("via", ())]
    steps = [ad.Move(here, name="here"), ad.Move(there, **{**passed, "via": via}, name="there")]
    cycle = ad.Cycle(robot, start=[0.0, -1.2, 1.5, -1.87, -1.57, 0.0], steps=steps)
    with pytest.raises(CycleError, match=re.escape(f"step 2 (there): {said}")):
        ad.solve_cycle(cycle, QUICK)


@pytest.mark.slow
def test_without_a_bound_none_is_proven():
    solved = ad.solve_cycle(planar(), QUICK)
    assert solved.duration == pytest.approx(planar_solved().duration, abs=1e-9)
    assert solved.lower_bound is None
    assert solved.gap is None
    assert planar_solved().lower_bound > 0


def test_a_release_without_a_rest_at_the_end_is_an_event_all_the_same():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("r"))
    steps = [ad.Grasp(ad.Payload(mass=0.1, name="bolt")), ad.Move([0.5], name="there"), ad.Release(dwell=0)]
    solved = ad.solve_cycle(ad.Cycle(robot, start=[0.0], steps=steps), QUICK)
    motion = solved.trajectory
    assert [(piece.event, piece.load.mass) for piece in motion.pieces] == [("grasp", 0.1), ("release", 0)]
    assert motion.duration == pytest.approx(solved.duration, abs=2e-6)
