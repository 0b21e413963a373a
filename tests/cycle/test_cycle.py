"""Cycles as values: stops, payloads, and refused arguments."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import CycleError, ProblemError
from cycles import HERE, PART, planar


def test_a_cycle_rests_at_its_start_and_after_every_move():
    cycle = planar()
    assert [stop.name for stop in cycle.stops] == ["start", "to the bolt", "to the hole", "return"]
    assert [stop.rests for stop in cycle.stops] == [(), (2,), (4,), ()]
    assert [leg.robot.payload for leg in cycle.moves] == [None, PART, None]
    assert cycle.dwell == pytest.approx(0.3)
    assert "4 steps, closed" in repr(cycle)


def test_a_move_back_is_added_only_where_the_last_one_ends_elsewhere():
    home = ad.Move([0.1, 0.2], name="home")
    assert [leg.name for leg in planar(steps=[*planar().steps, home]).moves] == ["to the bolt", "to the hole", "home"]
    assert [leg.name for leg in planar(closed=False).moves] == ["to the bolt", "to the hole"]


def test_steps_have_names_and_numbers():
    robot = planar().robot
    steps = [
        ad.Wait(0.1),
        ad.Move([1, 1]),
        ad.Grasp(PART),
        ad.Move([1, 0]),
        ad.Release(PART),
        ad.Move([0, 0], name="home"),
    ]
    cycle = ad.Cycle(robot, start=[0, 0], steps=steps)
    assert [cycle.name_of(k) for k in range(1, 7)] == ["wait", "move", "grasp bolt", "move", "release bolt", "home"]
    assert cycle.stops[0].rests == (1,)


@pytest.mark.parametrize(
    ("steps", "closed", "said"),
    [
        ([ad.Move([1, 1]), ad.Release()], False, r"step 2 \(release\): the arm carries nothing"),
        (
            [ad.Move([1, 1]), ad.Grasp(PART), ad.Grasp(PART)],
            False,
            r"step 3 \(grasp bolt\): the arm still carries 'bolt'",
        ),
        ([ad.Move([1, 1]), ad.Grasp(PART)], True, r"step 2 \(grasp bolt\): the cycle is closed, .* still holds 'bolt'"),
        ([ad.Move([1, 1]), ad.Grasp(PART), ad.Release(ad.Payload(mass=1, name="nut"))], False, "'bolt', not 'nut'"),
        ([ad.Move("hoem", name="back")], False, r"step 1 \(back\): .*'hoem'"),
        ([ad.Move([1, 1, 1])], False, r"step 1 \(move\): .*3"),
    ],
)
def test_steps_that_do_not_follow_are_refused_with_number_and_name(steps, closed, said):
    with pytest.raises(CycleError, match=said):
        ad.Cycle(planar().robot, start=[0, 0], steps=steps, closed=closed)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"steps": []}, "one Move at least"),
        ({"steps": ["pick"]}, r"steps\[0\] is 'pick'"),
        ({"steps": [ad.Move]}, r"steps\[0\]"),
        ({"order": "any"}, "'given', 'free'"),
        ({"closed": 1}, "closed"),
        ({"start": "nowhere"}, "start of the cycle: .*'nowhere'"),
        ({"obstacle": []}, "no condition 'obstacle'; did you mean 'obstacles'"),
        ({"q_goal": [0, 0]}, "no condition 'q_goal'"),
    ],
)
def test_wrong_arguments_are_refused(changes, said):
    with pytest.raises(ProblemError, match=said):
        planar(**changes)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ad.Move([0, 0], approach=-0.1), "approach is -0.1 m"),
        (lambda: ad.Straight(0.1, axis="w"), "axis of a straight segment is 'w'"),
        (lambda: ad.Straight(0.1, deviation=0), "deviation"),
        (lambda: ad.Move([0, 0], speed=0), "speed"),
        (lambda: ad.Grasp(1.0), "part of a grasp"),
        (lambda: ad.Wait(-1), "seconds of a wait"),
        (lambda: ad.Release(dwell=np.nan), "dwell"),
    ],
)
def test_wrong_steps_are_refused(make, said):
    with pytest.raises(ProblemError, match=said):
        make()


def test_jobs_go_from_one_empty_hand_to_the_next():
    there = ad.Move([1, 1])
    steps = [ad.Wait(1), there, ad.Grasp(PART), ad.Move([1, 0]), ad.Release(), ad.Wait(1), ad.Move([0, 1]), ad.Wait(2)]
    cycle = ad.Cycle(planar().robot, start=[0, 0], steps=steps, order="free")
    assert cycle.jobs == ((2, 3, 4, 5, 6), (7, 8))
    turned = cycle.reordered((1, 0))
    assert turned.steps == (steps[0], *steps[6:], *steps[1:6])
    assert turned.order == "given"
    closed = ad.Cycle(planar().robot, start=[0, 0], steps=[*steps, ad.Move([0, 0])], closed=True, order="free")
    assert closed.jobs == ((2, 3, 4, 5, 6), (7, 8))  # the way home stays the last


def test_a_goal_out_of_reach_is_reported_with_its_step():
    robot = planar().robot
    far = ad.Move(ad.GoalPose(robot.tip, (3.0, 0.0, 0.0)), name="to the bin")
    with pytest.raises(CycleError, match=r"step 2 \(to the bin\): .*cannot reach"):
        ad.solve_cycle(ad.Cycle(robot, start=[0, 0], steps=[ad.Move([1, 1]), far]))


def test_a_part_that_is_too_heavy_is_reported_with_its_step():
    robot = planar().robot
    steps = [ad.Move(ad.GoalPose(robot.tip, HERE)), ad.Grasp(ad.Payload(mass=50.0, name="anvil")), ad.Move([0, 0])]
    with pytest.raises(
        CycleError, match=r"step 2 \(grasp anvil\): the arm cannot rest with 'anvil' of 50 kg: joint .*; so"
    ):
        ad.solve_cycle(ad.Cycle(robot, start=[0.1, 0.2], steps=steps))


def test_a_move_whose_way_back_is_added_is_a_job():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    there, here = ad.Move([1.0, 0.5], name="there"), [0.1, 0.2]
    assert ad.Cycle(robot, start=here, steps=[there], closed=True).jobs == ((1,),)
    assert ad.Cycle(robot, start=here, steps=[there, ad.Move(here)], closed=True).jobs == ((1,),)
    assert ad.Cycle(robot, start=here, steps=[there, ad.Wait(0.1), ad.Move([1.0, 0.0])], closed=True).jobs == (
        (1, 2),
        (3,),
    )


def _grasped(goal: str, frame: str | None) -> ad.Cycle:
    """A UR5, whose tip ee_link is turned against tool0, takes a part at a goal pose; then it rests, and releases it."""
    part = ad.Payload(mass=1.0, com=(0.0, 0.0, 0.05), frame=frame, name="bar")
    move = ad.Move(ad.GoalPose(goal, (0.4, 0.2, 0.4)))
    steps = [move, ad.Wait(0.1), ad.Grasp(part), ad.Move([1, -1, 1, 0, 0, 0]), ad.Release(part)]
    return ad.Cycle(ad.Robot.from_library("ur5"), start=[0, -1, 1, 0, 0, 0], steps=steps)


@pytest.mark.parametrize("frame", [None, "tool0"])
def test_a_part_is_in_the_frame_of_the_goal_pose_where_it_is_grasped(frame):
    arm = _grasped("tool0", frame).moves[1].robot
    held, tool = arm.model.inertias[6], arm.frame("tool0")
    bare = ad.Robot.from_library("ur5").model.inertias[6]
    com = (held.mass * held.lever - bare.mass * bare.lever) / 1.0
    np.testing.assert_allclose(com, tool.placement.act(np.array([0.0, 0.0, 0.05])), atol=1e-12)  # rounding


@pytest.mark.parametrize(("frame", "goal"), [(None, "tool0"), ("tool0", "ee_link"), ("ee_link", "tool0")])
def test_a_part_in_another_frame_than_the_goal_pose_of_its_release_is_refused(frame, goal):
    """The part would stand there turned, since the tip ee_link is turned against tool0."""
    part, there = ad.Payload(mass=1.0, frame=frame, name="bar"), ad.Move(ad.GoalPose(goal, (0.4, 0.2, 0.4)))
    here = [0, -1, 1, 0, 0, 0]

    def cycle(*last):
        steps = [ad.Grasp(part), there, *last]
        return ad.Cycle(ad.Robot.from_library("ur5"), start=here, steps=steps, closed=False)

    own = frame or "ee_link"
    with pytest.raises(
        CycleError, match=rf"step 3 \(release bar\): .* in frame '{own}', but is released where '{goal}'"
    ):
        cycle(ad.Release(part))
    assert len(cycle(ad.Move(ad.GoalPose(own, (0.4, 0.2, 0.5))), ad.Release(part)).moves) == 2


@pytest.mark.parametrize("frame", ["ee_link", "wrist_3_link"])
def test_a_part_in_another_frame_than_the_goal_poses_is_refused(frame):
    with pytest.raises(CycleError, match=rf"step 3 \(grasp bar\): part 'bar' is placed in frame '{frame}', .* 'tool0'"):
        _grasped("tool0", frame)
