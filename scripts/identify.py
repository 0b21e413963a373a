"""Identification, measured: a robot's log, simulated logs, exciting motions, planning with the result.

python scripts/identify.py [--log LOG.npz --robot panda] [--logs 200] [--plans 5] [--first 10000] [--faults 6]
"""

import argparse
import time
from dataclasses import replace

import numpy as np
from scipy.signal import savgol_filter

import armdyn as ad
from armdyn.identification.equations import mean_regressor, rigid_torques
from armdyn.studies.reserve import FINE_RESERVES

FIRST = 0.6
"""Part of a log that is fitted; the rest is predicted."""
ARMS = {"panda": (0.5, 2.0), "ur5": (0.5, 2.0), "rrr": (0.02, 0.3)}
OTHERS = {"z1": (0.3, 1.5), "kinova": (0.5, 2.0)}
"""Simulated arms and the range of their payloads [kg]; further ones for logs with faults."""
PLANAR, SPATIAL = ([-0.02, 0, -0.02], [0.05, 0, 0.02]), ([-0.05, -0.05, 0.03], [0.05, 0.05, 0.13])
"""Ranges of the payloads' centres in the tip's frame [m]: a planar arm feels nothing across its plane."""
CENTRE = {"rrr": (0.015, 0, 0), "ur5": (0, 0, 0.08)}
"""Their middles [m]."""
POSES = {
    "rrr": ([-np.pi / 2, 0, 0], [1.0, 0, 0]),
    "ur5": ([0, -1.57, 1.57, -1.57, -1.57, 0], [1, -0.9, 1, -1, -1.2, 0.5]),
}
"""Start and goal of the planned motions [rad]."""
WIDE_RESERVES = (0.1, 0.2, 0.3, 0.45, 0.6)
"""Reserves of motions for the range of arms."""
NOISE, ENCODER = 0.005, 1e-4
"""Torque noise as a part of the limits; encoder step [rad]."""


def arm(name):
    """A robot by name."""
    return ad.Robot.from_spec(ad.ArmSpec.paper(name)) if name == "rrr" else ad.Robot.from_library(name)


def line(name, values):
    """One row of a table."""
    print("|", name, "|", " | ".join(f"{value:.3g}" for value in np.atleast_1d(values)), "|")


def rms(values):
    """Root mean square of each column."""
    return np.sqrt(np.mean(values**2, axis=0))


def least_squares(robot, q, v, a, tau, cut, rounds):
    """Errors of least squares for inertias, Coulomb (width 0.01), viscous friction and offset, on the rest.

    Of more than one round each joint is weighted by its residuals of the round before.
    """
    sign, eye = np.tanh(v / 0.01), np.eye(robot.nv)
    own = [one[:, :, None] * eye for one in (sign, v, np.ones_like(v))]
    columns = np.concatenate([mean_regressor(robot, q, v, a, 1), *own], axis=2)
    noise = np.ones(robot.nv)
    for _ in range(rounds):
        scaled = (columns[:cut] / noise[:, None]).reshape(cut * robot.nv, -1)
        x = np.linalg.lstsq(scaled, (tau[:cut] / noise).ravel(), rcond=1e-9)[0]
        noise = rms(tau[:cut] - columns[:cut] @ x)
    return rms(tau[cut:] - columns[cut:] @ x)


def measured_log(path, name):
    """RMS torque errors on the end of a measured log by fits of its beginning."""
    robot, data = arm(name), np.load(path, allow_pickle=False)
    t, q, v, tau = (data[one] for one in ("t", "q", "v", "tau"))
    a = savgol_filter(v, 51, 3, deriv=1, delta=float(np.median(np.diff(t))), axis=0)
    cut = int(FIRST * t.size)
    print(f"RMS torque error on the last {100 - 100 * FIRST:.0f} % of {path} [N m or N]")
    line("measured torque", rms(tau[cut:]))
    line("URDF", rms(tau[cut:] - rigid_torques(robot, q[cut:], v[cut:], a[cut:])))
    line("least squares", least_squares(robot, q, v, a, tau, cut, 1))
    line("least squares, weighted", least_squares(robot, q, v, a, tau, cut, 4))
    log = ad.Log(t=t[:cut], q=q[:cut], v=v[:cut], tau=tau[:cut])
    for what in ("friction", "payload", "all"):
        begun = time.process_time()
        found = ad.identify(robot, log, what)
        seconds = time.process_time() - begun
        line(f"{what}, {seconds:.1f} s", rms(tau[cut:] - found.torques(q[cut:], v[cut:], a[cut:])))
    print(
        f"{found.measured_combinations} of {found.combinations} combinations measured, condition {found.condition:.3g}"
    )


def true_arm(name, rng):
    """The arm as it is known, and one with a payload and friction that are not."""
    robot = arm(name)
    mass, size = rng.uniform(*(ARMS | OTHERS)[name]), rng.uniform(0.03, 0.08)
    centre = rng.uniform(*(PLANAR if name == "rrr" else SPATIAL))
    payload = ad.Payload(mass=mass, com=centre, inertia=0.4 * mass * size**2 * rng.uniform(0.7, 1.2, 3))
    limits = robot.limits.effort_upper
    friction = rng.uniform(0, 0.02, (2, robot.nv)) * limits
    return robot, robot.with_payload(payload).with_friction(friction[0] / 2, friction[1])


def log_of(true, motion, rng):
    """A log of an arm along a motion: encoder steps, torque noise."""
    at = motion.resample(1000.0)
    tau = rigid_torques(true, at.q, at.v, at.a) + true.friction.torque(at.v)
    tau = tau + rng.normal(size=tau.shape) * NOISE * true.limits.effort_upper
    return ad.Log(t=at.t, q=np.round(at.q / ENCODER) * ENCODER, tau=tau)


def payload_errors(true, estimate):
    """Relative error of the mass, and of the centre [m]."""
    own, found = true.payload, estimate.robot.payload
    return abs(found.mass / own.mass - 1), np.linalg.norm(np.subtract(found.com, own.com))


def simulated_logs(seeds):
    """Errors and coverage of payloads from logs of random motions."""
    print(f"{len(seeds)} simulated logs of 10 s each: mass [%], centre [mm], medians; coverage of 95 % [%]; CPU [s]")
    options = ad.IdentifyOptions(held_out=0)
    for name in ARMS:
        errors, hits, seconds = [], [], []
        for seed in seeds:
            rng = np.random.default_rng(seed)
            robot, true = true_arm(name, rng)
            motion = ad.exciting_motion(robot, 10.0, ad.ExcitingOptions(candidates=1, generations=0, seed=seed))
            log, begun = log_of(true, motion, rng), time.process_time()
            estimate = ad.identify(robot, log, "payload", options)
            seconds.append(time.process_time() - begun)
            errors.append(payload_errors(true, estimate))
            own = true.payload
            truth = [own.mass, *own.com, *own.inertia, 0, 0, 0, *true.friction.damping, *true.friction.coulomb]
            numbers = zip(estimate.parameters, [*truth, *np.zeros(robot.nv)], strict=True)
            hits += [one.interval[0] <= value <= one.interval[1] for one, value in numbers if one.measured]
        line(name, [*np.median(errors, axis=0) * [100, 1000], 100 * np.mean(hits), np.mean(seconds)])


FAULTS = ("none", "stribeck", "direction", "play", "gain")
"""Faults of a log: friction that rises at rest or differs with the direction, a gear's play, a sensor's scale."""


def faulty_log(true, motion, fault, rng):
    """A log of an arm with a fault that the model lacks."""
    log, at = log_of(true, motion, rng), motion.resample(1000.0)
    q, tau, j = log.q.copy(), log.tau.copy(), int(rng.integers(true.nv))
    sign, coulomb = np.tanh(at.v / true.friction.width), true.friction.coulomb
    if fault == "stribeck":
        size, slow = rng.uniform(0.3, 1.0), rng.uniform(0.05, 0.3)
        tau += size * coulomb * np.exp(-((at.v / slow) ** 2)) * sign
    elif fault == "direction":
        tau += 0.3 * rng.choice([-1, 1], true.nv) * coulomb * np.abs(sign)
    elif fault == "play":
        size = rng.uniform(2e-3, 5e-3)
        for i in range(1, len(q)):
            q[i, j] = np.clip(q[i - 1, j], log.q[i, j] - size, log.q[i, j] + size)
    elif fault == "gain":
        tau[:, j] *= rng.choice([0.92, 1.08])
    return ad.Log(t=log.t, q=q, tau=tau)


def faults(seeds, names=("rrr", "ur5", "z1", "kinova")):
    """Unfit and named logs, coverage of the measured numbers of the others, and the share of measured numbers."""
    print("fault, logs, unfit, named; coverage of 95 % of the others, measured numbers of all [%]")
    for fault in FAULTS:
        rows, shares, hits = [], [], []
        for seed, name in ((seed, name) for seed in seeds for name in names):
            rng = np.random.default_rng([seed, sum(map(ord, name)), FAULTS.index(fault)])
            robot, true = true_arm(name, rng)
            friction = rng.uniform(0.002, 0.02, (2, robot.nv)) * robot.limits.effort_upper
            true = true.with_friction(friction[0] / 2, friction[1], float(rng.choice([0.01, 0.02, 0.05])))
            motion = ad.exciting_motion(robot, 8.0, ad.ExcitingOptions(candidates=1, generations=0, seed=seed))
            log = faulty_log(true, motion, fault, rng)
            found = ad.identify(robot, log, "payload", ad.IdentifyOptions(held_out=0))
            rows.append((bool(found.unfit), bool(found.warnings or found.unfit)))
            own = true.payload
            truth = [own.mass, *own.com, *own.inertia, 0, 0, 0, *true.friction.damping, *true.friction.coulomb]
            numbers = list(zip(found.parameters, [*truth, *np.zeros(robot.nv)], strict=True))
            shares += [one.measured for one, _ in numbers]
            if not found.unfit:
                hits += [one.interval[0] <= value <= one.interval[1] for one, value in numbers if one.measured]
        line(fault, [len(rows), *np.sum(rows, axis=0), 100 * np.mean(hits), 100 * np.mean(shares)])


def prediction_error(true, estimate, motions):
    """RMS error of an estimate's torques on motions that it was not identified from, in per cent of the limits."""
    errors = []
    for motion in motions:
        q, v, a = (one[::20] for one in (motion.q, motion.v, np.gradient(motion.v, motion.t, axis=0)))
        known = rigid_torques(true, q, v, a) + true.friction.torque(v)
        errors.append((estimate.torques(q, v, a) - estimate.offset - known) / true.limits.effort_upper)
    return 100 * np.sqrt(np.mean(np.concatenate(errors) ** 2))


def exciting_motions():
    """Condition numbers and errors of identified parameters: ten random motions' best, and the exciting one."""
    print("condition number and error of mass [%] and centre [mm]: best of ten random motions, exciting motion")
    for name in ARMS:
        robot, true = true_arm(name, np.random.default_rng(1))
        row = []
        for generations in (0, 150):
            motion = ad.exciting_motion(robot, 10.0, ad.ExcitingOptions(what="payload", generations=generations))
            found = [ad.identify(robot, log_of(true, motion, np.random.default_rng(k)), "payload") for k in range(5)]
            row += [found[0].condition, *np.mean([payload_errors(true, one) for one in found], axis=0) * [100, 1000]]
        line(name, row)
    print("all inertias: condition number and error of torques on three other motions [% of the limits], likewise")
    random = ad.ExcitingOptions(candidates=1, generations=0)
    for name in ARMS:
        robot, true = true_arm(name, np.random.default_rng(1))
        others = [ad.exciting_motion(robot, 10.0, replace(random, seed=99 + k)) for k in range(3)]
        row = []
        for generations in (0, 150):
            motion = ad.exciting_motion(robot, 10.0, ad.ExcitingOptions(generations=generations))
            found = [ad.identify(robot, log_of(true, motion, np.random.default_rng(k))) for k in range(3)]
            row += [found[0].condition, np.mean([prediction_error(true, one, others) for one in found])]
        line(name, row)


def planned(model, ends, plants, reserves):
    """The motion with whose reserve most of the plants settle soonest, and the settled time of the last of them."""
    problem = ad.MinimumTimeProblem(model, q_start=ends[0], q_goal=ends[1])
    curve = ad.reserve_curve(problem, plants=plants, reserves=reserves, duration=1.0)
    return curve.solutions[curve.best.reserve].trajectory, curve.best


def plans(name, seeds):
    """Settled times of motions planned for the range of arms, for the identified one, and for the truth."""
    print(f"{name}: settled time [s] planned for the range, identified, knowing the truth; their reserves; of 200 "
          "other likely arms with the second motion: unsettled, last one's settled time [s]")  # fmt: skip
    rows = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        robot, true = true_arm(name, rng)
        motion = ad.exciting_motion(robot, 10.0, ad.ExcitingOptions(what="payload", seed=seed))
        estimate = ad.identify(robot, log_of(true, motion, rng), "payload")
        dry, ends = 0.02 * robot.limits.effort_upper, POSES[name]
        loads = [robot.with_payload(ad.Payload(mass=mass, com=CENTRE[name])) for mass in np.linspace(*ARMS[name], 3)]
        corners = [load.with_friction(rub / 2, rub) for load in loads for rub in (0 * dry, dry)]
        middle = loads[1].with_friction(dry / 4, dry / 2)
        models = ((middle, corners, WIDE_RESERVES), (estimate.robot, estimate.likely(200), FINE_RESERVES),
                  (true, [true], FINE_RESERVES))  # fmt: skip
        found = [planned(model, ends, plants, reserves) for model, plants, reserves in models]
        own = [
            ad.track(model, one, plant=true).settled_time for (model, *_), (one, _) in zip(models, found, strict=True)
        ]
        reference, duration = found[1][0], 1.0 + found[1][0].duration
        many = ad.monte_carlo(
            estimate.robot, reference, plants=ad.Plants(likely=estimate.likely(200, seed=1)),
            options=ad.MonteCarloOptions(count=200, duration=duration, workers=1),
        )  # fmt: skip
        times = many.settled_times
        rows.append([np.inf if one is None else one for one in own])
        line(f"{seed}", [*rows[-1], *(best.reserve for _, best in found), np.sum(np.isinf(times)), np.max(times)])
    rows = np.array(rows)
    line("median", np.median(rows, axis=0))
    line("range and identified, part of the truth", np.median(rows[:, :2] / rows[:, 2:], axis=0))


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--log", help="npz of t, q, v, tau")
    options.add_argument("--robot", default="panda", help="of the log")
    options.add_argument("--logs", type=int, default=200)
    options.add_argument("--plans", type=int, default=5)
    options.add_argument("--first", type=int, default=0, help="first seed of the logs and plans")
    options.add_argument("--faults", type=int, default=0, help="seeds of logs with faults")
    options.add_argument("--planned", nargs="*", default=list(POSES), help="arms of the plans")
    arguments = options.parse_args()
    if arguments.log:
        measured_log(arguments.log, arguments.robot)
    if arguments.logs:
        simulated_logs(range(arguments.first, arguments.first + arguments.logs))
        exciting_motions()
    if arguments.faults:
        faults(range(arguments.first, arguments.first + arguments.faults))
    for name in arguments.planned if arguments.plans else ():
        plans(name, range(arguments.first, arguments.first + arguments.plans))
