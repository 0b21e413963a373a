"""Result of a controller's run along a reference, and the envelope of many runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import parts_of
from armdyn.arrays import Array, Flags
from armdyn.control.loop.references import Ticks
from armdyn.control.stability.rate import SampledStability
from armdyn.control.tracking.arrival import ArrivalRule
from armdyn.dynamics.driven import Driven
from armdyn.files import as_json, attributes
from armdyn.models.robots.robot import Robot
from armdyn.rendering import renderer
from armdyn.reprs import brief, called, joint_unit
from armdyn.trajectory import Trajectory
from armdyn.trajectory.value import Hold as TorqueHold

Status = Literal["settled", "not_settled", "diverged", "failed"]
"""See `Run.status`."""

_LOST = 20.0
"""Distance from the reference at which an arm counts as lost, in tolerances: 0.1 rad by default."""

STAYS = 0.1
"""Least time at the goal, until the run ends, of an arm that has settled and does not just pass [s]."""

_FASTER = 0.01
"""Part of a velocity limit that the feedback of a motion on its limit may exceed it by: encoders take up to 0.1 %."""


@brief
@dataclass(frozen=True, eq=False)
class Run:
    """A motion under a controller, with its verdict.

    Attributes:
        trajectory: of the arm, one sample per tick; a sampled loop's torque is held from its sample to the next.
        status: "settled": all joints came within the tolerance of the goal and stayed until the end of the run, 0.1 s
            or longer; "not_settled": the run is whole but they did not; "diverged": stopped 100 rad from the goal or at
            1000 rad/s; "failed": no step of the integrator was short enough.
        message: the status in a sentence, with its numbers and the joint.
        settled_time: from when on all joints stay within the tolerance of the goal [s]; None if they do not.
        error_at_end: largest distance of a joint from the goal when the reference ends [rad or m]; inf where the run
            broke off before.
        peak_error: largest distance of a joint from the reference [rad or m].
        peak_velocity: largest speed of a joint as a part of its limit [-]; 0 without limits.
        limits_exceeded: velocity limits that were exceeded by more than 1 %, and position limits by more than the
            tolerance, in words, with the time of the largest excess; a settled arm may have exceeded some.
        saturated: part of the time in which some torque was clipped [-]: until it settled, or the reference ended.
        failed_time: when a joint first was 20 tolerances from the reference, and farther than at the start, or when
            the run broke off [s]; None: never.
        overshoot: farthest travel of each joint past its goal, seen from the start, less the reference's own [rad or
            m], shape (nv,).
        stability: of the loop at rest at the goal, of a run of `track` that did not settle; else None.
        arrival_time: first time in the final position [s], by `arrival_rule`; None: never. A rule that says *stay*
            has none where a loop of `simulate_pid` is unstable at the goal, or the run broke off.
        arrival_rule: see `ArrivalRule`.
        max_real_eigenvalue: of `simulate_pid`: largest real part [1/s] of the loop's eigenvalues at the goal, without
            saturation; the loop is stable there if it is negative. None: not computed.
        unit: of the joints' positions, in words.
    """

    trajectory: Trajectory
    status: Status
    message: str
    settled_time: float | None
    error_at_end: float
    peak_error: float
    peak_velocity: float
    saturated: float
    failed_time: float | None
    overshoot: Array
    stability: SampledStability | None = None
    arrival_time: float | None = None
    arrival_rule: ArrivalRule = "last_entry_all_joints"
    max_real_eigenvalue: float | None = None
    unit: str = "rad or m"
    limits_exceeded: tuple[str, ...] = ()

    def _repr_parts(self) -> list[str]:
        """Parts of the `repr`."""
        when = "" if self.settled_time is None else f" after {self.settled_time:.6g} s"
        return [
            called(self.trajectory.name) if self.trajectory.name else "without a name",
            f"{self.status.replace('_', ' ')}{when}",
            f"largest error {self.peak_error:.4g}",
            f"{self.trajectory.duration:.6g} s",
        ]

    def _repr_html_(self) -> str:
        """HTML for notebooks: a table and a picture."""
        return renderer().card(self)

    @property
    def settled(self) -> bool:
        """Whether all joints came within the tolerance of the goal and stayed."""
        return self.status == "settled"

    def with_stability(self, stability: SampledStability) -> Self:
        """The run with the stability at its goal, in the message too if the loop is unstable."""
        at_goal = "" if stability.stable else f"; at the goal the loop is {stability.message}"
        return replace(self, stability=stability, message=self.message + at_goal)

    def words(self) -> dict[str, str]:
        """The numbers of a run in words, by their names."""
        return {
            "overshoot": f"{', '.join(f'{x:z.4f}' for x in self.overshoot)} {self.unit}",
            "error at the reference's end": f"{self.error_at_end:.4g} {self.unit}",
            "largest error on the way": f"{self.peak_error:.4g} {self.unit}",
            "largest speed": f"{100 * self.peak_velocity:.3g} % of its limit",
            "torque on its limit": f"{100 * self.saturated:.0f} % of the time",
        }

    def summary(self) -> dict[str, object]:
        """Summary of the run for JSON: success means that it settled; units as above."""
        errors = ("error_at_end", "peak_error", "peak_velocity", "saturated", "failed_time", "overshoot")
        own = attributes(self, "message", "settled_time", *errors)
        exceeded = list(self.limits_exceeded)
        facts = {"success": self.settled, "status": str(self.status), **own, "limits_exceeded": exceeded}
        return facts if self.stability is None else facts | {"stability": as_json(vars(self.stability))}


def run_of(robot: Robot, driven: Driven, ticks: Ticks, tolerance: float, name: str, hold: TorqueHold) -> Run:
    """Judge a simulated loop.

    Args:
        robot: the arm that moved.
        driven: its motion.
        ticks: the reference.
        tolerance: of a joint's distance from the goal [rad or m].
        name: of the trajectory.
        hold: of the trajectory.
    """
    t = np.arange(len(driven.q)) / ticks.rate
    errors = np.abs(driven.q - ticks.goal)
    within_since = settled_time(t, errors.max(axis=1), tolerance) if driven.ended == "whole" else None
    status, message = _status(robot, driven, within_since, errors[-1], tolerance, float(t[-1]))
    settled = within_since if status == "settled" else None
    speeds = np.abs(driven.v).max(axis=0) / robot.limits.velocity
    if exceeded := _exceeded(robot, driven, speeds, t, tolerance):
        message = f"{message}; {'and' if settled is None else 'but'} {'; '.join(exceeded)}"
    off = np.abs(driven.q - ticks.q[np.minimum(np.arange(len(t)), len(ticks.q) - 1)]).max(axis=1)
    lost = np.flatnonzero(off > max(_LOST * tolerance, float(off[0])))
    at_end = [np.interp(ticks.duration, t, one) for one in (driven.q - ticks.goal).T]
    broke = float(t[-1]) if driven.ended != "whole" else None
    moving = float(t[-1]) if settled is None else max(ticks.duration, settled)
    during = driven.clipped[: max(int(np.ceil(moving * ticks.rate)), 1)]
    return Run(
        trajectory=_trajectory(robot, driven, t, name, hold),
        status=status,
        message=message,
        settled_time=settled,
        error_at_end=float(np.abs(at_end).max()) if ticks.duration <= t[-1] + 1e-12 else float("inf"),
        peak_error=float(off.max()),
        peak_velocity=float(speeds.max()),
        saturated=float(during.any(axis=1).mean()) if len(during) else 0.0,
        failed_time=float(t[lost[0]]) if lost.size else broke,
        overshoot=np.maximum(overshoot(driven.q, ticks.goal) - overshoot(ticks.q, ticks.goal), 0.0),
        arrival_time=settled,
        unit=joint_unit(robot.slides),
        limits_exceeded=exceeded,
    )


def _exceeded(robot: Robot, driven: Driven, speeds: Array, t: Array, tolerance: float) -> tuple[str, ...]:
    """Velocity and position limits that a motion exceeded, in words.

    Args:
        robot: the arm that moved.
        driven: its motion.
        speeds: largest of each joint, as a part of its limit [-], shape (nv,).
        t: times [s], shape (n,).
        tolerance: distance from a position limit that counts [rad or m].
    """
    (lower, upper), q, found = (robot.limits.position_lower, robot.limits.position_upper), driven.q, list[str]()
    beyond = np.maximum(lower - q.min(axis=0), q.max(axis=0) - upper)
    for i, (name, slides) in enumerate(zip(robot.joint_names, robot.slides, strict=True)):
        if speeds[i] > 1 + _FASTER:
            when = t[np.argmax(np.abs(driven.v[:, i]))]
            found.append(f"{name} reaches {100 * speeds[i]:.4g} % of its velocity limit at t = {when:.4g} s")
        if beyond[i] > tolerance:
            when = t[np.argmax(np.maximum(lower[i] - q[:, i], q[:, i] - upper[i]))]
            where = f"{beyond[i]:.4g} {'m' if slides else 'rad'} beyond its position limit"
            found.append(f"{name} is {where} at t = {when:.4g} s")
    return tuple(found)


def settled_time(t: Array, error: Array, tolerance: float) -> float | None:
    """Time from which a distance stays within a tolerance [s], linear between samples; None: it does not.

    Args:
        t: times [s], shape (n,).
        error: distances [rad or m], shape (n,).
        tolerance: in their unit.
    """
    outside = np.flatnonzero(~(error <= tolerance))
    if not outside.size:
        return float(t[0])
    k = int(outside[-1])
    if k == t.size - 1:
        return None
    part = (error[k] - tolerance) / (error[k] - error[k + 1])
    return float(t[k] + part * (t[k + 1] - t[k]))


def overshoot(q: Array, goal: Array) -> Array:
    """Overshoot of each joint past its goal, seen from the start [rad or m], shape (nv,).

    Of a joint that starts at its goal, its largest distance from it.

    Args:
        q: positions [rad or m], shape (n, nv).
        goal: [rad or m], shape (nv,).
    """
    way = np.sign(goal - q[0])
    past = np.where(way == 0, np.abs(q - goal), way * (q - goal))
    return np.asarray(np.maximum(past.max(axis=0), 0.0))


def _trajectory(robot: Robot, driven: Driven, t: Array, name: str, hold: TorqueHold) -> Trajectory:
    """The trajectory; also of a run that broke off at once, with two samples."""
    rows = slice(None) if t.size > 1 else [0, 0]
    times = t if t.size > 1 else np.array([0.0, 1e-9])
    return Trajectory(
        t=times, q=driven.q[rows], v=driven.v[rows], tau=np.nan_to_num(driven.tau[rows]),
        joint_names=robot.joint_names, name=robot.marked(name), model_hash=robot.model_hash, hold=hold,
    )  # fmt: skip


def _status(
    robot: Robot, driven: Driven, within_since: float | None, last: Array, tolerance: float, end: float
) -> tuple[Status, str]:
    """Status and message of a run.

    Args:
        robot: the arm.
        driven: the simulated loop.
        within_since: time from which all joints stay within the tolerance of the goal [s]; None: they do not.
        last: distances from the goal at the end [rad or m], shape (nv,).
        tolerance: of the distances [rad or m].
        end: last time of the run [s].
    """
    worst = int(np.argmax(last))
    unit = "m" if robot.slides[worst] else "rad"
    where = f"{robot.joint_names[worst]} is {last[worst]:.4g} {unit} from the goal"
    if driven.ended == "diverged":
        speed = f"{np.abs(driven.v[-1]).max():.4g} {joint_unit(robot.slides, 'rad/s', 'm/s')}"
        return "diverged", f"diverged at t = {end:.6g} s: {where}, the fastest joint's speed is {speed}"
    if driven.ended == "failed":
        return "failed", f"the integrator gave up at t = {end:.6g} s, where no step is short enough: {where}"
    if within_since is not None:
        within = f"all joints within {tolerance:g} {joint_unit(robot.slides)} of the goal"
        near = f"{within} from t = {within_since:.6g} s on"
        if end - within_since >= STAYS - 1e-9:  # rounding of ticks over the rate
            return "settled", near
        return "not_settled", f"not settled: {near}, but the run ends at {end:.6g} s: they must stay for {STAYS:g} s"
    clipped: Flags = np.any(driven.clipped[-max(len(driven.clipped) // 10, 1) :], axis=0)
    held = [robot.joint_names[i] for i in np.flatnonzero(clipped)]
    tail = f"; the torque of {', '.join(held)} is on its limit to the end" if held else ""
    return "not_settled", f"not settled: {where} at t = {end:.6g} s{tail}"


@brief
@dataclass(frozen=True, eq=False)
class Envelope:
    """Least, greatest and quantiles of the joints' distances from a reference, of many runs, time by time.

    Attributes:
        t: times [s], shape (n,).
        low: of all runs the least distance [rad or m], shape (n, nv).
        high: the greatest, likewise; inf from where on a run broke off.
        parts: of the runs, whose distances `quantiles` has, shape (m,), increasing.
        quantiles: quantiles of the distances over the runs [rad or m], shape (m, n, nv).
        joint_names: one per joint.
        duration: of the reference [s].
        tolerance: of a joint's distance from the goal, to be settled [rad or m].
        count: of runs.
    """

    t: Array
    low: Array
    high: Array
    parts: Array
    quantiles: Array
    joint_names: tuple[str, ...]
    duration: float
    tolerance: float
    count: int

    @classmethod
    def of(
        cls,
        t: Array,
        errors: NDArray[Any],
        parts: Sequence[float],
        joint_names: tuple[str, ...],
        duration: float,
        tolerance: float,
    ) -> Self:
        """Envelope of all distances; each quantile is the distance of a run.

        Args:
            t: times [s], shape (n,).
            errors: distances [rad or m], shape (runs, n, nv); inf from where on a run broke off.
            parts: see above.
            joint_names: see above.
            duration: see above.
            tolerance: see above.

        Raises:
            ProblemError: a part is not in 0 to 1.
        """
        own = np.sort(parts_of(parts, "parts"))
        quantiles = np.quantile(errors, own, axis=0, method="inverted_cdf").astype(float)
        low, high = errors.min(axis=0).astype(float), errors.max(axis=0).astype(float)
        return cls(t, low, high, own, quantiles, joint_names, duration, tolerance, len(errors))
