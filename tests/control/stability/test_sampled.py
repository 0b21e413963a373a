"""The sampled loop's matrix against finite differences of one tick, Jury's conditions and theorems."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest

import plain_loop
from armdyn.control.laws.linear import zero_order_hold
from armdyn.control.laws.lqr import Lqr
from armdyn.control.laws.pid import Pid, PidGains
from armdyn.control.loop.loop import Controller, Law, Loop
from armdyn.control.loop.references import Ticks, set_point
from armdyn.control.stability.linear import Rest, closed_loop_eigenvalues, continuous_matrix
from armdyn.control.stability.sampled import sampled_loop
from armdyn.dynamics import forward_dynamics, inverse_dynamics
from armdyn.errors import ProblemError
from armdyn.trajectory import Trajectory
from oracles import PinDynamics, robot_named
from pid_loops import example, loaded_arm
from problems import cart

GAINS = PidGains(30.0, 50.0, 2.0)


@dataclass(frozen=True)
class Weird:
    """A law that couples all that it reads, with full matrices and a product of two readings."""

    seed: int = 0

    def law(self, robot, ticks, loop):
        nv, random = robot.nv, np.random.default_rng(self.seed)
        q, v, z = (ca.SX.sym(name, nv) for name in "qvz")
        pending, row = ca.SX.sym("p", loop.delay * nv), ca.SX.sym("r", nv)
        K = [random.uniform(-1, 1, (nv, nv)) for _ in range(3)]
        tau = 3 * K[0] @ (row - q) - 0.1 * K[1] @ v + (5 * np.eye(nv) + K[2]) @ z * (1 + ca.sin(q[0] - row[0]))
        for k in range(loop.delay):
            tau += 0.2 * K[k % 3] @ pending[k * nv : (k + 1) * nv]
        return Law(ca.Function("weird", [q, v, z, pending, row], [tau]), ticks.q, np.full(nv, 5.0))


def integral_at_rest(law, goal, holding, delay):
    """By fixed steps of Newton's method with differences."""
    z, nv = np.zeros(goal.size), goal.size

    def miss(z):
        pending = np.tile(holding, delay)
        return np.array(law.function(goal, np.zeros(nv), z, pending, law.rows[-1])).ravel() - holding

    slope = np.column_stack([(miss(e) - miss(-e)) / 2 for e in np.eye(nv)])
    return z - np.linalg.lstsq(slope, miss(z), rcond=None)[0]  # every law here is affine in the integral


class Tick:
    """One tick of the loop without linearisation, on the state of `SampledLoop`, as the loop's docstrings say it."""

    def __init__(self, robot, goal, controller, loop, plant):
        self.loop, self.goal, self.nv = loop, goal, robot.nv
        self.plant, self.model = forward_dynamics(plant), forward_dynamics(robot)
        ticks = Ticks.of(robot, set_point(robot, goal, loop.period), loop.rate)
        self.law = controller.law(robot, ticks, loop)
        self.holding = inverse_dynamics(plant)(goal, np.zeros(self.nv), np.zeros(self.nv))
        self.integral = integral_at_rest(self.law, goal, self.holding, loop.delay)

    def at_rest(self):
        """q, v, memory, integrals, torques; the filter's memory of an arm at rest is -(1 - p) rate q."""
        memory = {
            "exact": [],
            "filtered": -(1 - self.loop.pole) * self.loop.rate * self.goal,
            "observer": np.r_[self.goal, np.zeros(self.nv)],
        }[self.loop.velocity]
        return np.r_[
            self.goal, np.zeros(self.nv), memory, self.integral, np.tile(self.holding, self.loop.delay)
        ].astype(float)

    def __call__(self, x):
        loop, nv, h = self.loop, self.nv, self.loop.period
        q, v, rest = x[:nv], x[nv : 2 * nv], x[2 * nv :]
        if loop.velocity == "exact":
            q_read, v_read = q, v
        elif loop.velocity == "filtered":
            memory, rest = rest[:nv], rest[nv:]
            y_before = self.goal  # any: the memory fixes only pole v̂ - (1 - pole) rate y
            v_before = (memory + (1 - loop.pole) * loop.rate * y_before) / loop.pole
            q_read, v_read = q, loop.pole * v_before + (1 - loop.pole) * (q - y_before) * loop.rate
        else:
            predicted, rate, rest = rest[:nv], rest[nv : 2 * nv], rest[2 * nv :]
            l1, l2 = loop.observer_gains
            q_read, v_read = predicted + l1 * (q - predicted), rate + l2 * (q - predicted)
        z, pending = rest[:nv], rest[nv:]
        wanted = np.array(self.law.function(q_read, v_read, z, pending, self.law.rows[-1])).ravel()
        queue = np.r_[pending, wanted]
        felt = queue[:nv]
        memory = {
            "exact": list,
            "filtered": lambda: loop.pole * v_read - (1 - loop.pole) * loop.rate * q,
            "observer": lambda: predict(self.model(q_read, v_read, felt), q_read, v_read, h),
        }[loop.velocity]()
        return np.r_[runge_kutta(self.plant, q, v, felt, h), memory, z + h * (self.goal - q_read), queue[nv:]]


def predict(a, q, v, h):
    return np.r_[q + h * v + h**2 / 2 * a, v + h * a]


def runge_kutta(aba, q, v, tau, h, steps=64):
    s = h / steps
    for _ in range(steps):
        a1 = aba(q, v, tau)
        a2 = aba(q + s / 2 * v, v + s / 2 * a1, tau)
        a3 = aba(q + s / 2 * v + s**2 / 4 * a1, v + s / 2 * a2, tau)
        a4 = aba(q + s * v + s**2 / 2 * a2, v + s * a3, tau)
        q, v = q + s * v + s**2 / 6 * (a1 + a2 + a3), v + s / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return np.r_[q, v]


def differences(tick):
    """Of one tick about rest, by a five-point stencil."""
    x, columns = tick.at_rest(), []
    for k in range(x.size):
        e = np.zeros(x.size)
        e[k] = 3e-6 * max(1.0, abs(x[k]))
        near, far = (tick(x + j * e) - tick(x - j * e) for j in (1, 2))
        columns.append((8 * near - far) / (12 * e[k]))
    return np.column_stack(columns)


CASES = {
    "torque, filtered": (Pid(GAINS, "torque"), Loop()),
    "torque, no delay": (Pid(GAINS, "torque"), Loop(delay=0)),
    "torque, gravity, exact": (Pid(GAINS, "torque", gravity=True), Loop(velocity="exact", delay=2)),
    "acceleration, without feedforward": (Pid(GAINS, "acceleration", feedforward=False), Loop(rate=200.0)),
    "acceleration, observer": (Pid(GAINS, "acceleration"), Loop(velocity="observer", delay=3)),
    "computed torque, observer": (Pid(GAINS, "computed_torque"), Loop(velocity="observer", delay=0)),
    "lqr, filtered": (Lqr(), Loop(delay=2)),
    "lqr, observer": (Lqr(), Loop(velocity="observer")),
    "weird, observer": (Weird(), Loop(velocity="observer", delay=2, rate=500.0)),
    "weird, filtered": (Weird(1), Loop(delay=1)),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("other_plant", [False, True], ids=["its model", "another payload and friction"])
def test_one_tick_against_finite_differences(case, other_plant):
    controller, loop = CASES[case]
    assert isinstance(controller, Controller)
    robot, poses = example("RR Ex5", grams=100.6)
    plant = loaded_arm("rr", "tip", 200).with_friction(0.003, 0.06, 0.05) if other_plant else robot
    goal = np.array(poses["q_goal"]) + 0.4
    compare(robot, goal, controller, loop, plant)


@pytest.mark.parametrize("controller", [Pid(GAINS, "computed_torque"), Lqr()])
def test_one_tick_of_an_industrial_arm(controller):
    robot = robot_named("panda")
    goal = np.array([0.1, -0.4, 0.3, -1.8, 0.2, 1.5, 0.4])
    compare(robot, goal, controller, Loop(), robot)


def compare(robot, goal, controller, loop, plant):
    linear = sampled_loop(robot, goal, controller, loop, plant)
    numeric = differences(Tick(robot, goal, controller, loop, plant))
    assert linear.matrix.shape == numeric.shape
    # Each row has its unit: rounding of 1e-12 of the row's largest entry, over steps of 3e-6; and where friction turns
    # within 0.05 rad/s the stencil's own error.
    scale = np.abs(numeric).max(axis=1, keepdims=True)
    np.testing.assert_allclose(linear.matrix / scale, numeric / scale, rtol=0, atol=2e-7)


def test_without_an_integral_gain_there_is_no_integral():
    robot, poses = example("RR Ex5", grams=100.6)
    with_one, without = (
        sampled_loop(robot, poses["q_goal"], Pid(PidGains(30, ki, 1), "torque"), Loop()) for ki in ([50.0, 0.0], 0.0)
    )
    assert len(with_one.matrix) == len(without.matrix) + 1
    assert not np.any(np.abs(np.linalg.eigvals(without.matrix) - 1) < 1e-6)


def double_integrator(kp, kd, delay, h=0.1):
    """z's polynomial of a unit mass under u = -kp q - kd v, held over ticks of h and felt `delay` ticks later."""
    shift = np.zeros(delay + 1)
    shift[0] = 1.0
    plant = np.convolve([1, -2, 1], shift)
    control = np.r_[np.zeros(delay + 1), h**2 * kp / 2 + h * kd, h**2 * kp / 2 - h * kd]
    return plant + control


def jury(p):
    """Jury's conditions of a polynomial of degree 2 or 3 (Åström and Wittenmark, section 3.2)."""
    n = len(p) - 1
    if not (np.polyval(p, 1) > 0 and (-1) ** n * np.polyval(p, -1) > 0 and abs(p[-1]) < 1):
        return False
    return n == 2 or abs(p[3] ** 2 - 1) > abs(p[3] * p[1] - p[2])


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0, 1])
def test_the_double_integrator_against_jurys_conditions(delay):
    random, verdicts = np.random.default_rng(2), []
    for _ in range(300):
        kp, kd = 10 ** random.uniform(-1, 2.7), 10 ** random.uniform(-1, 1.7)
        loop = sampled_loop(
            cart(), [0.5], Pid(PidGains(kp, 0, kd), "torque"), Loop(rate=10.0, delay=delay, velocity="exact")
        )
        p = double_integrator(kp, kd, delay)
        np.testing.assert_allclose(np.poly(loop.matrix), p, rtol=0, atol=1e-10 * np.abs(p).max())
        assert (loop.radius < 1) == jury(p)
        verdicts.append(loop.radius < 1)
    assert 0.1 < np.mean(verdicts) < 0.9


def test_separation_of_control_and_observer():
    """With the right model the observer's poles are added to those of exact readings (Luenberger)."""
    robot, poses = example("RR Ex5", grams=100.6)
    loops = {kind: Loop(velocity=kind, delay=2, cutoff=40.0) for kind in ("exact", "observer")}
    # computed torque from estimates: at rest it is linear in them, too
    matrices = {
        kind: sampled_loop(robot, poses["q_goal"], Pid(GAINS, "computed_torque"), loop).matrix
        for kind, loop in loops.items()
    }
    # The observer's error e⁻ obeys (1 - L) then the model: its poles are those of a double integrator only as far as
    # gravity's slope is small against the tick, so they come from its own matrix.
    model = Rest.of(robot, poses["q_goal"], Pid(GAINS), loops["observer"]).model
    h, (l1, l2), eye = loops["observer"].period, loops["observer"].observer_gains, np.eye(2)
    step = np.block([[eye, h * eye], [0 * eye, eye]]) + np.vstack([h**2 / 2 * model.A[2:], h * model.A[2:]])
    exact_step, _ = zero_order_hold(*model, h)
    error = step @ (np.eye(4) - np.vstack([l1 * eye, l2 * eye]) @ np.hstack([eye, 0 * eye]))
    expected = np.convolve(np.poly(matrices["exact"]), np.poly(error))
    # The observer's step is Taylor's of second order, the arm's is exact: they differ by h³ times gravity's slope.
    assert np.abs(step - exact_step).max() < 1e-4
    np.testing.assert_allclose(np.poly(matrices["observer"]), expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.parametrize("form", ["torque", "acceleration", "computed_torque"])
def test_continuous_law_has_the_poles_of_the_continuous_pid(form):
    robot, poses = example("RRR Ex6", grams=100.6)
    goal = np.array(poses["q_goal"])
    # Without feedforward the integrals carry gravity, as there; feedforward would take D(q)'s change out of it.
    rest = Rest.of(robot, goal, Pid(GAINS, form, feedforward=False), Loop.ideal())
    expected = closed_loop_eigenvalues(robot, goal, GAINS, form)
    own = np.linalg.eigvals(continuous_matrix(rest))
    key = np.lexsort((expected.imag.round(6), expected.real.round(6)))
    other = np.lexsort((own.imag.round(6), own.real.round(6)))
    # Computed torque has three equal triples of poles, each good to the cube root of rounding at worst.
    np.testing.assert_allclose(own[other], expected[key], rtol=1e-4 if form == "computed_torque" else 1e-8)


def test_fast_sampling_is_the_continuous_loop():
    robot, poses = example("RR Ex5", grams=100.6)
    controller = Pid(PidGains(30, 50, 10), "acceleration", feedforward=False)
    growth = np.linalg.eigvals(continuous_matrix(Rest.of(robot, poses["q_goal"], controller, Loop.ideal()))).real.max()
    errors = []
    for rate in (1e3, 1e4):
        loop = sampled_loop(robot, poses["q_goal"], controller, Loop(rate=rate, delay=0, velocity="exact"))
        errors.append(abs(np.log(loop.radius) * rate - growth))
    assert errors[1] < 0.12 * errors[0] < 0.012 * abs(growth)  # of first order in the tick


@pytest.mark.parametrize(
    ("name", "loop"),
    [
        ("RR Ex5", Loop(encoder=0.0)),
        ("RR Ex5", Loop(encoder=0.0, delay=2, velocity="observer")),
        ("RRR Ex6", Loop(encoder=0.0, delay=0)),
    ],
)
def test_a_simulation_grows_as_the_matrix_says(name, loop):
    """The loop in plain Python, pushed off its goal by half a milligram of payload, until that has grown 1e4 times."""
    robot, poses = example(name, grams=100.6)
    goal, controller = np.array(poses["q_goal"]), Pid(PidGains(30, 50, 10), "torque")
    plant = loaded_arm(name.split()[0].lower(), "tip", 100.6005)
    rest = np.zeros(robot.nv)
    holding = inverse_dynamics(robot)(goal, rest, rest)
    still = Trajectory(np.array([0.0, 0.1]), *(np.array([x, x]) for x in (goal, rest, holding)))
    linear = sampled_loop(robot, goal, controller, loop, plant)
    count = int(np.log(1e4) / np.log(linear.radius))
    run = plain_loop.simulate(plant, robot, still, controller, loop, count * loop.period)
    # In units of the holding torque: the torques that are on their way miss it, and so does the feedforward.
    missing = holding - inverse_dynamics(plant)(goal, rest, rest)
    x, expected = np.zeros(len(linear.matrix)), [np.zeros(robot.nv)]
    pending = slice(x.size - loop.delay * robot.nv, x.size)
    x[pending] = np.tile(missing, loop.delay)
    push = np.zeros(x.size)  # the law's own error per tick
    if loop.delay:
        push[-robot.nv :] = missing
    else:
        push = linear.B @ missing
    if loop.velocity == "observer":  # its model is held by another torque than the one that holds the arm
        a, h = -np.linalg.solve(PinDynamics(robot).crba(goal), missing), loop.period
        push[2 * robot.nv : 4 * robot.nv] = np.r_[h**2 / 2 * a, h * a]
    for _ in range(count):
        x = linear.matrix @ x + push
        expected.append(x[: robot.nv])
    moved = run.q - goal
    assert np.abs(moved[-1]).max() < 1e-3
    # Of second order in the deviation, 1e-3 rad at most, and the payload's change of the slopes, 5e-6 of them.
    np.testing.assert_allclose(moved, expected, rtol=0, atol=5e-3 * np.abs(moved).max())


def test_bad_input():
    robot, poses = example("RR Ex5")
    with pytest.raises(ProblemError, match="no ticks"):
        sampled_loop(robot, poses["q_goal"], Pid(GAINS), Loop.ideal())
    with pytest.raises(ProblemError, match="q_goal has shape"):
        sampled_loop(robot, [0.0], Pid(GAINS), Loop())
    with pytest.raises(ProblemError, match="has 1 joints; the controller's model has 2"):
        sampled_loop(robot, poses["q_goal"], Pid(GAINS), Loop(), loaded_arm("r", "tip", 0))
    with pytest.raises(ProblemError, match="the range of floating-point numbers"):
        sampled_loop(robot, poses["q_goal"], Pid(PidGains(1e308, 1e308, 1e308), "computed_torque"), Loop())
