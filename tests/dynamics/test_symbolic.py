import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import armdyn.dynamics.symbolic as symbolic
from armdyn.dynamics import Dynamics
from armdyn.errors import BridgeError, SpecError
from armdyn.models import PLANAR_ARMS, ArmSpec, Payload, Robot
from armdyn.models.robots.arm import payload_inertia
from armdyn.models.robots.library import library_urdf
from oracles import (
    LIBRARY_ROBOTS,
    LIMIT,
    PinDynamics,
    assert_close,
    joint,
    link,
    random_states,
    robot_named,
    two_links,
)

# Both sides round every operation, in another order; torques and accelerations reach 1e5 on these
# robots, so the error is taken relative to the largest entry once that exceeds one.
TOLERANCE = 1e-10
ROBOTS = (*PLANAR_ARMS, *LIBRARY_ROBOTS, "double_pendulum_continuous")


@pytest.mark.parametrize("name", ROBOTS)
def test_agrees_with_pin(name):
    robot = robot_named(name)
    dynamics, oracle = Dynamics(robot), PinDynamics(robot)
    for q, v, u in random_states(robot.nv):
        for method, arguments in (
            ("aba", (q, v, u)),
            ("rnea", (q, v, u)),
            ("crba", (q,)),
            ("nle", (q, v)),
            ("gravity", (q,)),
            ("kinetic_energy", (q, v)),
            ("potential_energy", (q,)),
        ):
            expected = getattr(oracle, method)(*arguments)
            assert_close(getattr(dynamics, method)(*arguments), expected, TOLERANCE)
        for got, expected in zip(
            dynamics.frame_placement(q, robot.tip), oracle.frame_placement(q, robot.tip), strict=True
        ):
            assert_close(got, expected, TOLERANCE)


@pytest.mark.parametrize("name", ["rrr", "panda", "kinova"])
def test_inertia_is_symmetric(name):
    robot = robot_named(name)
    for q, _, _ in random_states(robot.nv):
        D = Dynamics(robot).crba(q)
        assert_close(D, D.T, TOLERANCE)


@pytest.mark.parametrize("kind", [ca.DM, ca.SX, ca.MX])
def test_round_trip(kind):
    robot = robot_named("rr")
    dynamics = Dynamics(robot)
    x = [0.1, 0.2]
    q = kind(x) if kind is ca.DM else kind.sym("q", 2)
    for out in (
        dynamics.aba(q, q, q),
        dynamics.rnea(q, q, q),
        dynamics.crba(q),
        dynamics.nle(q, q),
        dynamics.gravity(q),
        dynamics.kinetic_energy(q, q),
        dynamics.potential_energy(q),
        *dynamics.frame_placement(q, "tip"),
        *dynamics.frame_placement(q, "base"),
    ):
        assert type(out) is kind
    rotation, origin = dynamics.frame_placement(q, "tip")
    assert rotation.shape == (3, 3)
    assert origin.shape == (3, 1)


@pytest.mark.parametrize("kind", [ca.SX, ca.MX])
def test_symbols_mean_the_same_as_numbers(kind):
    robot = robot_named("rrr")
    dynamics = Dynamics(robot)
    q, v, tau = (kind.sym(name, 3) for name in ("q", "v", "tau"))
    function = ca.Function("f", [q, v, tau], [dynamics.aba(q, v, tau), dynamics.frame_placement(q, "tip")[1]])
    for numbers in random_states(3, count=2):
        a, origin = function(*numbers)
        assert_close(a.full().ravel(), dynamics.aba(*numbers), TOLERANCE)
        assert_close(origin.full().ravel(), dynamics.frame_placement(numbers[0], "tip")[1], TOLERANCE)


def test_lists_and_numpy_give_numpy():
    dynamics = Dynamics(robot_named("rr"))
    assert isinstance(dynamics.gravity([0.0, 0.0]), np.ndarray)
    assert dynamics.gravity([0.0, 0.0]).shape == (2,)
    assert dynamics.crba(np.zeros(2)).shape == (2, 2)
    assert isinstance(dynamics.kinetic_energy([0, 0], [1, 1]), float)
    rotation, origin = dynamics.frame_placement([0, 0], "base")
    assert (rotation.shape, origin.shape) == ((3, 3), (3,))


def test_one_joint_keeps_its_shapes():
    dynamics = Dynamics(robot_named("r"))
    assert dynamics.aba(0.1, 0.2, 0.3).shape == (1,)
    assert dynamics.crba(0.1).shape == (1, 1)


@pytest.mark.parametrize(
    ("name", "frame"), [("rr", "tip"), ("rrr", "link2"), ("panda", "panda_hand_tcp"), ("z1", "gripperStator")]
)
def test_symbolic_payload_is_the_robots_payload(name, frame):
    payload = Payload(mass=0.7, com=(0.02, -0.03, 0.05), inertia=(1e-3, 2e-3, 2.5e-3), frame=frame)
    bare = robot_named(name)
    symbolic_payload = Dynamics(bare, payload_frame=frame)
    p = symbolic_payload.payload_parameters(payload_inertia(payload))
    assert p.shape == (10,)
    model = bare.model.copy()
    place = bare.frame(frame)
    model.appendBodyToJoint(place.parentJoint, payload_inertia(payload), place.placement)
    for q, v, u in random_states(bare.nv, count=2):
        loaded = pin.aba(model, model.createData(), bare.configuration(q), v, u)
        assert_close(symbolic_payload.aba(q, v, u, p), loaded, TOLERANCE)
        torque = pin.rnea(model, model.createData(), bare.configuration(q), v, u)
        assert_close(symbolic_payload.rnea(q, v, u, p), torque, TOLERANCE)
    if name != "rrr":
        robot = Robot.from_spec(ArmSpec.paper(name), payload) if name == "rr" else Robot.from_library(name, payload)
        numbers = next(random_states(bare.nv))
        assert_close(symbolic_payload.aba(*numbers, p), Dynamics(robot).aba(*numbers), TOLERANCE)


@pytest.mark.parametrize("name", ["rrr", "panda"])
def test_zero_payload_is_none(name):
    robot = robot_named(name)
    plain, loaded = Dynamics(robot), Dynamics(robot, payload_frame=robot.tip)
    q, v, u = next(random_states(robot.nv))
    none = np.zeros(10)
    assert_close(loaded.aba(q, v, u, none), plain.aba(q, v, u), TOLERANCE)
    assert_close(loaded.crba(q, none), plain.crba(q), TOLERANCE)
    assert_close(loaded.potential_energy(q, none), plain.potential_energy(q), TOLERANCE)
    assert_close(loaded.frame_placement(q, robot.tip)[1], plain.frame_placement(q, robot.tip)[1], TOLERANCE)


def test_payload_stays_a_symbol():
    dynamics = Dynamics(robot_named("rr"), payload_frame="tip")
    p = ca.SX.sym("p", 10)
    slope = ca.Function("slope", [p], [ca.jacobian(dynamics.gravity(ca.SX([0.0, 0.0]), p), p[0])])
    # Stretched out horizontally, a kilogram at the tip of lever L1 + L2 costs g (L1 + L2); payload_parameters
    # are taken at the joint, so the mass alone there has the lever L1, and m c brings the rest.
    assert_close(slope(np.zeros(10)).full().ravel(), [9.81 * 0.25, 0.0], TOLERANCE)


def test_armature_is_added_to_the_inertia():
    path, _ = library_urdf("ur5")
    armature = np.arange(1, 7) / 10
    robot = Robot.from_urdf(path, armature=armature)
    q, v, u = next(random_states(6))
    assert_close(
        Dynamics(robot).crba(q),
        Dynamics(robot_named("ur5")).crba(q) + np.diag(armature),
        TOLERANCE,
    )
    assert_close(Dynamics(robot).aba(q, v, u), PinDynamics(robot).aba(q, v, u), TOLERANCE)
    assert_close(Dynamics(robot).rnea(q, v, u), PinDynamics(robot).rnea(q, v, u), TOLERANCE)
    assert Dynamics(robot).digest() != Dynamics(robot_named("ur5")).digest()


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "continuous"])
@pytest.mark.parametrize("axis", ["1 0 0", "0 0 -1", "0.6 0 0.8"])
def test_any_axis(kind, axis, read):
    inside = f'<origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/><axis xyz="{axis}"/>{LIMIT}'
    robot = read(two_links(joint=joint("j", "base", "arm", kind, inside)))
    dynamics, oracle = Dynamics(robot), PinDynamics(robot)
    for q, v, u in random_states(1, count=2):
        assert_close(dynamics.aba(q, v, u), oracle.aba(q, v, u), TOLERANCE)
        for got, expected in zip(dynamics.frame_placement(q, "arm"), oracle.frame_placement(q, "arm"), strict=True):
            assert_close(got, expected, TOLERANCE)


def test_equal_robots_share_functions_and_digest():
    one, other = (Dynamics(Robot.from_spec(ArmSpec.paper("rr"))) for _ in range(2))
    assert one.functions is other.functions
    assert one.digest() == other.digest()
    heavier = Dynamics(Robot.from_spec(ArmSpec.paper("rr"), Payload(mass=0.1)))
    assert heavier.digest() != one.digest()


def test_wrong_sizes_are_refused():
    dynamics = Dynamics(robot_named("rr"))
    with pytest.raises(SpecError, match="q has 3 numbers; expected 2"):
        dynamics.gravity([0.0, 0.0, 0.0])
    with pytest.raises(SpecError, match="tau has 1 numbers; expected 2"):
        dynamics.aba([0, 0], [0, 0], 1.0)
    with pytest.raises(SpecError, match="got 4 arguments"):
        dynamics.aba([0, 0], [0, 0], [0, 0], np.zeros(10))
    with pytest.raises(SpecError, match="got 1 arguments"):
        Dynamics(robot_named("rr"), payload_frame="tip").gravity([0, 0])


def test_unknown_and_unmoving_frames_are_refused():
    robot = robot_named("rr")
    with pytest.raises(SpecError, match="no frame 'hand'"):
        Dynamics(robot, payload_frame="hand")
    with pytest.raises(SpecError, match="does not move"):
        Dynamics(robot, payload_frame="base")
    with pytest.raises(SpecError, match="no frame 'hand'"):
        Dynamics(robot).frame_placement([0, 0], "hand")
    with pytest.raises(SpecError, match="no symbolic payload"):
        Dynamics(robot).payload_parameters(pin.Inertia.Zero())


def test_equations_are_built_when_they_are_first_used():
    """Those of 80 joints take 5 s, which no time limit ends: what needs none of them does without."""
    dynamics = Dynamics(robot_named("rr"))
    assert "functions" not in vars(dynamics) and dynamics == Dynamics(robot_named("rr"))
    dynamics.gravity([0.0, 0.0])
    assert "functions" in vars(dynamics)


def test_another_casadi_is_refused(monkeypatch):
    import _armdyn_bridge

    monkeypatch.setattr(_armdyn_bridge, "casadi_version", "3.5.1")
    symbolic._functions.__wrapped__.cache_clear()  # or the check would not run for a robot that was built before
    with pytest.raises(BridgeError, match=r"built with casadi 3\.5\.1 but casadi"):
        Dynamics(robot_named("r")).crba([0.0])
    monkeypatch.undo()
    Dynamics(robot_named("r")).crba([0.0])


ROTOR = '<inertial><mass value="0"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial>'


def test_rotor_without_mass_keeps_its_moments(read):
    robot = read(two_links(link=link("arm", ROTOR)))
    assert_close(Dynamics(robot).crba([0.1]), [[0.2]], TOLERANCE)
    assert_close(Dynamics(robot).aba([0.1], [0.2], [0.3]), [1.5], TOLERANCE)


def test_no_payload_on_a_link_without_mass(read):
    dynamics = Dynamics(read(two_links(link=link("arm", ROTOR))), payload_frame="arm")
    p = ca.SX.sym("p", 10)
    a = dynamics.aba(ca.SX(0.1), ca.SX(0.2), ca.SX(0.3), p)
    value, slope = ca.Function("f", [p], [a, ca.jacobian(a, p)])(np.zeros(10))
    assert_close(value.full().ravel(), [1.5], TOLERANCE)
    assert np.all(np.isfinite(slope.full()))  # no 0/0 out of the centre of mass m c / m


def test_many_states_at_once_are_each_by_itself():
    robot = Robot.from_library("ur5").with_friction(0.1, 0.2)
    dynamics = Dynamics(robot)
    q, v, a = np.random.default_rng(3).normal(size=(3, 7, robot.nv))
    for name, rows in (("rnea", (q, v, a)), ("nle", (q, v)), ("gravity", (q,))):
        one_by_one = [getattr(dynamics, name)(*state) for state in zip(*rows, strict=True)]
        np.testing.assert_array_equal(dynamics.along(name, *rows), one_by_one)
    assert dynamics.along("gravity", q[:1]).shape == (1, robot.nv)
