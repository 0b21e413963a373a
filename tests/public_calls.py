"""Every public call with right and quick arguments, from which wrong ones are made."""

import inspect
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import armdyn as ad
from armdyn.control.loop.references import Ticks
from armdyn.control.stability.linear import Rest
from armdyn.studies.executor import local_executor
from oracles import two_links
from simulated_logs import simulated_log
from toys import squares

Right = dict[str, Any]


class Hostile:
    """Raises at every access."""

    def _refuse(self, *_):
        raise RuntimeError("no")

    __array__ = __len__ = __iter__ = __repr__ = __float__ = __index__ = __fspath__ = __bool__ = __eq__ = _refuse
    __hash__ = object.__hash__


class Unending:
    """A sequence of ten million numbers by its length, and without end where it is read."""

    def __len__(self):
        return 10**7

    def __getitem__(self, index):
        return 1.0


ITSELF: list[Any] = []
ITSELF.append(ITSELF)
NONSENSE = (
    None, "rr", "1.5", "", b"1", 1j, [1, 2j], [[1.0], [1.0, 2.0]], ["1", "2"], [None, 1.0], {}, {"a": 1}, {1.0},
    object(), Hostile(), [Hostile()], np.array(["a", "b"]), np.array([True, False]), np.array([1j, 2]),
    np.array([None, 1]), np.array("2026-01-01", dtype="datetime64"), [True, 1.0], Ellipsis, ad.Robot, ad, np.ma.masked,
    ITSELF, [ITSELF, 1.0], Unending(), [[1.0], Unending()], [1.0] * 300,
    np.ma.array([1.0, 2.0], mask=[True, False]), [np.ma.masked, 1.0], ["\ud800", np.nan],
)  # fmt: skip
"""An object that is no number, no array of numbers, and no other expected type."""

SPEC = ad.ArmSpec.paper("rr")
RR = ad.Robot.from_spec(SPEC, ad.Payload.at_last_com(SPEC, 0.1))
START, GOAL, PATH = [0.0, 0.0], [1.0, -0.5], np.zeros((4, 2))
PROBLEM = ad.MinimumTimeProblem(RR, q_start=START, q_goal=GOAL)
MOTION = ad.ramp(RR, START, GOAL, 0.2)
OPTIONS = ad.MinimumTimeOptions(search="quick", time_limit=1e-3)
LOG = simulated_log(RR, duration=2.0, rate=200.0)
LOOP, PID = ad.Loop(), ad.Pid()
PLANTS, ARMS = ad.Plants(), ad.MonteCarloOptions(count=1, duration=0.1, workers=1)
TUNING = ad.TuneOptions(duration=0.1, members=2, generations=1, time_limit=10.0, workers=1)
LINK = {"length": 0.25, "com": 0.1, "mass": 0.2, "inertia": 1e-3}
BODY = {"mass": 1.0, "com": (0, 0, 0), "inertia": (0, 0, 0), "frame": None, "shapes": (), "name": "tool"}
CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
TRIANGLES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
LIMITS = ("position_lower", "position_upper", "velocity", "effort_lower", "effort_upper")
READING = {"payload": None, "lock": None, "effort_limit": None, "velocity_limit": None, "armature": None}
FRICTION = {"damping": 0.0, "friction": 0.0, "friction_width": 0.05, "arm": None}
POLE = """<mujoco><worldbody><body name="pole"><joint name="hinge" axis="0 1 0" range="-90 90"/>
<geom type="capsule" fromto="0 0 0 0 0 1" size="0.1"/></body></worldbody><actuator><motor joint="hinge"
ctrlrange="-9 9"/></actuator></mujoco>"""
STUDY = """task = "track"
[arms.rr]
q_start = [0.0, 0.0]
q_goal = [0.1, 0.0]
[fixed]
ki = 1.0
kd = 1.0
[vary]
kp = [1.0, 2.0]
[track]
controller = "pid"
"""
PRESET = """name = "mine"
joints = 2
[limits]
velocity = 9.0
[interfaces.position]
rate = 100
necessary = ["velocity"]
"""
AT_REST = {"robot": RR, "q_goal": GOAL, "controller": PID, "loop": LOOP, "plant": None}
PASSED = {"problem": PROBLEM, "motion": MOTION, "passing": np.zeros((0, 2))}


CYCLE = ad.Cycle(RR, start=START, steps=[ad.Move(GOAL), ad.Wait(0.1)])


@cache
def solved_cycle() -> ad.CycleSolution:
    """A small one."""
    return ad.solve_cycle(CYCLE, ad.MinimumTimeOptions(starts=2))


def cycle_file(folder: Path) -> Path:
    """A file with a small cycle."""
    path = folder / "cycle.toml"
    path.write_text('[robot]\nname = "rr"\n[cycle]\nstart = [0, 0]\n[[steps]]\nmove = "there"\nto = [1, 1]\n')
    return path


@cache
def solution() -> ad.Solution:
    """A small one."""
    arm = ad.Robot.from_spec(ad.ArmSpec.paper("r"))
    return ad.solve_minimum_time(
        ad.MinimumTimeProblem(arm, q_start=[0.0], q_goal=[0.5]), ad.MinimumTimeOptions(starts=2)
    )


def defaults(made: Callable[..., object]) -> Right:
    """Default arguments of a call."""
    return {name: one.default for name, one in inspect.signature(made).parameters.items()}


def values() -> dict[Callable[..., object], Right]:
    """The classes that are made by who uses them."""
    return {
        ad.LinkSpec: LINK,
        ad.ArmSpec: {"name": "a", "links": [ad.LinkSpec(**LINK)], "position_limit": 3.0, "velocity_limit": 9.0}
        | {"effort_limit": 3.0},
        ad.Payload: BODY,
        ad.Tool: BODY | {"tip": (0, 0, 0)},
        ad.Cycle: {"robot": RR, "start": START, "steps": [ad.Move(GOAL)], "closed": False, "order": "given"},
        ad.Grasp: {"part": ad.Payload(mass=0.1), "dwell": 0.1, "name": "take"},
        ad.Move: {"to": GOAL, "via": (), "retreat": None, "approach": 0.1, "obstacles": (), "speed": None}
        | {"path_constraints": (), "name": "there"},
        ad.Release: {"part": None, "dwell": 0.1, "name": "let go"},
        ad.Straight: {"length": 0.1, "axis": "z", "frame": None, "deviation": 1e-3, "angle": 0.01},
        ad.Wait: {"seconds": 0.1, "name": "cool"},
        ad.Sphere: {"center": (0, 0, 0), "radius": 1.0, "name": "ball"},
        ad.Cylinder: {"a": (0, 0, 0), "b": (0, 0, 1), "radius": 1.0, "name": "drum"},
        ad.Plane: {"point": (0, 0, 0), "normal": (0, 0, 1), "name": "floor"},
        ad.Capsule: {"a": (0, 0, 0), "b": (0, 0, 1), "radius": 1.0, "name": "post"},
        ad.Box: {"size": (1, 1, 1), "placement": (0, 0, 0), "name": "box"},
        ad.Mesh: {"parts": [CORNERS], "placement": (0, 0, 0), "name": "part"},
        ad.Group: {"members": [ad.Sphere((0, 0, 0), 1.0)], "name": "several"},
        ad.PointCloud: {"points": CORNERS, "size": 0.1, "name": "seen"},
        ad.HeightMap: {"heights": [[0.1, 0.2]], "size": 0.1, "origin": (0, 0, 0), "step": 0.01, "name": "ground"},
        ad.GoalPose: {"frame": "tip", "placement": (0, 0, 0), "free": (), "tolerance": ()},
        ad.JointLimits: {name: [1.0, 1.0] for name in LIMITS},
        ad.FrameSpeedLimit: {"limit": 1.0, "frame": None, "part": 1.0},
        ad.RmsTorque: {"limit": 1.0, "dwell": 0.5},
        ad.TorqueRateLimit: {"limit": 1.0},
        ad.FrameRegion: {"region": ad.GoalPose("tip", (0, 0, 0)), "leg": 0},
        ad.PidGains: {"kp": 1.0, "ki": 1.0, "kd": 1.0},
        ad.Pid: defaults(ad.Pid),
        ad.Lqr: defaults(ad.Lqr),
        ad.ComputedTorque: defaults(ad.ComputedTorque),
        ad.Loop: defaults(ad.Loop),
        ad.Plants: defaults(ad.Plants),
        ad.MonteCarloOptions: defaults(ad.MonteCarloOptions),
        ad.TuneOptions: defaults(ad.TuneOptions),
        ad.Parameter: {"name": "kp", "low": 1.0, "high": 2.0},
        ad.ControllerFamily: {"name": "mine", "parameters": (ad.Parameter("kp", 1.0, 2.0),), "controller": ad.Pid},
        ad.Ramps: {"q_start": START, "q_goal": GOAL, "duration": (0.1, 1.0)},
        ad.GainRegion: {"inertia": 1.0, "stiffness": 1.0, "damping": 0.0},
        ad.Trajectory: {"t": [0.0, 1.0], "q": np.zeros((2, 1)), "v": np.zeros((2, 1)), "tau": np.zeros((2, 1))}
        | {"joint_names": ("a",), "name": "", "model_hash": "", "hold": "linear", "pieces": ()},
        ad.Load: {"mass": 1.0, "com": (0, 0, 0), "inertia": (0, 0, 0), "frame": "", "at_flange": None},
        ad.Piece: {"start": 0.0, "name": "", "model_hash": "", "load": None, "event": ""},
        ad.RobotOptions: defaults(ad.RobotOptions),
        ad.Log: {"t": LOG.t, "q": LOG.q, "tau": LOG.tau, "v": None, "joint_names": ("a", "b"), "name": "log"},
        ad.IdentifyOptions: defaults(ad.IdentifyOptions),
        ad.ExcitingOptions: defaults(ad.ExcitingOptions),
        ad.Resolver: defaults(ad.Resolver) | {"robot": RR},
        ad.Robot: {name: getattr(RR, name) for name in inspect.signature(ad.Robot).parameters},
        ad.Dynamics: {"robot": RR, "payload_frame": None, "free_last_body": False},
        ad.MinimumTimeOptions: defaults(ad.MinimumTimeOptions),
        ad.MinimumTimeProblem: defaults(ad.MinimumTimeProblem) | {"robot": RR, "q_start": START, "q_goal": GOAL},
    }


def functions(folder: Path) -> dict[Callable[..., object], Right]:
    """The functions.

    Args:
        folder: for the files that they write.
    """
    study, problem = folder / "study.toml", folder / "problem.toml"
    study.write_text(STUDY)
    problem.write_text(PROBLEM.to_toml())
    (folder / "arm.urdf").write_text(RR.urdf)
    (folder / "scene.json").write_text('[{"type": "sphere", "center": [9, 0, 0], "radius": 1}]')
    ad.run_study(squares(1), folder / "done.sqlite")
    return {
        ad.characteristic_polynomial: {"matrix": np.eye(2)},
        ad.routh_table: {"polynomial": [1.0, 2.0, 3.0]},
        ad.closed_loop_eigenvalues: {"robot": RR, "q_goal": GOAL, "gains": ad.PidGains(1, 1, 1), "form": "torque"},
        ad.dask_executor: {"address": "node:8786"},
        ad.gain_plane: {"robot": RR, "q_goal": GOAL, "kp": [1.0, 2.0], "kd": [1.0, 2.0], "ki": 1.0, "form": "torque"}
        | {"loop": None},
        ad.exciting_motion: {"robot": RR, "duration": 1.0, "options": ad.ExcitingOptions(candidates=1, generations=0)},
        ad.identify: {"robot": RR, "logs": LOG, "what": "friction", "options": None},
        ad.least_stable_factor: {"robot": RR, "q_goal": GOAL, "gains": ad.PidGains(1, 1, 1), "form": "torque"}
        | {"factors": (0.9, 1.1)},
        ad.likely_plants: {"robot": RR},
        ad.load_scene: {"path": folder / "scene.json", "robot": None, "lock": None, "package_dirs": ()},
        ad.loop_margins: {"loop": ad.sampled_loop(RR, GOAL, ad.Lqr(), LOOP)},
        ad.mujoco_model: {
            "robot": RR,
            "samples": MOTION.resample(100.0),
            "geometry": False,
            "motors": True,
            "feedback": True,
        },
        ad.multiloop_disk: {"loop": ad.sampled_loop(RR, GOAL, ad.Lqr(), LOOP)},
        ad.lower_bound: {"problem": PROBLEM, "stop": None, "policy": None},
        ad.monte_carlo: {"robot": RR, "reference": MOTION, "controller": PID, "plants": PLANTS, "loop": LOOP}
        | {"options": ARMS, "file": None, "progress": None},
        ad.plan_path: {"problem": PROBLEM, "seed": 0},
        ad.load_of: {"robot": RR},
        ad.reversed_motion: {"robot": RR, "motion": MOTION},
        ad.ramp: {"robot": RR, "q_start": START, "q_goal": GOAL, "duration": 1.0},
        ad.read_problem: {"path": problem},
        ad.read_study: {"path": study},
        ad.replay_torques: {"robot": RR, "trajectory": MOTION, "rtol": 1e-6, "stop": None},
        ad.repair_urdf: {"path": folder / "arm.urdf", "package_dirs": ()},
        ad.reserve_curve: {"problem": PROBLEM, "controllers": [PID], "plants": [RR], "reserves": [0.1], "loop": None}
        | {"duration": 0.1, "options": OPTIONS, "progress": None},
        ad.run_study: {
            "study": squares(1),
            "file": folder / "done.sqlite",
            "executor": local_executor,
            "progress": None,
        }
        | {"again": False, "sync": "full"},
        ad.sampled_loop: AT_REST,
        ad.sampled_stability: AT_REST,
        ad.set_point: {"robot": RR, "q_goal": GOAL},
        ad.simulate_pid: {"robot": RR, "q_start": START, "q_goal": GOAL, "v_start": None, "gains": ad.PidGains(9, 9, 9)}
        | {"duration": 0.01, "form": "computed_torque", "saturate": None, "arrival_tolerance": 0.005}
        | {"arrival_rule": "first_crossing", "samples": 2},
        ad.slowest_stable_rate: {
            "robot": RR,
            "q_goal": GOAL,
            "controller": PID,
            "delay": 1,
            "plant": None,
            "loop": None,
        }
        | {"rates": (900.0, 1000.0)},
        ad.solve_cycle: {"cycle": CYCLE, "options": OPTIONS, "progress": None},
        ad.cycle_costs: {"solution": solved_cycle(), "options": OPTIONS, "progress": None},
        ad.read_cycle: {"path": cycle_file(folder)},
        ad.solve_many: {"problems": [PROBLEM], "options": OPTIONS, "progress": None},
        ad.solve_minimum_time: {"problem": PROBLEM, "options": OPTIONS, "progress": None},
        ad.build_mesh: {"problem": PROBLEM, "intervals": 8, "guess": None},
        ad.build_curve: {"problem": PROBLEM, "intervals": 8, "guess": None},
        ad.study_table: {"file": folder / "done.sqlite"},
        ad.time_optimality: {"robot": RR, "trajectory": MOTION, "options": OPTIONS, "reserve": 0.0, "a": 0 * MOTION.v}
        | {"velocity_reserve": 0.0},
        ad.track: {"robot": RR, "reference": MOTION, "controller": PID, "plant": None, "loop": LOOP, "duration": 0.1}
        | {"tolerance": 0.005, "q_start": None},
        ad.trajectory_from_path: {"robot": RR, "t": [0, 1, 2, 3], "q": PATH, "v": None, "a": None, "name": ""},
        ad.tune: {"robot": RR, "reference": MOTION, "family": ad.ControllerFamily.lqr(), "plants": [RR], "held_out": ()}
        | {"loop": LOOP, "options": TUNING, "progress": None},
        ad.urdf_from_spec: {"spec": SPEC, "payload": None},
    }


def methods(folder: Path) -> dict[Callable[..., object], Right]:
    """Methods that take something, of values that are there."""
    arm, pole = folder / "arm.urdf", folder / "pole.xml"
    arm.write_text(two_links())
    pole.write_text(POLE)
    np.save(folder / "seen.npy", CORNERS)
    (folder / "part.obj").write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
        + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in TRIANGLES)
    )
    (folder / "preset.toml").write_text(PRESET)
    preset = ad.ControllerPreset.read(folder / "preset.toml")
    dynamics = ad.Dynamics(RR)
    np.savez(folder / "log.npz", t=LOG.t, q=LOG.q, tau=LOG.tau)
    estimate = ad.identify(RR, LOG, "friction")
    ticks, region, study = (
        Ticks.of(RR, MOTION, 1000.0),
        ad.GainRegion(1.0, 1.0),
        ad.monte_carlo(RR, MOTION, options=ARMS),
    )
    return {
        solution().report: {"path": folder / "report.html"},
        ad.ArmSpec.paper: {"arm": "r"},
        ad.Mesh.from_file: {"path": folder / "part.obj", "placement": (0, 0, 0), "scale": 1.0, "name": None},
        ad.Mesh.from_triangles: {"vertices": CORNERS, "triangles": TRIANGLES, "placement": (0, 0, 0), "name": "part"},
        ad.PointCloud.from_file: {"path": folder / "seen.npy", "size": 0.1, "placement": (0, 0, 0), "name": None},
        CYCLE.name_of: {"step": 1},
        CYCLE.rest: {"stop": CYCLE.stops[1]},
        CYCLE.reordered: {"order": [0]},
        ad.Payload.at_last_com: {"spec": SPEC, "mass": 1.0},
        ad.Robot.from_urdf_string: {"text": two_links(), "package_dirs": (), "source": "it"} | READING | FRICTION,
        ad.Robot.from_urdf: {"path": arm, "package_dirs": ()} | READING | FRICTION,
        ad.Robot.from_library: {"name": "acrobot"} | READING | FRICTION,
        ad.Robot.from_mjcf: {"path": pole, "options": ad.RobotOptions(armature=0.1)} | READING | FRICTION,
        ad.Robot.from_mjcf_string: {"text": POLE, "passive": (), "source": "it"} | READING | FRICTION,
        ad.Robot.from_model: {"model": RR.model, "limits": RR.limits, "name": None} | READING | FRICTION,
        ad.Robot.from_spec: {"spec": SPEC, "options": None} | READING | FRICTION,
        ad.Robot.from_source: {"source": RR.origin, "options": RR.options},
        RR.with_payload: {"payload": None},
        ad.build_mesh(PROBLEM, 2).trajectory: {"x": ad.build_mesh(PROBLEM, 2).guess},
        ad.Resolver(RR).solve: {"q": START, "v": [0.0, 0.0], "goal": GOAL, "deadline": None},
        ad.Resolver(solution().problem.robot).begin_with: {"solution": solution()},
        RR.with_inertias: {"inertias": {"joint1": [1, 0.1, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1]}},
        ad.Log.load: {"path": folder / "log.npz", "robot": RR},
        LOG.in_order: {"robot": RR},
        estimate.likely: {"count": 1, "confidence": 0.9, "seed": 0},
        estimate.torques: {"q": START, "v": START, "a": START},
        estimate.torque_deviation: {"q": START, "v": START, "a": START},
        RR.with_limits: {"effort_limit": 1.0, "velocity_limit": 1.0},
        RR.with_friction: {"damping": 1.0, "friction": 1.0, "width": 1.0},
        RR.marked: {"name": "motion"},
        RR.with_armature: {"armature": None, "rotor_inertia": 1e-4, "gear_ratio": 10.0},
        RR.with_torque_speed: {"torque_speed": {RR.joint_names[0]: [[0.0, 1.0], [1.0, 0.5]]}},
        RR.with_passive: {"joints": [RR.joint_names[0]]},
        RR.frame: {"name": "tip"},
        RR.frame_of: {"payload": RR.payload},
        RR.pose: {"name": "zero"},
        RR.configuration: {"q": START},
        RR.holding_torque: {"q": START},
        ad.FrameSpeedLimit.of_option: {"values": [0.5], "frame": None},
        ad.RmsTorque.of_option: {"values": [0.5], "frame": None},
        ad.TorqueRateLimit.of_option: {"values": [0.5], "frame": None},
        ad.ControllerPreset.named: {"name": "ur5e", "interface": "position"},
        ad.ControllerPreset.read: {"path": folder / "preset.toml"},
        preset.on: {"interface": "position"},
        preset.limit: {"name": "velocity"},
        preset.expect_joints: {"joints": RR.joint_names, "whose": "the robot"},
        preset.check: {"motion": MOTION, "joint_names": RR.joint_names, "present": [0.0, 0.0]},
        ad.ControllerPreset.named("ros2-jtc").fitted: {"limits": RR.limits, "joints": RR.joint_names},
        ad.Trajectory.load: {"path": MOTION.save(folder / "saved.npz")},
        ad.Trajectory.at_rest: {"q": GOAL, "tau": GOAL, "duration": 1.0, "joint_names": ("a", "b"), "name": ""},
        MOTION.__call__: {"time": 0.1},
        MOTION.as_piece: {"name": "", "load": None, "event": ""},
        MOTION.join: {"other": ad.ramp(RR, GOAL, START, 0.2), "tolerance": 1e-5},
        MOTION.slice: {"begin": 0.05, "end": 0.1},
        MOTION.resample: {"rate": 100.0, "least": 1.0},
        MOTION.save: {"path": folder / "motion.npz"},
        MOTION.to_csv: {"path": folder / "motion.csv"},
        MOTION.resample(100.0).to_csv: {"path": folder / "samples.csv"},
        MOTION.resample(100.0).to_mjcf: {"motors": True},
        PROBLEM.to_toml: {"folder": folder},
        PROBLEM.variant: {"reserve": 0.1, "q_start": START},
        PROBLEM.goal_error_of: {"motion": MOTION},
        ad.PidGains(1, 1, 1).per_joint: {"nv": 2},
        PID.law: {"robot": RR, "ticks": ticks, "loop": LOOP},
        ad.Lqr().law: {"robot": RR, "ticks": ticks, "loop": LOOP},
        ad.ComputedTorque().law: {"robot": RR, "ticks": ticks, "loop": LOOP},
        dynamics.aba: {"q": START, "v": START, "tau": START},
        dynamics.rnea: {"q": START, "v": START, "a": START},
        dynamics.nle: {"q": START, "v": START},
        dynamics.crba: {"q": START},
        dynamics.gravity: {"q": START},
        dynamics.kinetic_energy: {"q": START, "v": START},
        dynamics.potential_energy: {"q": START},
        dynamics.placements: {"q": START},
        dynamics.frame_placement: {"q": START, "frame": "tip"},
        ad.Dynamics(RR, "tip").payload_parameters: {"inertia": pin.Inertia.Random()},
        ad.Loop.ideal: {"saturate": True},
        ad.SampledLoop.of: {"rest": Rest.of(RR, GOAL, PID, LOOP), "loop": LOOP},
        ad.GainRegion.of: {"robot": solution().problem.robot, "q_goal": [0.1], "form": "torque"},
        region.polynomial: {"kp": 1.0, "ki": 1.0, "kd": 1.0},
        region.stable: {"kp": 1.0, "ki": 1.0, "kd": 1.0},
        region.least_kd: {"kp": 1.0, "ki": 1.0},
        PLANTS.sample: {"k": 1, "nv": 2},
        PLANTS.arms: {"robot": RR, "count": 1},
        PLANTS.corners: {"robot": RR},
        PLANTS.check: {"robot": RR},
        ad.ControllerFamily.pid: {"robot": RR, "q_goal": GOAL, "form": "torque", "feedforward": True, "gravity": False}
        | {"shared": True},
        ad.Ramps(START, GOAL).reference: {"robot": RR, "values": {"ramp": 0.5}},
        study.envelope: {"parts": (0.5,)},
        study.quantiles: {"parts": (0.5,)},
        study.plant: {"k": 0},
        study.run: {"k": 0},
        study.success: {"within": 1.0},
        study.summary: {"within": 1.0},
    }
