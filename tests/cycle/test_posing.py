"""Problems of moves with straight segments."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.cycle.posing import problem_of
from armdyn.models.scene.reaching import frame_placement
from cycles import down


@pytest.mark.parametrize(("axis", "sign"), [("z", 1.0), ("-z", -1.0)])
def test_an_approach_goes_along_its_axis_and_a_retreat_against_it(axis, sign):
    robot = ad.Robot.from_library("ur5")
    goal = ad.GoalPose(robot.tip, down(0.4, 0.2, 0.3))
    line = ad.Straight(0.05, axis=axis)
    cycle = ad.Cycle(robot, start="home", steps=[ad.Move(goal, approach=line, retreat=line)])
    end = ad.MinimumTimeProblem(robot, q_start="home", goal_pose=goal).goals[0]
    problem = problem_of(cycle, cycle.moves[0], robot.pose("home"), end)
    begin = frame_placement(robot, robot.tip, robot.pose("home"))
    retreated, before = (one.pose for one in problem.via_regions.values())
    np.testing.assert_allclose(begin.actInv(retreated.translation), [0, 0, -0.05 * sign], atol=1e-12)
    np.testing.assert_allclose(before.translation, [0.4, 0.2, 0.3 + 0.05 * sign], atol=1e-9)


@pytest.mark.slow
def test_straight_segments_are_straight_between_their_ends():
    robot = ad.Robot.from_library("ur5")
    here, there = (ad.GoalPose(robot.tip, down(0.4, y, 0.3)) for y in (-0.1, 0.1))
    start = ad.MinimumTimeProblem(robot, q_start="home", goal_pose=here).goals[0]
    line = ad.Straight(0.025)
    cycle = ad.Cycle(robot, start=start, steps=[ad.Move(there, retreat=line, approach=line)])
    solved = ad.solve_cycle(cycle, ad.MinimumTimeOptions(search="quick", bound=False, compile=False))
    assert solved.usable, solved.message
    (leg,) = solved.legs
    first, last = leg.solution.via_times
    motion = leg.solution.trajectory
    for times, pose in (
        (np.linspace(0, first, 200), here.pose),
        (np.linspace(last, motion.duration, 200), there.pose),
    ):
        off = [pose.actInv(frame_placement(robot, robot.tip, motion(t).q)) for t in times]
        assert max(np.hypot(*each.translation[:2]) for each in off) <= 0.5e-3 * (1 + 1e-3)
        turned = [np.arccos(np.clip((np.trace(each.rotation) - 1) / 2, -1, 1)) for each in off]
        assert max(turned) <= 0.0087 * (1 + 1e-3)
    assert frame_placement(robot, robot.tip, motion(first).q).translation[2] == pytest.approx(0.325, abs=1e-5)


@pytest.mark.parametrize("closed", [True, False])
def test_a_move_to_where_the_arm_is_takes_no_detour(closed):
    """Another branch of the same pose was chosen: the arm turned over with its part, and nothing was said."""
    robot = ad.Robot.from_library("ur5")
    here, part = ad.GoalPose(robot.tip, down(0.4, 0.2, 0.3)), ad.Payload(mass=1.0, name="part")
    q = ad.MinimumTimeProblem(robot, q_start="home", goal_pose=here).goals[0]
    for start, steps, at in (
        ("home", [ad.Move(here), ad.Grasp(part), ad.Move(here, name="again"), ad.Release()], "step 3 .again."),
        (q, [ad.Move(here), ad.Move("home")], "step 1 .move."),
        (q, [ad.Wait(1.0), ad.Move(q), ad.Move("home")], "step 2 .move."),
    ):
        cycle = ad.Cycle(robot, start=start, steps=steps, closed=closed)
        with pytest.raises(ad.CycleError, match=f"{at}: the arm is there already: leave the step out"):
            ad.solve_cycle(cycle)
    there_and_back = ad.Cycle(robot, start=q, steps=[ad.Move(q, via=["home"])])
    assert problem_of(there_and_back, there_and_back.moves[0], q, q).via
