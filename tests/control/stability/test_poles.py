"""The linearised loop against published-case references, CasADi's derivatives, and hand-made polynomials."""

import casadi as ca
import numpy as np
import pytest

from armdyn.control import PidGains, closed_loop_eigenvalues
from armdyn.control.laws.pid import DEFAULT_GAINS
from armdyn.control.stability.linear import closed_loop_matrix, plant_at_goal
from armdyn.dynamics import Dynamics
from armdyn.errors import ProblemError
from oracles import PinDynamics, robot_named
from pid_loops import POSES, example

# Largest real parts [1/s] of an independent Lagrangian model, by payload reading and mass [g].
REFERENCE = {
    ("tip", 0): (-1.076923729151705, -1.1073518830389815, -0.1780723618064538, 0.5794625242791601),
    ("mM", 21.2): (-1.070093825765591, -1.0425031176582218, -0.04685879301516893, 0.761375176734524),
    ("mM", 100.6): (-1.052599718194521, -0.8233667827591677, 0.38279747064999736, 1.3906760142597308),
    ("mM", 200): (-1.040073920343536, -0.5840126101234799, 0.8360957099553734, 2.938779376601436),
    ("mM", 500): (-1.0233063745487487, 0.007198549292462435, 2.176992926081767, 6.930671071202996),
    ("mM", 1000): (-1.0137189164837133, 0.7645474715520231, 6.034804566500743, 10.967378808650064),
    ("tip", 21.2): (-1.0829135590638086, -1.077286931150665, -0.12851127253178687, 0.7335666334111574),
    ("tip", 100.6): (-1.0960151832128961, -0.9222684958872227, 0.15561483352727135, 1.3031143779437038),
    ("tip", 200): (-1.1038231325704526, -0.7281562506958967, 0.5114965551655712, 2.2398766447449043),
    ("tip", 500): (-1.1127111438209931, -0.22315082305428302, 1.414772520641093, 6.32733455960794),
    ("tip", 1000): (-1.1171407479617015, 0.44080890726817556, 4.391617504476527, 10.084724560683565),
}


@pytest.mark.parametrize(("reading", "grams"), REFERENCE)
def test_largest_real_parts_of_the_papers_loop(reading, grams):
    for name, expected in zip(POSES, REFERENCE[reading, grams], strict=True):
        robot, poses = example(name, reading, grams)
        largest = closed_loop_eigenvalues(robot, poses["q_goal"])[0].real
        # The reference differentiates by finite differences: 8e-8 at worst.
        assert largest == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("form", ["acceleration", "torque", "computed_torque"])
@pytest.mark.parametrize("name", ["rr", "rrr", "panda", "rr with friction"])
def test_matrix_is_the_jacobian_of_the_loop(name, form):
    """CasADi differentiates the whole closed loop, written down anew, at its equilibrium."""
    robot = robot_named(name.split()[0])
    if "friction" in name:
        robot = robot.with_friction([0.1, 0.2], [0.05, 0.0], 0.1)
    n, pin, dyn = robot.nv, PinDynamics(robot), Dynamics(robot)
    goal = np.linspace(0.4, -0.6, n)
    kp, ki, kd = np.linspace(20, 40, n), np.linspace(40, 60, n), np.linspace(8, 12, n)
    z, q, v = (ca.SX.sym(symbol, n) for symbol in "zqv")
    u = kp * (goal - q) + ki * z - kd * v
    tau = {
        "torque": u,
        "acceleration": dyn.crba(q) @ u,
        "computed_torque": dyn.crba(q) @ u + dyn.nle(q, v),
    }[form]
    x, rate = ca.vertcat(z, q, v), ca.vertcat(goal - q, v, dyn.aba(q, v, tau))
    held = pin.rnea(goal, np.zeros(n), np.zeros(n))
    held = {
        "torque": held,
        "acceleration": np.linalg.solve(pin.crba(goal), held),
        "computed_torque": 0 * held,
    }[form]
    rest = np.concatenate([held / ki, goal, np.zeros(n)])
    assert np.abs(np.array(ca.Function("f", [x], [rate])(rest))).max() < 1e-9
    expected = np.array(ca.Function("A", [x], [ca.jacobian(rate, x)])(rest))
    got = closed_loop_matrix(plant_at_goal(robot, goal, form), kp, ki, kd)
    # Two exact derivatives: the difference is rounding, times the condition of D.
    np.testing.assert_allclose(got, expected, atol=1e-10 * np.abs(expected).max())


def test_computed_torque_is_a_triple_integrator_per_joint():
    robot, poses = example("RRR Ex6", grams=1000)
    got = closed_loop_eigenvalues(robot, poses["q_goal"], form="computed_torque")
    # s³ + kd s² + kp s + ki, once per joint; triple roots of a block matrix are good to the cube root of eps.
    expected = np.repeat(np.roots([1, 10, 30, 50]), 3)
    np.testing.assert_allclose(np.sort_complex(got), np.sort_complex(expected), atol=1e-5)


def test_poles_that_the_default_gains_are_said_to_have():
    robot, poses = example("R Ex4")
    got = closed_loop_eigenvalues(robot, poses["q_goal"], form="computed_torque")
    np.testing.assert_allclose(np.sort_complex(got), [-6.6, -1.7 - 2.2j, -1.7 + 2.2j], atol=0.05)


def test_without_integral_gain_its_state_is_left_out():
    robot, poses = example("RR Ex5")
    values = closed_loop_eigenvalues(robot, poses["q_goal"], PidGains(30, [50, 0], 10))
    assert values.shape == (5,)
    assert values[0].real < 0


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"q_goal": [0.0]}, "q_goal has shape"),
        ({"q_goal": [0.0, np.nan]}, "joint2.*finite"),
        ({"q_goal": ["a", "b"]}, "q_goal"),
        ({"form": "voltage"}, "form is 'voltage'"),
        ({"gains": PidGains([1, 2, 3], 1, 1)}, "kp has 3"),
    ],
)
def test_bad_input(change, match):
    robot, poses = example("RR Ex5")
    with pytest.raises(ProblemError, match=match):
        closed_loop_eigenvalues(robot, **({"q_goal": poses["q_goal"], "gains": DEFAULT_GAINS} | change))
