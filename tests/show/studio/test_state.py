"""The state edited by the user, as a value."""

import json

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.show.studio.state import (
    SIZES,
    StudioState,
    carrying,
    fitting_presets,
    moved,
    new_obstacle,
    placement_of,
    problem_of,
    resized,
    sizes_of,
)
from problems import paper_arm, paper_problem

SHAPES = [
    ad.Box((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)),
    ad.Sphere((0.4, 0.5, 0.6), 0.1),
    ad.Cylinder((0.4, 0.5, 0.4), (0.4, 0.5, 0.8), 0.05),
    ad.Capsule((0.4, 0.5, 0.4), (0.4, 0.5, 0.8), 0.05),
]


def state_of_rr(**changes):
    problem = paper_problem("rr", obstacles=SHAPES[:2], reserve=0.2)
    return problem, StudioState.of(problem, 1e-3)


def test_a_state_is_itself_again_after_json():
    _, state = state_of_rr()
    assert len(state.obstacles) == 2
    assert StudioState.from_entry(json.loads(json.dumps(state.entry())), 2) == state


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"start": [0.0]}, "positions"),
        ({"start": [0.0, float("nan")]}, "finite"),
        ({"start": "home"}, "start"),
        ({"payload": -1.0}, "payload"),
        ({"payload": 1e9}, "at most"),
        ({"reserve": 0.95}, "at most"),
        ({"calm": 0.9}, "at most"),
        ({"self_collision": 1}, "self_collision"),
        ({"preset": 7}, "preset"),
        ({"obstacles": "box"}, "list"),
        ({"obstacles": [{"type": "mesh", "file": "/etc/passwd"}]}, "names no others"),
        ({"obstacles": [{"type": "sphere", "center": [0, 0, 0], "radius": 1.0}] * 200}, "at most 100"),
        ({"surplus": 1}, "a state has"),
    ],
)
def test_a_strangers_state_is_refused(changes, said):
    _, state = state_of_rr()
    with pytest.raises(ProblemError, match=said):
        StudioState.from_entry(json.loads(json.dumps(state.entry())) | changes, 2)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_an_obstacle_is_moved_where_the_gizmo_is(shape):
    to = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.2, 0.5), np.array([1.0, -2.0, 0.5]))
    other = moved(shape, to)
    assert other.name == shape.name
    assert type(other) is type(shape)
    np.testing.assert_allclose(placement_of(other).translation, to.translation, atol=1e-12)
    axis = placement_of(other).rotation[:, 2]
    if not isinstance(shape, ad.Sphere):  # which has no direction
        np.testing.assert_allclose(axis, to.rotation[:, 2], atol=1e-12)
    assert sizes_of(other) == pytest.approx(sizes_of(shape)) if sizes_of(shape) else sizes_of(other) is None


def test_a_plane_is_not_moved():
    assert placement_of(ad.Plane((0, 0, -1))) is None


@pytest.mark.parametrize("kind", SIZES)
def test_a_new_obstacle_has_a_name_of_its_own_and_other_sizes_when_resized(kind):
    first = new_obstacle(kind, np.array([1.0, 2.0, 3.0]), ())
    second = new_obstacle(kind, np.array([1.0, 2.0, 3.0]), (first,))
    assert first.name != second.name
    assert sizes_of(first) == pytest.approx(tuple(SIZES[kind].values()))
    wanted = [2 * size for size in SIZES[kind].values()]
    assert sizes_of(resized(first, wanted)) == pytest.approx(wanted)
    np.testing.assert_allclose(placement_of(resized(first, wanted)).translation, [1, 2, 3])
    with pytest.raises(ProblemError):
        resized(first, [0.0] * len(wanted))


def test_another_mass_keeps_place_and_shape_and_scales_the_inertia():
    payload = ad.Payload(mass=0.1, com=(0.01, 0, 0), inertia=(1e-4, 2e-4, 2e-4), shapes=[SHAPES[1]])
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), payload=payload)
    heavy = carrying(robot, 0.3).payload
    assert (heavy.mass, heavy.com, heavy.shapes) == (0.3, payload.com, payload.shapes)
    np.testing.assert_allclose(heavy.inertia, 3 * np.array(payload.inertia))
    assert carrying(robot, 0.1) is robot
    assert carrying(paper_arm("rr"), 0.0).payload is None


def test_conditions_outside_the_state_stay():
    problem = paper_problem("rr", via=[[-0.5, 0.3]], velocity_limit=30.0, reserve=[0.1, 0.3])
    state = StudioState.of(problem, 1e-3)
    made, warned = problem_of(problem, problem.robot, state, {})
    assert not warned
    np.testing.assert_array_equal(made.via, problem.via)
    np.testing.assert_array_equal(made.limits.velocity, [30, 30])
    np.testing.assert_array_equal(made.reserves.effort, [0.1, 0.3])  # of each joint, until the slider says one for all
    made, _ = problem_of(problem, problem.robot, StudioState(start=state.start, goal=state.goal, reserve=0.5), {})
    np.testing.assert_array_equal(made.reserves.effort, [0.5, 0.5])


def test_presets_are_those_of_the_robots_joints():
    panda = ad.Robot.from_library("panda")
    found = fitting_presets(ad.MinimumTimeProblem(panda, q_start="ready", q_goal=[0.5, 0, 0, -1.5, 0, 2, 0]))
    assert "franka-panda" in found
    assert not any(name.startswith("ur") for name in found)
    assert list(fitting_presets(paper_problem("rr"))) == ["ros2-jtc"]  # of any joints
