"""A PID loop between two poses: `track` with a reference at rest, in a continuous loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import MOST_SAMPLES, flag, number, whole
from armdyn.arrays import Array
from armdyn.control.laws.pid import DEFAULT_GAINS, Form, Pid, PidGains
from armdyn.control.loop.loop import MOST_RATE, Loop, expect_motors
from armdyn.control.loop.references import set_point
from armdyn.control.stability.linear import closed_loop_eigenvalues
from armdyn.control.tracking.arrival import Arrival, ArrivalRule
from armdyn.control.tracking.run import Run
from armdyn.control.tracking.track import MOST_ROWS, Setup
from armdyn.files import attributes
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import Robot, expect_robot

_SHORTEST, _LONGEST = 1e-5, 1e4
"""Longest run [s]."""
_RATE = 1000.0
"""Least ticks per second [Hz], memory permitting: the cubics between them are then within 1e-9 rad of the motion."""


def simulate_pid(
    robot: Robot,
    q_start: ArrayLike | str,
    q_goal: ArrayLike | str,
    gains: PidGains = DEFAULT_GAINS,
    *,
    v_start: ArrayLike | None = None,
    duration: float = 10.0,
    form: Form = "acceleration",
    saturate: bool | None = None,
    arrival_tolerance: float = 0.005,
    arrival_rule: ArrivalRule = "last_entry_all_joints",
    samples: int = 1001,
) -> Run:
    """Move an arm from start to goal under u = kp e + ki ∫e dt + kd ė, eq. (27), and measure its arrival time.

    It is `track` with `Pid(gains, form, feedforward=False)`, a set point and `Loop.ideal(saturate)`. With form
    "acceleration" this is the loop of eq. (24): q̈ = D⁻¹(-C v - g) + u. Position and velocity limits are not enforced.
    An unstable loop returns too, with a status and the motion up to there.

    Args:
        robot: an arm.
        q_start: [rad or m], shape (nv,), or the name of one of `robot.poses`.
        q_goal: likewise.
        gains: see `PidGains`; by default `DEFAULT_GAINS`, which suit "computed_torque" and may not suit other forms.
            The message says so of a run with them that does not arrive.
        v_start: [rad/s or m/s], shape (nv,); None: at rest.
        duration: of the simulation [s].
        form: see `Form`.
        saturate: clip torques at the effort limits, and halt the integral of a joint whose torque is clipped and whose
            error would increase it; None: for form "torque" only.
        arrival_tolerance: of a joint's error [rad or m].
        arrival_rule: see `ArrivalRule`; by default all joints have to come and stay, as `Run.settled` requires, too.
        samples: number of samples of the trajectory, evenly spaced, both ends included.

    Raises:
        ProblemError: no Robot; wrong length or not finite; duration or tolerance not positive; duration not within
            10 µs to 10,000 s; unknown form or rule; less than two samples, or more than a million.
    """
    goal, start = pose_given(expect_robot(robot), q_goal, "q_goal"), pose_given(robot, q_start, "q_start")
    seconds = number(duration, "duration", unit="s", sign="positive", least=_SHORTEST, most=_LONGEST)
    controller, arrival = Pid(gains, form, feedforward=False), Arrival(arrival_rule, arrival_tolerance)
    expect_motors(robot, "a PID controller")
    samples = whole(samples, "samples", least=2, most=MOST_SAMPLES)
    saturate = form == "torque" if saturate is None else flag(saturate, "saturate")
    growth = float(closed_loop_eigenvalues(robot, goal, gains, form)[0].real)
    loop = replace(Loop.ideal(saturate), rate=_ticks(seconds, samples - 1, robot.nv) / seconds)
    setup = Setup.of(
        robot, set_point(robot, goal, seconds), controller, loop,
        duration=seconds, tolerance=arrival.tolerance, q_start=start, v_start=v_start,
    )  # fmt: skip
    run = _arrived(setup.run(robot, name=f"PID ({form.replace('_', ' ')})"), goal, arrival, growth)
    message = run.message
    if run.arrival_time is None and gains is DEFAULT_GAINS:
        message += f"; the gains are the default {gains}, which may not suit form {form!r}"
    if saturate and (weak := _unholdable(robot, goal)):
        message += f"; the effort limit of {', '.join(weak)} does not hold the arm at the goal"
    t = np.linspace(0.0, run.trajectory.duration, samples)
    state = run.trajectory(t)
    trajectory = replace(run.trajectory, t=t, q=state.q, v=state.v, tau=state.tau)
    return replace(run, message=message, trajectory=trajectory)


def _ticks(duration: float, steps: int, nv: int) -> int:
    """Number of ticks of a run: a multiple of the trajectory's steps, or as many as rate and memory permit."""
    most = min(MOST_ROWS // (3 * nv), int(duration * MOST_RATE))
    return min(steps * int(np.ceil(duration * _RATE / steps)), most)


def _arrived(run: Run, goal: Array, arrival: Arrival, growth: float) -> Run:
    """The run with its arrival. Staying at the goal takes a loop that is stable there."""
    stays = run.status in ("settled", "not_settled") and growth < 0
    settled = Arrival(tolerance=arrival.tolerance).time(run.trajectory, goal) if stays else None
    run = replace(
        run,
        settled_time=settled,
        arrival_time=arrival.time(run.trajectory, goal) if stays or arrival.rule == "first_crossing" else None,
        arrival_rule=arrival.rule,
        max_real_eigenvalue=growth,
    )
    if growth < 0:
        return run
    message = f"{'not settled: ' if run.settled else ''}{run.message}; the loop is not stable at the goal, "
    message += f"max Re λ = {growth:+.4g} 1/s"
    return replace(run, status="not_settled" if run.settled else run.status, message=message)


def _unholdable(robot: Robot, goal: Array) -> list[str]:
    """Joints whose effort limit is less than the holding torque at the goal."""
    beyond = ~robot.limits.actuators.allows(robot.holding_torque(goal), goal, np.zeros(robot.nv))
    return [name for name, weak in zip(robot.joint_names, beyond, strict=True) if weak]


def pid_summary(run: Run) -> dict[str, object]:
    """Summary of a run of `simulate_pid` for JSON: success means that it arrived; units as in `Run`."""
    return {
        "success": run.arrival_time is not None,
        "status": str(run.status),
        **attributes(run, "message", "arrival_time", "arrival_rule", "overshoot", "max_real_eigenvalue"),
        "settling_time": run.settled_time,
        "limits_exceeded": list(run.limits_exceeded),
        "duration": run.trajectory.duration,
    }
