"""Simulation of a robot arm under PID control."""

import warnings
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import LSODA, OdeSolution

from armdyn.control.arrival import ARRIVAL_RULES, ArrivalRule, Course
from armdyn.control.motion import EquationsOfMotion, Motion, motion_of
from armdyn.control.pid import DERIVATIVE_SIGNS, FORMS, PAPER_GAINS, DerivativeSign, Form, PidGains
from armdyn.control.stability import closed_loop_eigenvalues, joint_vector, one_of
from armdyn.errors import ProblemError
from armdyn.models import Robot
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

Status = Literal["settled", "not_settled", "diverged", "failed"]

_RTOL, _ATOL = 1e-9, 1e-10
"""Of the integrator, per component. Arrival times then move by less than 1e-6 s when both shrink tenfold."""
_MAX_STEPS = 30_000
"""Integrator steps after which a run is given up, in seconds: a settling 10 s run takes about a thousand."""
_POSITION_BOUND, _VELOCITY_BOUND = 100.0, 1000.0
"""Distance from the goal [rad or m] and speed [rad/s or m/s] beyond which a run counts as diverged:
sixteen turns and ten times the fastest robot. A start beyond a tenth of them moves them out."""
_CLAMP_BAND = 0.01
"""Excess torque, as a part of the effort limit, over which the integral fades from running to halted."""


@dataclass(frozen=True, eq=False)
class PidRun:
    """A simulated motion under PID control, and what came of it.

    Attributes:
        trajectory: uniform samples up to the end of the run; tau is what was applied, after any saturation.
        arrival_time: first time in the final position [s], by `arrival_rule`; None if there is none. A rule
            that asks to *stay* has none where the loop is unstable at the goal, or the run broke off.
        arrival_rule: see `ArrivalRule`.
        status: "settled": all joints came within the tolerance and stayed, and the loop is stable at
            the goal; "not_settled": the run is whole but they did not; "diverged": stopped at a bound of
            the state; "failed": the integrator gave up.
        message: the status in a sentence, with its numbers.
        overshoot: how far each joint went past its goal [rad or m], shape (nv,), never negative; for a joint
            that starts at its goal, how far it strayed.
        max_real_eigenvalue: largest real part [1/s] of the loop's eigenvalues at the goal, without
            saturation: the loop is stable there if it is negative.
    """

    trajectory: Trajectory
    arrival_time: float | None
    arrival_rule: ArrivalRule
    status: Status
    message: str
    overshoot: Array
    max_real_eigenvalue: float

    @property
    def settled(self) -> bool:
        """All joints came within the tolerance and stayed, and the loop is stable at the goal."""
        return self.status == "settled"


def simulate_pid(
    robot: Robot,
    *,
    q_start: ArrayLike,
    q_goal: ArrayLike,
    v_start: ArrayLike | None = None,
    gains: PidGains = PAPER_GAINS,
    duration: float = 10.0,
    form: Form = "acceleration",
    derivative_sign: DerivativeSign = "corrected",
    saturate: bool | None = None,
    arrival_tolerance: float = 0.005,
    arrival_rule: ArrivalRule = "last_entry_first_joint",
    samples: int = 1001,
    dynamics: EquationsOfMotion | None = None,
) -> PidRun:
    """Move an arm from start to goal under u = kp e + ki ∫e dt + kd ė, eq. (27), and see when it arrives.

    With form "acceleration" this is the paper's loop (24): q̈ = D⁻¹(-C v - g) + u. Position and velocity
    limits are not enforced. An unstable loop returns too, with a status and the motion up to there.

    Args:
        robot: an arm.
        q_start: [rad or m], shape (nv,).
        q_goal: [rad or m], shape (nv,).
        v_start: [rad/s or m/s], shape (nv,); None: at rest.
        gains: see `PidGains`.
        duration: how long to simulate [s].
        form: see `Form`.
        derivative_sign: see `DerivativeSign`.
        saturate: clip tau at the robot's effort limits, and halt a joint's integral while its torque is
            clipped and its error asks for more (anti-windup by conditional integration, faded over one
            percent of the limit so that the equations stay continuous). None: for "torque" only; the paper
            has no saturation.
        arrival_tolerance: of a joint's error [rad or m].
        arrival_rule: see `ArrivalRule`.
        samples: how many the trajectory has, both ends included.
        dynamics: other equations of motion than the robot's own, which have its joints' friction.

    Raises:
        ProblemError: wrong length or not finite; duration or tolerance not positive; unknown form, sign or
            rule; fewer than two samples.
    """
    goal, q0 = joint_vector(robot, q_goal, "q_goal"), joint_vector(robot, q_start, "q_start")
    v0 = np.zeros(robot.nv) if v_start is None else joint_vector(robot, v_start, "v_start")
    one_of("form", form, FORMS)
    one_of("derivative_sign", derivative_sign, DERIVATIVE_SIGNS)
    one_of("arrival_rule", arrival_rule, ARRIVAL_RULES)
    for what, number, unit in (("duration", duration, "s"), ("arrival_tolerance", arrival_tolerance, "rad")):
        if not (np.isfinite(number) and number > 0):
            raise ProblemError(f"{what} is {number} {unit}; it must be positive and finite")
    if samples != int(samples) or samples < 2:
        raise ProblemError(f"samples is {samples}; a trajectory has at least two")
    kp, ki, kd = gains.per_joint(robot.nv)
    clipped = form == "torque" if saturate is None else saturate
    lower, upper = robot.limits.effort_lower, robot.limits.effort_upper
    loop = _Loop(
        motion=motion_of(robot, dynamics),
        goal=goal,
        kp=kp,
        ki=ki,
        kd=kd if derivative_sign == "corrected" else -kd,
        form=form,
        lower=lower if clipped else np.full(robot.nv, -np.inf),
        upper=upper if clipped else np.full(robot.nv, np.inf),
    )
    eigenvalues = closed_loop_eigenvalues(robot, goal, gains, form, derivative_sign=derivative_sign, dynamics=dynamics)
    growth = float(eigenvalues[0].real)
    motion, stopped = _integrate(loop, np.concatenate([np.zeros(robot.nv), q0, v0]), float(duration))
    course = Course(motion, goal)
    entry = {rule: course.arrival(rule, arrival_tolerance) for rule in ARRIVAL_RULES}
    if stopped is not None or growth >= 0:
        entry["last_entry_first_joint"] = entry["last_entry_all_joints"] = None
    status, message = _verdict(
        stopped, entry["last_entry_all_joints"], arrival_tolerance, growth, course, loop.unholdable(robot)
    )
    t = np.linspace(0.0, motion.t_max, int(samples))
    x = motion(t)
    _, q, v = np.split(x, 3)
    return PidRun(
        trajectory=Trajectory(
            t=t,
            q=q.T,
            v=v.T,
            tau=np.array([loop.torque(column) for column in x.T]),
            joint_names=robot.joint_names,
            name=f"PID ({form})",
            model_hash=robot.model_hash,
        ),
        arrival_time=entry[arrival_rule],
        arrival_rule=arrival_rule,
        status=status,
        message=message,
        overshoot=course.overshoot(),
        max_real_eigenvalue=growth,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Loop:
    """Controller and arm as one differential equation in x = (∫e, q, v), shape (3 nv,)."""

    motion: Motion
    goal: Array
    kp: Array
    ki: Array
    kd: Array
    form: Form
    lower: Array
    upper: Array

    def wanted(self, x: Array) -> Array:
        """Torque that the controller asks for [N m], before saturation."""
        nv = self.goal.size
        integral, q, v = x[:nv], x[nv : 2 * nv], x[2 * nv :]
        u = self.kp * (self.goal - q) + self.ki * integral - self.kd * v
        if self.form == "torque":
            return np.asarray(u)
        tau = self.motion.inertia(q) @ u
        return np.asarray(tau if self.form == "acceleration" else tau + self.motion.bias(q, v))

    def torque(self, x: Array) -> Array:
        """Torque that the arm gets [N m]."""
        return np.minimum(np.maximum(self.wanted(x), self.lower), self.upper)

    def rate(self, _: float, x: Array) -> Array:
        """ẋ."""
        nv = self.goal.size
        q, v = x[nv : 2 * nv], x[2 * nv :]
        wanted = self.wanted(x)
        tau = np.minimum(np.maximum(wanted, self.lower), self.upper)
        error = self.goal - q
        excess = wanted - tau
        if excess.any():
            error = error * self._running(excess, error)
        return np.concatenate([error, v, self.motion.acceleration(q, v, tau)])

    def _running(self, excess: Array, error: Array) -> Array:
        """1 where the integral runs, 0 where it is halted, shape (nv,).

        A plain switch would make the equations slide along the limit, and an integrator of any order crawl.
        """
        band = _CLAMP_BAND * np.maximum(0.5 * (self.upper - self.lower), 1e-6)
        fade = np.clip(1.0 - np.abs(excess) / band, 0.0, 1.0)
        return np.where(excess * error > 0, fade, 1.0)

    def unholdable(self, robot: Robot) -> list[str]:
        """Joints that gravity at the goal loads beyond what saturation leaves them."""
        hold = self.motion.bias(self.goal, np.zeros(self.goal.size))
        beyond = (hold < self.lower) | (hold > self.upper)
        return [name for name, bad in zip(robot.joint_names, beyond, strict=True) if bad]


def _integrate(loop: _Loop, x0: Array, duration: float) -> tuple[OdeSolution, tuple[Status, str] | None]:
    """The motion as a continuous function, and why it broke off before `duration`, if it did."""
    nv = loop.goal.size
    start = 10 * float(np.abs(x0[nv:] - np.concatenate([loop.goal, np.zeros(nv)])).max())
    away_bound, speed_bound = max(_POSITION_BOUND, start), max(_VELOCITY_BOUND, start)
    solver = LSODA(loop.rate, 0.0, x0, duration, rtol=_RTOL, atol=_ATOL)
    times, pieces = [0.0], []
    stopped: tuple[Status, str] | None = None
    with warnings.catch_warnings():
        # LSODA warns of what its status says as well.
        warnings.simplefilter("ignore")
        while solver.status == "running" and stopped is None:
            reason = solver.step()
            finite = bool(np.all(np.isfinite(solver.y)))
            if solver.status == "failed" or not finite:
                stopped = ("failed", f"the integrator gave up at t = {times[-1]:.6g} s ({reason})")
                break
            times.append(solver.t)
            pieces.append(solver.dense_output())
            away = np.abs(solver.y[nv : 2 * nv] - loop.goal).max()
            speed = np.abs(solver.y[2 * nv :]).max()
            if away > away_bound or speed > speed_bound:
                where = f"a joint is {away:.4g} off its goal, at speed {speed:.4g}"
                stopped = ("diverged", f"diverged at t = {solver.t:.6g} s: {where}")
            elif len(pieces) >= _MAX_STEPS and solver.status == "running":
                stopped = ("failed", f"gave up at t = {solver.t:.6g} s after {_MAX_STEPS} integrator steps")
    if not pieces:
        raise ProblemError(f"the motion cannot be started: {stopped[1] if stopped else 'no step'}")
    return OdeSolution(times, pieces), stopped


def _verdict(
    stopped: tuple[Status, str] | None,
    arrival: float | None,
    tolerance: float,
    growth: float,
    course: Course,
    unholdable: list[str],
) -> tuple[Status, str]:
    """Status and message of a run."""
    notes = []
    if growth >= 0:
        notes.append(f"the loop is not stable at the goal, max Re λ = {growth:+.4g} 1/s")
    if unholdable:
        notes.append(f"the effort limit of {', '.join(unholdable)} does not hold the arm at the goal")
    if stopped is not None:
        status, what = stopped
    elif arrival is not None:
        status, what = "settled", f"all joints within {tolerance:g} of the goal from t = {arrival:.6g} s on"
    else:
        status, what = "not_settled", f"not settled: {course.final_error:.4g} from the goal at the end"
    return status, "; ".join([what, *notes])
