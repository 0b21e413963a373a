"""MuJoCo opens the model of every kind of arm, has its dynamics, and plays its motion onto the goal."""

import mujoco
import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from problems import paper_arm, solve, solved

ARMS = {
    "library": lambda: ad.Robot.from_library(
        "panda", payload=ad.Payload(mass=1.2, com=(0, 0, 0.05), inertia=(0.01,) * 3)
    ),
    "rounded inertias": lambda: ad.Robot.from_library("ur3"),
    "endless joints": lambda: ad.Robot.from_library("kinova"),
    "one that slides": lambda: ad.Robot.from_library("cart_pole"),
    "axes aslant": lambda: ad.Robot.from_library("finger_edu"),
    "friction and rotors": lambda: paper_arm("rrr", 0.1).with_friction(0.01).with_armature([1e-3, 2e-3, 3e-3]),
    "an arm inside a robot": lambda: ad.Robot.from_library("talos_left"),
}
BARE = {"endless joints", "an arm inside a robot"}
"""Arms whose meshes take seconds to be cut into convex parts; those of the others have every format."""


@pytest.mark.slow
@pytest.mark.parametrize("arm", ARMS)
def test_it_has_the_arms_dynamics(arm, tmp_path):
    """Inverse dynamics of MuJoCo against Pinocchio's at random states."""
    robot = ARMS[arm]()
    (tmp_path / "arm.xml").write_text(ad.mujoco_model(robot, geometry=arm not in BARE))
    model = mujoco.MjSpec.from_file(str(tmp_path / "arm.xml")).compile()
    data, dynamics, random = mujoco.MjData(model), ad.Dynamics(robot), np.random.default_rng(0)
    lower, upper = np.clip(robot.limits.position_lower, -1, 1), np.clip(robot.limits.position_upper, -1, 1)
    damping, _ = robot.friction.per_joint(robot.nv)
    for _ in range(5):
        q, (v, a) = random.uniform(lower + 1e-3, upper - 1e-3), random.uniform(-1, 1, (2, robot.nv))
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(data.qfrc_inverse, dynamics.rnea(q, v, a), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(model.dof_damping, damping)
    names = [model.joint(i).name for i in range(model.njnt)]
    assert names == list(robot.joint_names) and model.nq == model.nv == robot.nv
    for i in np.flatnonzero(np.isfinite(robot.limits.position_lower)):
        ends = robot.limits.position_lower[i], robot.limits.position_upper[i]
        np.testing.assert_array_equal(model.jnt_range[i], ends)


def played(model, substeps=4):
    """Positions after every keyframe's torques have been held until the next one's time."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for k in range(model.nkey - 1):
        data.ctrl[:] = model.key_ctrl[k]
        model.opt.timestep = (model.key_time[k + 1] - model.key_time[k]) / substeps
        mujoco.mj_step(model, data, substeps)
    return data.qpos


@pytest.mark.slow
def test_a_library_arm_plays_its_motion():
    """A Panda with a load: fingers, their damping and mesh paths are gone, and it ends on the goal, open loop, too."""
    robot = ad.Robot.from_library("panda", payload=ad.Payload(mass=1.0))
    solution = solve(
        ad.MinimumTimeProblem(robot, q_start="ready", q_goal=[1, 0.2, 0.5, -1.5, 0.3, 2, -0.5]),
        search="quick",
    )
    samples, goal = solution.trajectory.resample(1000), solution.trajectory.q[-1]
    model = mujoco.MjSpec.from_string(ad.mujoco_model(robot, samples, feedback=False)).compile()
    assert model.nv == model.nu == 7 and model.ngeom > 7 and not np.any(model.geom_contype)
    # 7.9e-4 rad were measured at 1 kHz, and 7e-5 at 4 kHz: torques are held for a tick.
    assert np.abs(played(model) - goal).max() < 1e-3
    held = mujoco.MjSpec.from_string(ad.mujoco_model(robot, samples, geometry=False)).compile()
    assert held.nu == 21 and np.abs(played(held) - goal).max() < 3e-4


def test_feedback_holds_an_unstable_motion():
    """An inverted pendulum that stands still: open loop it falls, held by its servos it stands."""
    robot, upright = paper_arm("r", 0.5), np.array([np.pi / 2 + 1e-4])
    rest = ad.Trajectory.at_rest(upright, [0.0], 3.0, robot.joint_names, model_hash=robot.model_hash)
    ends = {}
    for feedback in (False, True):
        text = ad.mujoco_model(robot, rest.resample(100), geometry=False, feedback=feedback)
        ends[feedback] = abs(float(played(mujoco.MjSpec.from_string(text).compile())[0] - upright[0]))
    assert ends[False] > 1.0 and ends[True] < 1e-4


@pytest.mark.slow
def test_servos_take_nothing_from_torques_on_their_limits():
    """The paper's RRR arm, all of whose torques are: 8e-3 rad were measured with targets held in a step, 8e-5 now."""
    robot, motion = solved("rrr").problem.robot, solved("rrr").trajectory
    model = mujoco.MjSpec.from_string(ad.mujoco_model(robot, motion.resample(4000), geometry=False)).compile()
    assert np.abs(played(model) - motion.q[-1]).max() < 2e-4


def test_servos_do_not_give_more_than_the_motors():
    """From a state far off the motion: all actuators of a joint together keep its torque limit."""
    robot, samples = solved("rr").problem.robot, solved("rr").trajectory.resample(1000)
    model = mujoco.MjSpec.from_string(ad.mujoco_model(robot, samples, geometry=False)).compile()
    data = mujoco.MjData(model)
    data.qpos[:], data.ctrl[:] = samples.q[0] + 3.0, model.key_ctrl[0]
    mujoco.mj_forward(model, data)
    assert np.abs(data.qfrc_actuator).max() == pytest.approx(3.0, rel=1e-12)


def test_friction_is_played_too():
    """Without it in MuJoCo's model the arm ends 0.09 rad off."""
    robot = paper_arm("r", 0.1).with_friction(0.02)
    solution = solve(ad.MinimumTimeProblem(robot, q_start=[-1.5], q_goal=[0.2]), compile=False)
    model = mujoco.MjSpec.from_string(
        ad.mujoco_model(robot, solution.trajectory.resample(4000), geometry=False)
    ).compile()
    assert np.abs(played(model) - solution.trajectory.q[-1]).max() < 1e-3


def test_geometry_motors_and_keyframes_are_options():
    robot, samples = solved("rr").problem.robot, solved("rr").trajectory.resample(1000)
    bare = mujoco.MjSpec.from_string(ad.mujoco_model(robot, samples, geometry=False, motors=False)).compile()
    assert (bare.ngeom, bare.nu, bare.nkey) == (0, 0, samples.t.size)
    np.testing.assert_array_equal(bare.key_qpos, samples.q)
    whole = mujoco.MjSpec.from_string(ad.mujoco_model(robot)).compile()
    assert (whole.nu, whole.nkey) == (2, 0) and whole.ngeom
    np.testing.assert_array_equal(whole.actuator_ctrlrange, [[-3, 3], [-3, 3]])
    assert whole.site(0).name == robot.tip
    with pytest.raises(ProblemError, match="the motion has 2 joints; rrr has 3"):
        ad.mujoco_model(paper_arm("rrr"), samples)


def test_an_arm_without_geometry_is_reported():
    robot = ad.Robot.from_model(paper_arm("rr").model)
    with pytest.raises(ProblemError, match="no geometry"):
        ad.mujoco_model(robot)
    assert mujoco.MjSpec.from_string(ad.mujoco_model(robot, geometry=False)).compile().nv == 2


def test_names_of_strangers():
    text = paper_arm("rr").urdf.replace('"joint1"', '"&lt;a/&gt;&quot;&amp;"')
    robot = ad.Robot.from_urdf_string(text)
    model = mujoco.MjSpec.from_string(ad.mujoco_model(robot)).compile()
    assert model.joint(0).name == '<a/>"&' == model.actuator(0).name
