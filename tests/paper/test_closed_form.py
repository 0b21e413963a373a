import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from armdyn.dynamics import Dynamics
from armdyn.errors import SpecError
from armdyn.models import PLANAR_ARMS, ArmSpec, LinkSpec, Payload, Robot
from armdyn.paper.closed_form import PlanarArm
from armdyn.paper.printed.examples import PAYLOADS
from oracles import PinDynamics, assert_close, random_states

# A few hundred roundings of terms of order one. The payload's stand-in tensor of 1e-12 kg m² in the
# URDF, times accelerations of order one, is below it too.
TOLERANCE = 1e-10


def payloads(spec):
    tip = [Payload(mass=mass) for mass in PAYLOADS]
    return [None, *tip, *(Payload.at_last_com(spec, mass) for mass in PAYLOADS)]


def assert_same_mechanics(spec, payload, seed=0, count=3):
    by_hand, robot = PlanarArm.from_spec(spec, payload), Robot.from_spec(spec, payload)
    for other in (PinDynamics(robot), Dynamics(robot)):
        for q, v, a in random_states(by_hand.nv, count, seed):
            D, C, g = by_hand.inertia(q), by_hand.coriolis(q, v), by_hand.gravity(q)
            assert_close(other.crba(q), D, TOLERANCE)
            assert_close(other.gravity(q), g, TOLERANCE)
            assert_close(other.nle(q, v) - other.gravity(q), C @ v, TOLERANCE)
            assert_close(other.rnea(q, v, a), D @ a + C @ v + g, TOLERANCE)


@pytest.mark.parametrize("arm", PLANAR_ARMS)
def test_pinocchio_and_casadi_agree_with_the_hand_derivation(arm):
    spec = ArmSpec.paper(arm)
    for payload in payloads(spec):
        assert_same_mechanics(spec, payload)


def test_payload_with_its_own_inertia_ahead_of_the_tip():
    payload = Payload(mass=0.3, com=(0.05, 0.0, 0.0), inertia=(2e-4, 3e-4, 4e-4))
    assert_same_mechanics(ArmSpec.paper("rrr"), payload)


positive = st.floats(0.05, 2.0)
a_link = st.builds(LinkSpec, length=positive, com=st.floats(-0.5, 1.5), mass=positive, inertia=positive)
a_payload = st.builds(
    lambda mass, along, moment: Payload(mass=mass, com=(along, 0, 0), inertia=(moment, moment, moment)),
    st.floats(0.0, 2.0),
    st.floats(-1.0, 1.0),
    st.floats(0.0, 0.5),
)


@settings(max_examples=30)
@given(st.lists(a_link, min_size=1, max_size=3), st.none() | a_payload, st.integers(0, 2**16))
def test_any_planar_arm(links, payload, seed):
    assert_same_mechanics(ArmSpec(name="any", links=tuple(links)), payload, seed, count=1)


@pytest.mark.parametrize("arm", PLANAR_ARMS)
def test_inertia_is_symmetric_and_positive(arm):
    by_hand = PlanarArm.from_spec(ArmSpec.paper(arm), Payload(mass=0.5))
    for q, _, _ in random_states(by_hand.nv):
        D = by_hand.inertia(q)
        assert np.array_equal(D, D.T)
        assert np.linalg.eigvalsh(D)[0] > 0


@pytest.mark.parametrize("arm", PLANAR_ARMS)
def test_inertia_rate_minus_twice_coriolis_is_skew(arm):
    by_hand = PlanarArm.from_spec(ArmSpec.paper(arm), Payload(mass=0.5))
    step = 1e-30  # complex step: no difference is taken, so no digit is lost however small it is
    for q, v, _ in random_states(by_hand.nv):
        rate = by_hand.inertia(q + 1j * step * v).imag / step
        S = rate - 2 * by_hand.coriolis(q, v)
        assert_close(S, -S.T, 1e-14)


@pytest.mark.parametrize("arm", PLANAR_ARMS)
def test_gravity_is_the_slope_of_potential_energy(arm):
    spec, payload = ArmSpec.paper(arm), Payload(mass=0.2)
    by_hand, step = PlanarArm.from_spec(spec, payload), 1e-6
    energy = PinDynamics(Robot.from_spec(spec, payload)).potential_energy
    for q, _, _ in random_states(by_hand.nv):
        slope = [
            (energy(q + step * e) - energy(q - step * e)) / (2 * step) for e in np.eye(by_hand.nv)
        ]  # central difference: error of the order step² + eps/step = 1e-10, times ten for safety
        assert_close(slope, by_hand.gravity(q), 1e-9)


@pytest.mark.parametrize("arm", PLANAR_ARMS)
def test_energy_is_conserved_without_torque(arm):
    spec = ArmSpec.paper(arm)
    by_hand, n = PlanarArm.from_spec(spec), len(spec.links)
    potential = PinDynamics(Robot.from_spec(spec)).potential_energy

    def rhs(_, x):
        q, v = x[:n], x[n:]
        force = -by_hand.coriolis(q, v) @ v - by_hand.gravity(q)
        return np.concatenate((v, np.linalg.solve(by_hand.inertia(q), force)))

    def energy(x):
        q, v = x[:n], x[n:]
        return v @ by_hand.inertia(q) @ v / 2 + potential(q)

    start = np.concatenate((np.full(n, 0.3), np.ones(n)))
    path = solve_ivp(rhs, (0, 2), start, method="DOP853", rtol=1e-11, atol=1e-11).y.T
    energies = np.array([energy(x) for x in path])
    # The integrator's own 1e-11 per step, over a few hundred steps; the energies are of order one joule.
    assert np.ptp(energies) < 1e-8


def test_zero_payload_is_none():
    spec = ArmSpec.paper("rr")
    assert PlanarArm.from_spec(spec, Payload(mass=0.0, inertia=(1, 1, 1))) == PlanarArm.from_spec(spec)


@pytest.mark.parametrize(
    "payload",
    [
        Payload(mass=0.1, com=(0, 0, 0.1)),
        Payload(mass=0.1, com=(0, 0.1, 0)),
        Payload(mass=0.1, frame="link1"),
    ],
)
def test_payload_off_the_axis_is_refused(payload):
    with pytest.raises(SpecError):
        PlanarArm.from_spec(ArmSpec.paper("rr"), payload)


def test_four_links_are_refused():
    spec = ArmSpec(name="long", links=(*ArmSpec.paper("rrr").links, ArmSpec.paper("r").links[0]))
    with pytest.raises(SpecError, match="one to 3 links"):
        PlanarArm.from_spec(spec)


def test_wrong_length_is_refused():
    arm = PlanarArm.from_spec(ArmSpec.paper("rr"))
    for call in (
        lambda: arm.inertia([0.0]),
        lambda: arm.coriolis([0, 0], [0, 0, 0]),
        lambda: arm.gravity(0.0),
    ):
        with pytest.raises(SpecError, match="expected 2 numbers"):
            call()
