"""Simulation of a robot arm under PID control."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import OdeSolution

from armdyn.arguments import MOST_SAMPLES, number, whole
from armdyn.control.pid.approach import Approach
from armdyn.control.pid.arrival import Arrival, ArrivalRule
from armdyn.control.pid.equations import PidLoop, Status, integrate
from armdyn.control.pid.gains import DEFAULT_GAINS, ContinuousPid, Form, PidGains
from armdyn.control.pid.motion import EquationsOfMotion, motion_of
from armdyn.control.pid.poles import closed_loop_matrix, eigenvalues
from armdyn.errors import ProblemError
from armdyn.models import Robot
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import expect_robot
from armdyn.models.values.per_joint import per_joint
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_LONGEST = 1e4
"""Of a simulation [s]: the integrator's most steps do not reach further."""


@brief
@dataclass(frozen=True, eq=False)
class PidRun:
    """A simulated motion under PID control, and what came of it.

    Attributes:
        trajectory: uniform samples up to the end of the run; tau is what was applied, after any saturation.
        arrival_time: first time in the final position [s], by `arrival_rule`; None if there is none. A rule
            that asks to *stay* has none where the loop is unstable at the goal, or the run broke off.
        arrival_rule: see `ArrivalRule`.
        settling_time: from when on all joints stay within the tolerance [s], whatever the rule is; None if they do not.
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
    settling_time: float | None
    status: Status
    message: str
    overshoot: Array
    max_real_eigenvalue: float

    @property
    def settled(self) -> bool:
        """All joints came within the tolerance and stayed, and the loop is stable at the goal."""
        return self.status == "settled"


@dataclass(frozen=True, eq=False)
class Move:
    """From where to where an arm is to go, and how long it is watched.

    Attributes:
        start: positions [rad or m], shape (nv,).
        goal: positions [rad or m], shape (nv,).
        velocity: at the start [rad/s or m/s], shape (nv,).
        duration: [s].
    """

    start: Array
    goal: Array
    velocity: Array
    duration: float

    @classmethod
    def of(
        cls, robot: Robot, q_start: ArrayLike | str, q_goal: ArrayLike | str, v_start: ArrayLike | None, duration: float
    ) -> Self:
        """What was asked of a robot, checked; `v_start` None: it starts at rest.

        Raises:
            ProblemError: no Robot; wrong length or not finite; duration not positive or beyond 10,000 s.
        """
        rest = np.zeros(expect_robot(robot).nv)
        goal, start = pose_given(robot, q_goal, "q_goal"), pose_given(robot, q_start, "q_start")
        given = rest if v_start is None else v_start
        velocity = per_joint(given, robot.joint_names, "v_start", error=ProblemError, scalar=False)
        seconds = number(duration, "duration", unit="s", sign="positive")
        if seconds > _LONGEST:
            raise ProblemError(f"duration is {seconds:g} s; expected at most {_LONGEST:g} s")
        return cls(start, goal, velocity, seconds)


def simulate_pid(
    robot: Robot,
    *,
    q_start: ArrayLike | str,
    q_goal: ArrayLike | str,
    v_start: ArrayLike | None = None,
    gains: PidGains = DEFAULT_GAINS,
    duration: float = 10.0,
    form: Form = "acceleration",
    saturate: bool | None = None,
    arrival_tolerance: float = 0.005,
    arrival_rule: ArrivalRule = "last_entry_all_joints",
    samples: int = 1001,
    dynamics: EquationsOfMotion | None = None,
) -> PidRun:
    """Move an arm from start to goal under u = kp e + ki ∫e dt + kd ė, eq. (27), and see when it arrives.

    With form "acceleration" this is the paper's loop (24): q̈ = D⁻¹(-C v - g) + u. Position and velocity
    limits are not enforced. An unstable loop returns too, with a status and the motion up to there.

    Args:
        robot: an arm.
        q_start: [rad or m], shape (nv,), or the name of one of `robot.poses`.
        q_goal: likewise.
        v_start: [rad/s or m/s], shape (nv,); None: at rest.
        gains: see `PidGains`; by default `DEFAULT_GAINS`, which suit "computed_torque" and may not suit other forms.
        duration: how long to simulate [s].
        form: see `Form`.
        saturate: see `ContinuousPid`.
        arrival_tolerance: of a joint's error [rad or m].
        arrival_rule: see `ArrivalRule`; by default all joints have to come and stay, as `PidRun.settled` asks, too.
        samples: how many the trajectory has, both ends included.
        dynamics: other equations of motion than the robot's own, which have its joints' friction.

    Raises:
        ProblemError: no Robot; wrong length or not finite; duration or tolerance not positive; duration beyond
            10,000 s; unknown form or rule; less than two samples, or more than a million; dynamics without the
            functions that they have.
    """
    move = Move.of(robot, q_start, q_goal, v_start, duration)
    arrival = Arrival(arrival_rule, arrival_tolerance)
    return simulate(robot, ContinuousPid(gains, form, saturate), move, arrival, samples=samples, dynamics=dynamics)


def simulate(
    robot: Robot,
    controller: ContinuousPid,
    move: Move,
    arrival: Arrival,
    *,
    samples: int = 1001,
    dynamics: EquationsOfMotion | None = None,
) -> PidRun:
    """The same of a controller, a move and an arrival as values.

    Args:
        robot: an arm.
        controller: what moves it.
        move: from where to where.
        arrival: when it is there.
        samples: how many the trajectory has, both ends included.
        dynamics: other equations of motion than the robot's own.

    Raises:
        ProblemError: the gains are for another number of joints; less than two samples, or more than a million.
    """
    samples = whole(samples, "samples", least=2, most=MOST_SAMPLES)
    motion = motion_of(robot, dynamics)
    loop = PidLoop.of(robot, motion, controller, move.goal)
    growth = float(eigenvalues(closed_loop_matrix(motion, move.goal, controller))[0].real)
    followed = integrate(loop, np.concatenate([np.zeros(robot.nv), move.start, move.velocity]), move.duration)
    approach = Approach(followed.solution, move.goal)
    stays = followed.stopped is None and growth < 0
    settling = approach.time(Arrival("last_entry_all_joints", arrival.tolerance)) if stays else None
    status, what = followed.stopped or _came(settling, arrival.tolerance, approach)
    return PidRun(
        trajectory=_sampled(robot, loop, followed.solution, samples),
        arrival_time=approach.time(arrival) if stays or arrival.rule == "first_crossing" else None,
        arrival_rule=arrival.rule,
        settling_time=settling,
        status=status,
        message="; ".join([what, *_notes(growth, loop.unholdable(robot))]),
        overshoot=approach.overshoot(),
        max_real_eigenvalue=growth,
    )


def _sampled(robot: Robot, loop: PidLoop, solution: OdeSolution, samples: int) -> Trajectory:
    """A motion at even times, with the torque that the arm gets."""
    t = np.linspace(0.0, solution.t_max, samples)
    x = solution(t)
    _, q, v = np.split(x, 3)
    return Trajectory(
        t=t,
        q=q.T,
        v=v.T,
        tau=np.array([loop.torque(column) for column in x.T]),
        joint_names=robot.joint_names,
        name=f"PID ({loop.form.replace('_', ' ')})",
        model_hash=robot.model_hash,
    )


def _came(settling: float | None, tolerance: float, approach: Approach) -> tuple[Status, str]:
    """Status of a run that is whole, and the same in words."""
    if settling is not None:
        return "settled", f"all joints within {tolerance:g} of the goal from t = {settling:.6g} s on"
    return "not_settled", f"not settled: {approach.final_error:.4g} from the goal at the end"


def _notes(growth: float, unholdable: list[str]) -> list[str]:
    """What is wrong with a loop at its goal, in words."""
    notes = []
    if growth >= 0:
        notes.append(f"the loop is not stable at the goal, max Re λ = {growth:+.4g} 1/s")
    if unholdable:
        notes.append(f"the effort limit of {', '.join(unholdable)} does not hold the arm at the goal")
    return notes


def pid_summary(run: PidRun) -> dict[str, object]:
    """A closed-loop run as JSON says it: success is that it arrived; units as in `PidRun`."""
    return {
        "success": run.arrival_time is not None,
        "status": str(run.status),
        "message": run.message,
        "arrival_time": run.arrival_time,
        "arrival_rule": run.arrival_rule,
        "settling_time": run.settling_time,
        "overshoot": [float(x) for x in run.overshoot],
        "max_real_eigenvalue": run.max_real_eigenvalue if np.isfinite(run.max_real_eigenvalue) else None,
        "duration": run.trajectory.duration,
    }
