"""A Panda catches a goal that moves at 0.3 m/s: replanned at 50 Hz by armdyn's Resolver, and by Ruckig.

    pip install ruckig
    python scripts/live.py [SECONDS] [SEEDS] [DEADLINE]    # the goal moves for 1 s, from 5 random poses, then stays

Every 20 ms the planner gets the state that the reference will have 20 ms later, and where the goal is now. `track`'s
default controller follows the references at 1 kHz, with a payload of 0.1 kg that its model does not know. Ruckig has
the accelerations and jerks of Franka's data sheet; it knows no torques. The Resolver has these accelerations and 80 %
of the torques (a reserve for feedback), in the third row the torques alone: motions of 20 ms, which no loop follows.
"""

import sys
import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin

import armdyn as ad

PERIOD, SPEED, NEAR = 0.02, 0.3, 0.005
"""Of replanning [s]; of the goal [m/s]; of the tip from the goal, to have caught it [m]."""
ACCELERATION = np.array([15, 7.5, 10, 12.5, 15, 20, 20])
JERK = np.array([7500, 3750, 5000, 6250, 7500, 10000, 10000])
"""Franka's data sheet [rad/s², rad/s³]: https://frankaemika.github.io/docs/control_parameters.html"""

Plan = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], ad.Trajectory]
"""From a state (q, v, a) to a goal."""


def by_resolver(robot: ad.Robot, deadline: float, **limits: object) -> Plan:
    """Plan by armdyn, within a deadline [s]."""
    resolver = ad.Resolver(robot, reserve=0.2, velocity_reserve=0.05, **limits)
    return lambda q, v, a, goal: resolver.solve(q, v, goal, deadline).trajectory


def by_ruckig(robot: ad.Robot) -> Plan:
    """Plan by Ruckig."""
    import ruckig

    planner, request = ruckig.Ruckig(robot.nv), ruckig.InputParameter(robot.nv)
    request.max_velocity, request.max_acceleration, request.max_jerk = 0.95 * robot.limits.velocity, ACCELERATION, JERK

    def plan(q: np.ndarray, v: np.ndarray, a: np.ndarray, goal: np.ndarray) -> ad.Trajectory:
        request.current_position, request.current_velocity, request.current_acceleration, request.target_position = (
            q,
            v,
            a,
            goal,
        )
        found = ruckig.Trajectory(robot.nv)
        planner.calculate(request, found)
        t = np.linspace(0, max(found.duration, 2 * PERIOD), 201)
        q, v, a = (np.array(each) for each in zip(*(found.at_time(one) for one in t), strict=True))
        data = robot.model.createData()
        tau = np.array([pin.rnea(robot.model, data, *each) for each in zip(q, v, a, strict=True)])
        return ad.Trajectory(t, q, v, tau, robot.joint_names, model_hash=robot.model_hash)

    return plan


def goals(robot: ad.Robot, q: np.ndarray, direction: np.ndarray, seconds: float, ticks: int) -> np.ndarray:
    """Joint positions that bring the tip to the moving goal at every tick, with one orientation."""
    model, data, tip = robot.model, robot.model.createData(), robot.model.njoints - 1
    pin.forwardKinematics(model, data, q)
    start, out = data.oMi[tip].copy(), []
    for k in range(ticks):
        wanted = pin.SE3(start.rotation, start.translation + SPEED * min(k * PERIOD, seconds) * direction)
        for _ in range(5):
            jacobian = pin.computeJointJacobian(model, data, q, tip)
            pin.forwardKinematics(model, data, q)
            q = q + np.linalg.lstsq(jacobian, pin.log6(data.oMi[tip].actInv(wanted)).vector, rcond=1e-3)[0]
        out.append(q)
    return np.array(out)


def chased(robot: ad.Robot, plan: Plan, q: np.ndarray, wanted: np.ndarray) -> tuple[ad.Trajectory, list[float]]:
    """The reference that replanning leads to, and the times that the plans took [s]."""
    v, a, took, rows = np.zeros_like(q), np.zeros_like(q), [], []
    for k, goal in enumerate(wanted):
        if k and np.max(np.abs(q - goal)) < 1e-6 and not np.any(v):
            break
        began = time.perf_counter()
        motion = plan(q, v, a, goal)
        took.append(time.perf_counter() - began)
        at = motion(np.linspace(0, PERIOD, 21))
        rows += zip(k * PERIOD + np.linspace(0, PERIOD, 21)[:-1], at.q, at.v, at.tau, strict=False)
        q, v, a = at.q[-1], at.v[-1], (at.v[-1] - at.v[-2]) * 20 / PERIOD
    t, q, v, tau = (np.array(each) for each in zip(*rows, strict=True))
    return ad.Trajectory(t, q, v, tau, robot.joint_names, model_hash=robot.model_hash), took


def judged(robot: ad.Robot, name: str, plan: Plan, q: np.ndarray, wanted: np.ndarray, seconds: float) -> list[float]:
    """Time until the arm catches the goal, its lag, and the used part of its limits."""
    reference, took = chased(robot, plan, q, wanted)
    arm = robot.with_payload(ad.Payload(mass=0.1))
    run = ad.track(robot, reference, plant=arm, duration=len(wanted) * PERIOD)
    moved, data, tip = run.trajectory, robot.model.createData(), robot.model.njoints - 1

    def at(own: np.ndarray) -> np.ndarray:
        pin.forwardKinematics(robot.model, data, own)
        return data.oMi[tip].translation.copy()

    times = np.arange(len(wanted)) * PERIOD
    far = np.array([np.linalg.norm(at(a) - at(b)) for a, b in zip(moved(times).q, wanted, strict=True)])
    late = np.flatnonzero(far > NEAR)
    inverse = np.array([pin.rnea(robot.model, data, *x) for x in _states(reference)])
    return [
        times[late[-1]] + PERIOD - seconds,
        1e3 * np.mean(far[(times > 0.3) & (times < seconds)]),
        100 * np.max(np.abs(inverse) / robot.limits.effort_upper),
        100 * np.max(np.abs(moved.v) / robot.limits.velocity),
        100 * run.saturated,
        1e3 * np.median(took),
        1e3 * np.max(took),
    ]


def _states(motion: ad.Trajectory) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """States and accelerations in the middle between samples."""
    middle = motion((motion.t[1:] + motion.t[:-1]) / 2)
    return list(zip(middle.q, middle.v, np.diff(motion.v, axis=0) / np.diff(motion.t)[:, None], strict=True))


def main(seconds: float = 1.0, seeds: int = 5, deadline: float = PERIOD) -> None:
    """Chase goals by all planners."""
    robot = ad.Robot.from_library("panda")
    planners = {
        "armdyn": lambda: by_resolver(robot, deadline, acceleration_limit=ACCELERATION),
        "Ruckig": lambda: by_ruckig(robot),
        "armdyn, torques alone": lambda: by_resolver(robot, deadline),
    }
    ready = np.array([0, -0.785, 0, -2.356, 0, 1.571, 0.785])
    print("caught: after the goal has stopped [s]; lag: mean distance of the tip while the goal moves [mm]; torque,")
    print("speed: largest part of the limits [%]; clipped: part of the time [%]; plan: median and longest [ms]")
    for seed in range(seeds):
        random = np.random.default_rng(seed)
        direction = random.normal(size=3)
        direction /= np.linalg.norm(direction)
        wanted = goals(robot, ready + 0.3 * random.uniform(-1, 1, 7), direction, seconds, int((seconds + 1) / PERIOD))
        start = wanted[0] + 0.3 * random.uniform(-1, 1, 7)
        for name, made in planners.items():
            caught, lag, torque, speed, clipped, median, longest = judged(robot, name, made(), start, wanted, seconds)
            print(
                f"{seed} {name:26} caught {caught:+.2f}, lag {lag:5.1f}, torque {torque:5.1f}, speed {speed:5.1f}, "
                f"clipped {clipped:.1f}, plan {median:.1f} to {longest:.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main(*(kind(own) for kind, own in zip((float, int, float), sys.argv[1:], strict=False)))
