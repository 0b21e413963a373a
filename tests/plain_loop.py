"""A sampled loop in plain Python, to test the compiled one: `forward_dynamics` and Runge-Kutta's classical method.

It follows the docstrings of `Loop`, `Law` and `Ticks`, and shares no code with the compiled loop.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

import armdyn as ad
from armdyn.control.loop.references import Ticks
from armdyn.dynamics import forward_dynamics
from oracles import PinDynamics
from problems import paper_arm

SUBSTEPS = 4
"""Of Runge-Kutta's method per tick: halving them moves the paper's arms by less than 1e-5 rad under these laws."""


@dataclass
class PlainRun:
    """States and torques of a loop at its ticks."""

    t: np.ndarray
    q: np.ndarray
    """[rad], one row more than torques."""
    v: np.ndarray
    tau: np.ndarray
    """That the arm gets over each tick [N m]."""
    wanted: np.ndarray
    """The law's torque at each tick, before it is clipped [N m]."""
    read_v: np.ndarray
    """That the law reads [rad/s]."""

    def settled_time(self, goal, tolerance=0.005):
        """The first tick from which on all joints are within the tolerance of the goal [s]; infinite: none."""
        outside = np.any(np.abs(self.q - goal) > tolerance, axis=1) | ~np.all(np.isfinite(self.q), axis=1)
        if outside[-1]:
            return np.inf
        return self.t[np.flatnonzero(outside)[-1] + 1] if outside.any() else 0.0


class Filtered:
    """First-order low-pass of differences."""

    def __init__(self, loop, y, v):
        self.loop, self.last, self.v = loop, y - v / loop.rate, v

    def read(self, y, _):
        p = self.loop.pole
        self.v = p * self.v + (1 - p) * (y - self.last) * self.loop.rate
        self.last = y
        return y, self.v


class Observer:
    """Luenberger's, on the controller's model."""

    def __init__(self, loop, y, v, model):
        self.loop, self.q, self.v, self.aba, self.first = loop, y, v, forward_dynamics(model), True

    def read(self, y, applied):
        if self.first:
            self.first = False
            return self.q, self.v
        h = 1 / self.loop.rate
        a = self.aba(self.q, self.v, applied)
        q, v = self.q + h * self.v + h**2 / 2 * a, self.v + h * a
        l1, l2 = self.loop.observer_gains
        self.q, self.v = q + l1 * (y - q), v + l2 * (y - q)
        return self.q, self.v


def simulate(plant, model, reference, controller, loop, duration, substeps=SUBSTEPS):
    """A plant under a controller that knows `model`, from the start of the reference."""
    ticks = Ticks.of(model, reference, loop.rate)
    law = controller.law(model, ticks, loop)
    aba, noise = forward_dynamics(plant), np.random.default_rng(loop.seed)
    lower, upper = plant.limits.effort_lower, plant.limits.effort_upper
    nv, h, last, count = plant.nv, 1 / loop.rate, len(ticks.q) - 1, int(np.ceil(duration * loop.rate))
    q, v, integral = ticks.q[0].copy(), ticks.v[0].copy(), np.zeros(nv)
    pending = [np.clip(ticks.tau[min(k, last)], lower, upper) for k in range(loop.delay)]
    seen, applied = None, None
    out = {name: [] for name in ("q", "v", "tau", "wanted", "read_v")}
    for k in range(count):
        y = q + loop.noise * noise.standard_normal(nv) if loop.noise else q
        y = np.round(y / loop.encoder) * loop.encoder if loop.encoder else y
        if seen is None:
            seen = {"filtered": Filtered, "observer": Observer, "exact": None}[loop.velocity]
            seen = seen and seen(loop, y, v, *([model] if loop.velocity == "observer" else []))
        read_q, read_v = seen.read(y, applied) if seen else (y, v)
        row = law.rows[min(k, len(law.rows) - 1)]
        wanted = np.array(law.function(read_q, read_v, integral, np.concatenate([[], *pending]), row)).ravel()
        clipped = np.clip(wanted, lower, upper)
        error = ticks.q[min(k, last)] - read_q
        if k * h >= law.integrate_from - 1e-12:
            integral = integral + h * running(loop, law, error, wanted - clipped)
        pending.append(clipped)
        applied = pending.pop(0)
        for name, value in (("q", q), ("v", v), ("tau", applied), ("wanted", wanted), ("read_v", read_v)):
            out[name].append(value)
        q, v = stepped(aba, q, v, applied, h, substeps)
        if not np.all(np.abs(q) < 1e3):
            break
    out["q"].append(q)
    out["v"].append(v)
    return PlainRun(t=np.arange(len(out["q"])) * h, **{name: np.array(values) for name, values in out.items()})


def running(loop, law, error, excess):
    """Rate of the integral."""
    if loop.antiwindup == "conditional":
        return np.where(excess * error > 0, 0.0, error)
    if loop.antiwindup == "none":
        return error
    gain, h = law.integral_gain, 1 / loop.rate
    back = np.divide(excess, gain, out=np.zeros_like(excess), where=gain > 0)
    return error - min(1.0, h / 0.01) * back / h


def stepped(aba, q, v, tau, h, substeps):
    """Runge and Kutta's fourth-order method under a constant torque."""
    s = h / substeps
    for _ in range(substeps):
        a1 = aba(q, v, tau)
        a2 = aba(q + s / 2 * v, v + s / 2 * a1, tau)
        a3 = aba(q + s / 2 * (v + s / 2 * a1), v + s / 2 * a2, tau)
        a4 = aba(q + s * (v + s / 2 * a2), v + s * a3, tau)
        q, v = q + s * v + s**2 / 6 * (a1 + a2 + a3), v + s / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return q, v


def six_plants(make, mass, damping, coulomb):
    """Payload times 0.8, 1, 1.2, without and with friction; `make(mass)` is the arm."""
    for factor in (0.8, 1.0, 1.2):
        robot = make(factor * mass)
        yield robot
        yield robot.with_friction(damping, coulomb, 0.05)


def paper_plants(arm):
    """Six plants of a paper arm."""
    return six_plants(lambda mass: paper_arm(arm, mass), 0.1006, 0.003, 0.06)


@cache
def paper_reference(arm, reserve):
    """The fastest motion of Example 2 or 3 with 100.6 g that leaves a part of the torque to the controller."""
    from problems import paper_problem

    return ad.solve_minimum_time(paper_problem(arm, effort_limit=(1 - reserve) * 3.0)).trajectory


def continuous_pid(robot, start, goal, gains, form, duration):
    """(∫e, q, v) over time of a PID loop between two poses as a differential equation, by LSODA.

    With form "torque" torques are clipped, and the integral of a joint whose error increases it fades over 1 % of half
    the torque range.
    """
    from scipy.integrate import solve_ivp

    pin, friction, nv = PinDynamics(robot), robot.friction, robot.nv
    kp, ki, kd = gains.per_joint(nv)
    lower, upper = robot.limits.effort_lower, robot.limits.effort_upper

    def rate(_, x):
        integral, q, v = np.split(x, 3)
        error = goal - q
        tau = u = kp * error + ki * integral - kd * v
        if form == "torque":
            tau = np.clip(u, lower, upper)
            fade = np.clip(1 - np.abs(u - tau) / (0.01 * (upper - lower) / 2), 0, 1)
            error = np.where((u - tau) * error > 0, fade * error, error)
        else:
            tau = pin.crba(q) @ u + (pin.nle(q, v) + friction.torque(v) if form == "computed_torque" else 0)
        return np.concatenate([error, v, pin.aba(q, v, tau - friction.torque(v))])

    x0 = np.concatenate([np.zeros(nv), start, np.zeros(nv)])
    return solve_ivp(rate, (0, duration), x0, "LSODA", rtol=1e-10, atol=1e-11, dense_output=True).sol
