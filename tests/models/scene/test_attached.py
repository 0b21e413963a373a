"""Payloads and tools with shapes: placement, compared pairs, and tables."""

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import ProblemError, SpecError
from armdyn.models.scene.collision import CollisionModel
from armdyn.models.scene.obstacles import payload_entry, payload_from, tool_from
from oracles import robot_named
from problems import paper_arm

STICK = ad.Capsule((0, 0, 0), (0, 0, 0.4), 0.01)


def test_a_payload_keeps_its_place_in_its_frame():
    box = ad.Box((0.1, 0.1, 0.1), (0.2, 0, 0))
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), payload=ad.Payload(mass=0.1, shapes=[box], name="payload"))
    model = CollisionModel(robot, [ad.Sphere((0, 0, 1.2), 0.1, name="ball")])
    near = model.nearer([np.pi / 2, 0.0], np.inf)[0]  # upright, 0.484 m long: the box ends at 0.734 m
    assert (near.body, near.other) == ("payload", "ball")
    assert near.distance == pytest.approx(1.1 - 0.484 - 0.25, abs=1e-6)  # GJK's own tolerance


def test_a_tool_moves_the_tip_and_carries_the_payload():
    bare = robot_named("panda")
    tool = ad.Tool(mass=0.5, com=(0, 0, 0.1), tip=(0, 0, 0.2), shapes=[STICK], name="stick")
    robot = ad.Robot.from_library("panda", tool=tool, payload=ad.Payload(mass=1.0))
    assert (robot.tip, robot.options.tool.frame) == ("stick", bare.tip)
    end = bare.frame(bare.tip)
    np.testing.assert_allclose(robot.frame("stick").placement.translation, end.placement.act(np.array([0, 0, 0.2])))
    by_hand = bare.model.copy()
    for mass, z in ((0.5, 0.1), (1.0, 0.2)):
        by_hand.appendBodyToJoint(
            end.parentJoint, pin.Inertia(mass, np.array([0, 0, z]), 1e-12 * np.eye(3)), end.placement
        )
    q = np.array([0.1, 0.2, 0.3, -1.5, 0.2, 1.3, 0.4])
    gravity = pin.computeGeneralizedGravity(by_hand, by_hand.createData(), q)
    np.testing.assert_allclose(robot.holding_torque(q), gravity, atol=1e-9)  # [N m]
    emptied = robot.with_payload(None)
    assert emptied.tip == "stick" and [body.name for body in emptied.attached] == ["stick"]
    with pytest.raises(SpecError, match="has a frame 'panda_hand'"):
        ad.Robot.from_library("panda", payload=ad.Payload(mass=1.0, shapes=[STICK], name="panda_hand"))


def test_a_long_tool_is_compared_with_the_forearm_on_the_neighbouring_joint():
    # Along x, from where the upper arm ends: RR's second link and its payload hang on neighbouring joints.
    stick = ad.Capsule((-0.4, 0, 0.08), (-0.3, 0, 0.08), 0.01, name="stick")
    tool = ad.Tool(mass=0.01, tip=(0, 0, 0), shapes=[stick])
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), tool=tool)
    model = CollisionModel(robot, self_collision=True)
    assert ("link1", "tool") in model.pairs and ("link1", "link2") not in model.pairs
    straight, bent = ([0.0, 0.0], [0.0, 0.6])  # bent, the stick behind the elbow goes down through the upper arm
    assert model.nearer(straight, np.inf)[0].distance > 0.04 and model.nearer(bent, np.inf)[0].distance < 0
    with pytest.raises(ProblemError, match=r"at the goal, 'link1' is .* mm inside 'tool'"):
        ad.MinimumTimeProblem(robot, q_start=straight, q_goal=bent, self_collision=True)
    problem = ad.MinimumTimeProblem(
        robot, q_start=straight, q_goal=bent, self_collision=True, allowed_contacts=[("tool", "link1")]
    )
    assert ("link1", "tool") not in problem.collision_model().pairs


def test_a_tool_at_the_flange_is_not_compared_with_the_neighbouring_wrist():
    # Its cylinder stands 5 mm off the UR5's second wrist, for any angle of the third one.
    tool = ad.Tool(mass=0.5, tip=(0, 0, 0.2), shapes=[ad.Cylinder((0, 0, 0), (0, 0, 0.2), 0.03)])
    names = {first for first, second in CollisionModel(ad.Robot.from_library("ur5", tool=tool), (), True).pairs}
    assert "wrist_1_link" in names and "wrist_2_link" not in names


def test_refused_if_it_cannot_be_carried():
    with pytest.raises(SpecError, match="payload shapes have 3"):
        ad.Payload(mass=1.0, shapes=[3])
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), payload=ad.Payload(mass=0.1, shapes=[ad.Plane((0, 0, 0))]))
    with pytest.raises(ProblemError, match="no solid that an arm could carry"):
        CollisionModel(robot)
    with pytest.raises(SpecError, match="tip of tool 'tool' has shape"):
        ad.Tool(mass=1.0, tip=(0, 0))
    with pytest.raises(SpecError, match="tool is 3"):
        ad.RobotOptions(tool=3)


def test_as_tables():
    payload = ad.Payload(mass=0.5, com=(0, 0, 0.1), shapes=[STICK, ad.Sphere((0, 0, 0), 0.1)], name="stick")
    assert payload_from(payload_entry(payload)) == payload
    tool = ad.Tool(mass=0.5, tip=pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([0, 0, 0.2])), frame="tip")
    again = tool_from(payload_entry(tool))
    np.testing.assert_allclose(np.array(again.tip), np.array(tool.tip), atol=1e-15)
    with pytest.raises(ProblemError, match="shape 1 of the payload"):
        payload_from({"shapes": [{"type": "cube"}]})
    with pytest.raises(ProblemError, match="it must be a list"):
        payload_from({"shapes": "box"})


def test_in_a_problem_file(tmp_path):
    robot = ad.Robot.from_library(
        "panda",
        tool=ad.Tool(mass=0.5, tip=(0, 0, 0.2), shapes=[STICK]),
        payload=ad.Payload(mass=2.0, shapes=[ad.Box((0.1, 0.1, 0.1), (0, 0, 0.05))]),
    )
    problem = ad.MinimumTimeProblem(robot, q_start="ready", q_goal=[1, 0.2, 0.5, -1.5, 0.3, 2, -0.5])
    (tmp_path / "problem.toml").write_text(problem.to_toml())
    again = ad.read_problem(tmp_path / "problem.toml").robot
    assert (again.tip, again.payload, again.options.tool) == (robot.tip, robot.payload, robot.options.tool)
    assert again.model_hash == robot.model_hash


def test_a_payload_without_shapes_stays_a_point():
    robot = paper_arm("rr")
    assert [body.shapes for body in robot.attached] == [()]
