"""Exciting motions: within limits, clear, and better conditioned than random ones."""

import numpy as np
import pytest

from armdyn.errors import ProblemError
from armdyn.identification import ExcitingOptions, Log, exciting_motion, identify
from armdyn.models import Box, ControllerPreset, Payload, Plane
from armdyn.models.scene.collision import CollisionModel
from armdyn.models.scene.proof_of_clearance import prove_clearance
from oracles import robot_named


def test_it_rests_at_both_ends_and_keeps_margin_and_limits():
    robot = robot_named("ur5")
    motion = exciting_motion(robot, 6.0, ExcitingOptions(generations=10, margin=0.7))
    assert not np.any(motion.v[[0, -1]]) and motion.duration == pytest.approx(6.0)
    assert np.all(np.abs(motion.v) <= 0.7 * robot.limits.velocity + 1e-9)
    assert np.all(np.abs(motion.tau) <= 0.7 * robot.limits.effort_upper + 1e-9)
    assert ControllerPreset.named("ur5").check(motion).ok


@pytest.mark.slow
def test_it_is_better_conditioned_than_random_motions():
    robot = robot_named("rrr")
    random, best = (
        exciting_motion(robot, 5.0, ExcitingOptions(candidates=count, generations=generations, what="payload"))
        for count, generations in ((1, 0), (10, 100))
    )
    conditions = [identify(robot, Log.of(one), "payload").condition for one in (random, best)]
    assert conditions[1] < 0.7 * conditions[0]


@pytest.mark.slow
def test_it_is_clear_of_obstacles():
    robot, table = robot_named("ur5"), Plane((0, 0, -0.05), (0, 0, 1))
    motion = exciting_motion(
        robot, 4.0, ExcitingOptions(generations=3, candidates=20, obstacles=[table], self_collision=True)
    )
    nearest, _ = prove_clearance(CollisionModel(robot, [table], True), motion, 0.005)
    assert nearest.sure and nearest.distance >= 0.005
    # The upper arm cannot keep away from this plane; it may touch it.
    near = {"candidates": 1, "generations": 0, "obstacles": [Plane((0, 0, 0.05), (0, 0, 1), name="bench")]}
    with pytest.raises(ProblemError, match="none of 1 motions"):
        exciting_motion(robot, 4.0, ExcitingOptions(**near))
    allowed = [(link, "bench") for link in ("base_link", "shoulder_link", "upper_arm_link", "forearm_link")]
    allowed += [(f"wrist_{k}_link", "bench") for k in (1, 2, 3)]
    assert exciting_motion(robot, 4.0, ExcitingOptions(**near, allowed_contacts=allowed)).duration == 4.0


def test_impossible_values_are_refused():
    robot = robot_named("rrr")
    with pytest.raises(ProblemError, match="margin is 2"):
        ExcitingOptions(margin=2)
    with pytest.raises(ProblemError, match=r"duration is 0\.5"):
        exciting_motion(robot, 0.5)
    with pytest.raises(ProblemError, match="none of 2 motions"):
        exciting_motion(robot.with_payload(Payload(mass=100)), 2.0, ExcitingOptions(candidates=2))
    with pytest.raises(ProblemError, match="obstacles"):
        ExcitingOptions(obstacles=["box"])
    assert ExcitingOptions(obstacles=[Box((1, 1, 1), (0, 0, 0))]).obstacles
    with pytest.raises(ProblemError, match=r"allowed_contacts\[0\]: no link of rrr and no obstacle is named 'arm'"):
        exciting_motion(robot, 2.0, ExcitingOptions(allowed_contacts=[("arm", "box")]))
