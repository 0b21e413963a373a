"""MuJoCo loads the exported file, with the arm's own URDF, and plays it onto the goal."""

import re

import mujoco
import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import TrajectoryError
from problems import paper_problem, solve, solved

BOTH = '<mujoco><include file="arm.xml"/><include file="motion.xml"/></mujoco>'
SUBSTEPS = 4
"""Of RK4 in a tick: at 1 kHz its error is far below that of torques held for a tick."""


def model_of(robot, motion):
    """MuJoCo's model of an arm's URDF, with the motion included."""
    arm = mujoco.MjSpec.from_string(robot.urdf).to_xml()
    return mujoco.MjModel.from_xml_string(BOTH, assets={"arm.xml": arm.encode(), "motion.xml": motion.encode()})


def played(model):
    """The state after every keyframe's torques have been held until the next one's time."""
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for k in range(model.nkey - 1):
        data.ctrl[:] = model.key_ctrl[k]
        model.opt.timestep = (model.key_time[k + 1] - model.key_time[k]) / SUBSTEPS
        for _ in range(SUBSTEPS):
            mujoco.mj_step(model, data)
    return data


@pytest.mark.parametrize(
    ("arm", "coarse"), [("r", 1e-4), ("rr", 5e-4), pytest.param("rrr", 3e-3, marks=pytest.mark.slow)]
)
def test_it_plays_onto_the_goal(arm, coarse):
    """Open loop: the error is that of torques held for a tick, and falls with the tick's square."""
    problem, motion = solved(arm).problem, solved(arm).trajectory
    missed = {}
    for rate in (1000, 4000):
        model = model_of(problem.robot, motion.resample(rate).to_mjcf())
        data = played(model)
        assert data.time == pytest.approx(motion.duration, rel=1e-12)  # a thousand steps added up
        missed[rate] = np.abs(data.qpos - problem.q_goal).max()
    # 1.2e-5, 1.2e-4 and 1.2e-3 rad were measured at 1 kHz, and a sixteenth of the last two at 4 kHz.
    assert missed[1000] < coarse
    assert missed[4000] < coarse / 4


def test_keyframes_are_the_samples_to_the_last_bit():
    samples = solved("rr").trajectory.resample(1000)
    model = model_of(solved("rr").problem.robot, samples.to_mjcf())
    np.testing.assert_array_equal(model.key_time, samples.t)
    np.testing.assert_array_equal(model.key_qpos, samples.q)
    np.testing.assert_array_equal(model.key_qvel, samples.v)
    np.testing.assert_array_equal(model.key_ctrl, samples.tau)


def test_a_speed_limited_motion_with_a_reserve_plays_as_well():
    solution = solve(paper_problem("r", velocity_limit=5, reserve=0.1, velocity_reserve=0.05))
    data = played(model_of(solution.problem.robot, solution.trajectory.resample(4000).to_mjcf()))
    assert np.abs(data.qpos - solution.problem.q_goal).max() < 1e-4  # like R's bang-bang above


@pytest.mark.slow
def test_an_arm_that_people_own():
    robot = ad.Robot.from_library("ur5")
    poses = {"q_start": [0, -1.57, 1.57, -1.57, -1.57, 0], "q_goal": [1, -0.9, 1, -1, -1.2, 0.5]}
    solution = solve(ad.MinimumTimeProblem(robot, **poses))
    # Meshes are not looked for, and armdyn leaves a library's placeholders of friction out.
    bare = re.sub(r"<(visual|collision)\b.*?</\1>|<dynamics\b[^>]*/>", "", robot.urdf, flags=re.S)
    spec = mujoco.MjSpec.from_string(bare)
    spec.compiler.balanceinertia = False
    files = {"arm.xml": spec.to_xml(), "motion.xml": solution.trajectory.resample(1000).to_mjcf()}
    model = mujoco.MjModel.from_xml_string(BOTH, assets={name: text.encode() for name, text in files.items()})
    # 3.7e-4 rad were measured, and a sixteenth of it at 4 kHz.
    assert np.abs(played(model).qpos - poses["q_goal"]).max() < 1e-3


def test_a_model_with_its_own_motors():
    robot, samples = solved("rr").problem.robot, solved("rr").trajectory.resample(1000)
    spec = mujoco.MjSpec.from_string(robot.urdf)
    for joint in robot.joint_names:
        spec.add_actuator(name=f"own_{joint}", target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    assets = {"arm.xml": spec.to_xml().encode(), "motion.xml": samples.to_mjcf(motors=False).encode()}
    model = mujoco.MjModel.from_xml_string(BOTH, assets=assets)
    assert model.nu == 2 and model.nkey == samples.t.size


def test_names_that_xml_must_escape():
    rest = np.zeros((2, 1))
    samples = ad.Samples([0.0, 1.0], rest, rest, rest, rest, ('<a & "b">',), name="<>")
    joint = '<joint name="&lt;a &amp; &quot;b&quot;&gt;"/>'
    arm = f'<mujoco><worldbody><body>{joint}<geom size="1"/></body></worldbody></mujoco>'
    assets = {"arm.xml": arm.encode(), "motion.xml": samples.to_mjcf().encode()}
    model = mujoco.MjModel.from_xml_string(BOTH, assets=assets)
    assert model.actuator(0).name == '<a & "b">'


def test_names_that_xml_cannot_have():
    rest = np.zeros((2, 1))
    with pytest.raises(TrajectoryError, match="characters that XML cannot say"):
        ad.Samples([0.0, 1.0], rest, rest, rest, rest, ("a\0",)).to_mjcf()
    with pytest.raises(TrajectoryError, match="joint_names is empty"):
        ad.Samples([0.0, 1.0], rest, rest, rest, rest).to_mjcf()
