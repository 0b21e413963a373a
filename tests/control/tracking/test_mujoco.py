"""The same URDF in MuJoCo, under the very same controller: another engine, another integrator."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

import armdyn as ad
from armdyn.control.loop.references import Ticks
from armdyn.models import urdf_from_spec
from problems import POSES

UR5 = ([0, -1.57, 1.57, -1.57, -1.57, 0], [1, -0.9, 1, -1, -1.2, 0.5])
SUBSTEPS = 10
"""Of MuJoCo's Runge-Kutta per tick: with twice as many the motions below move by less than 1e-7 rad."""


def arms():
    for arm in ("r", "rr", "rrr"):
        spec = ad.ArmSpec.paper(arm)
        robot = ad.Robot.from_spec(spec)
        yield pytest.param(robot, urdf_from_spec(spec), *POSES[arm], 0.4, id=arm)
    robot = ad.Robot.from_library("ur5")
    yield pytest.param(robot, Path(robot.source).read_text(), *UR5, 1.2, id="ur5")


@pytest.mark.parametrize(("robot", "urdf", "start", "goal", "duration"), list(arms()))
def test_mujoco_agrees(robot, urdf, start, goal, duration):
    loop, controller = ad.Loop(encoder=0.0, velocity="exact"), ad.ComputedTorque(40.0)
    reference = ad.ramp(robot, start, goal, duration)
    plant = engine(urdf, robot, loop.period)
    run = ad.track(robot, reference, controller, loop=loop, duration=duration + 0.2)
    ticks = Ticks.of(robot, reference, loop.rate)
    law = controller.law(robot, ticks, loop)
    theirs = played(plant, robot, law, ticks, loop, run.trajectory.t.size - 1)
    apart = np.abs(theirs - run.trajectory.q).max()
    assert apart < 1e-3
    assert apart > 0  # it is another engine


def engine(urdf, robot, period):
    """Bodies, joints and gravity alone: the file's meshes, damping and friction are left out."""
    bare = re.sub(r"<(visual|collision)\b.*?</\1>", "", urdf, flags=re.S)
    bare = re.sub(r"<dynamics\b[^>]*/>", "", bare)
    spec = mujoco.MjSpec.from_string(bare)
    spec.compiler.balanceinertia = False
    model = spec.compile()
    model.opt.timestep = period / SUBSTEPS
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.gravity = robot.model.gravity.linear
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT  # neither contacts nor ends of joints
    model.dof_damping[:] = 0
    model.dof_armature[:] = robot.model.armature
    assert model.nv == robot.nv
    return model


def played(model, robot, law, ticks, loop, count):
    """The sampled loop around MuJoCo, in plain Python."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = ticks.q[0], ticks.v[0]
    lower, upper = robot.limits.effort_lower, robot.limits.effort_upper
    integral, pending, out = np.zeros(robot.nv), [np.clip(ticks.tau[0], lower, upper)], [data.qpos.copy()]
    for k in range(count):
        row = law.rows[min(k, len(law.rows) - 1)]
        wanted = np.array(law.function(data.qpos, data.qvel, integral, np.concatenate(pending), row)).ravel()
        clipped = np.clip(wanted, lower, upper)
        error = ticks.q[min(k, len(ticks.q) - 1)] - data.qpos
        if k * loop.period >= law.integrate_from - 1e-12:
            integral = integral + np.where((wanted - clipped) * error > 0, 0.0, error) * loop.period
        pending.append(clipped)
        data.qfrc_applied[:] = pending.pop(0)
        for _ in range(SUBSTEPS):
            mujoco.mj_step(model, data)
        out.append(data.qpos.copy())
    return np.array(out)
