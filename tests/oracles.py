"""Independent answers to compare with: Pinocchio's numbers, and URDFs written by hand."""

from functools import cache

import numpy as np
import pinocchio as pin

from armdyn.models import PLANAR_ARMS, ArmSpec, Robot
from armdyn.models.reading.urdf_arm import configurations

LIBRARY_ROBOTS = ("panda", "ur5", "talos_arm", "double_pendulum", "z1", "kinova")


@cache
def robot_named(name):
    """A paper arm or a library robot."""
    return Robot.from_spec(ArmSpec.paper(name)) if name in PLANAR_ARMS else Robot.from_library(name)


def random_states(nv, count=5, seed=0):
    """Tuples (q [rad], v [rad/s], u) of shape (nv,) each; u serves as acceleration or torque."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield rng.uniform(-np.pi, np.pi, nv), rng.uniform(-3, 3, nv), rng.uniform(-5, 5, nv)


class PinDynamics:
    """The same methods as `armdyn.Dynamics`, from the compiled pin package's doubles."""

    def __init__(self, robot):
        self.model, self.data = robot.model, robot.model.createData()
        self.configuration = configurations(robot.model)

    def aba(self, q, v, tau):
        return pin.aba(self.model, self.data, self.configuration(q), v, tau).copy()

    def rnea(self, q, v, a):
        return pin.rnea(self.model, self.data, self.configuration(q), v, a).copy()

    def crba(self, q):
        upper = np.triu(pin.crba(self.model, self.data, self.configuration(q)))
        return upper + np.triu(upper, 1).T

    def nle(self, q, v):
        return pin.nonLinearEffects(self.model, self.data, self.configuration(q), v).copy()

    def gravity(self, q):
        return pin.computeGeneralizedGravity(self.model, self.data, self.configuration(q)).copy()

    def kinetic_energy(self, q, v):
        """½ vᵀ D v without the armature, from the links' spatial velocities."""
        pin.forwardKinematics(self.model, self.data, self.configuration(q), v)
        inertias, velocities = list(self.model.inertias)[1:], list(self.data.v)[1:]
        return sum(I.vtiv(nu) / 2 for I, nu in zip(inertias, velocities, strict=True))  # noqa: E741

    def potential_energy(self, q):
        return pin.computePotentialEnergy(self.model, self.data, self.configuration(q))

    def frame_placement(self, q, frame):
        pin.framesForwardKinematics(self.model, self.data, self.configuration(q))
        names = [f.name for f in self.model.frames if f.type == pin.FrameType.BODY]
        assert frame in names
        place = self.data.oMf[self.model.getFrameId(frame, pin.FrameType.BODY)]
        return place.rotation.copy(), place.translation.copy()


def assert_close(got, expected, tolerance):
    """Absolute below one, relative above: |got - expected| <= tolerance max(1, |expected|)."""
    got, expected = np.asarray(got, dtype=float), np.asarray(expected, dtype=float)
    assert got.shape == expected.shape
    assert np.max(np.abs(got - expected)) <= tolerance * max(1.0, np.max(np.abs(expected)))


INERTIAL = (
    '<inertial><origin xyz="0.1 0 0"/><mass value="1.0"/>'
    '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>'
)
LIMIT = '<limit lower="-1" upper="1" effort="2" velocity="3"/>'


def link(name, inertial=INERTIAL):
    return f'<link name="{name}">{inertial}</link>'


def joint(name, parent, child, kind="revolute", inside=f'<axis xyz="0 -1 0"/>{LIMIT}'):
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def urdf(*parts):
    return f'<?xml version="1.0"?><robot name="test">{"".join(parts)}</robot>'


def two_links(**changes):
    """A good URDF of a base and one link; `changes` replace its `joint` or its `link`."""
    good = {"link": link("arm"), "joint": joint("shoulder", "base", "arm")} | changes
    return urdf('<link name="base"/>', *good.values())
