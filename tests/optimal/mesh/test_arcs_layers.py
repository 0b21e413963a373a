"""Meshes for Coulomb friction: half of their intervals where a joint turns around."""

import numpy as np

import armdyn as ad
from armdyn.optimal.mesh.grid import layered
from armdyn.optimal.problem.policy.refinement import ArcsPolicy
from problems import cart, paper_problem

NUMBERS = ArcsPolicy()


def there_and_back(joints=1):
    """v = 1 - 2 t from 0 to 1: it turns at one half."""
    t = np.linspace(0, 1, 41)[:, None] * np.ones(joints)
    return ad.Trajectory(t[:, 0], t - t**2, 1 - 2 * t, 0 * t)


def test_half_of_the_mass_is_where_the_joint_turns():
    friction = cart().with_friction(0.0, 0.3, 0.01).friction
    density = layered(there_and_back(), friction, NUMBERS)
    assert np.isclose(density.mass.sum(), 1.0)
    # Three widths of 0.01 m/s are 0.015 s on either side of the turn; tanh(3) of the change is within three of these.
    inside = np.diff(density.up_to(np.array([0.5 - 0.045, 0.5 + 0.045])))[0]
    assert abs(inside - (0.5 * np.tanh(3.0) + 0.5 * 0.09)) < 1e-3
    parts = density.between(0.0, 1.0, 40)
    # Outside the layer a unit of time has half of the intervals that it had.
    assert np.isclose(parts[0], 2 / 40, rtol=1e-2)


def test_none_where_nothing_turns_or_nothing_rubs():
    assert layered(there_and_back(), cart().with_friction(0.5, 0.0).friction, NUMBERS) is None
    t = np.linspace(0, 1, 11)[:, None]
    steady = ad.Trajectory(t[:, 0], t, 0 * t + 1.0, 0 * t)
    assert layered(steady, cart().with_friction(0.0, 0.3, 0.01).friction, NUMBERS) is None


def test_joints_without_dry_friction_do_not_count():
    robot = paper_problem("rr").robot
    t = np.linspace(0, 1, 41)
    v = np.stack([1 - 2 * t, np.ones_like(t)], axis=1)  # the first turns, the second does not
    motion = ad.Trajectory(t, np.stack([t - t**2, t], axis=1), v, 0 * v)
    assert layered(motion, robot.with_friction(0.0, [0.0, 0.1], 0.01).friction, NUMBERS) is None
    assert layered(motion, robot.with_friction(0.0, [0.1, 0.0], [0.01, 0.1]).friction, NUMBERS) is not None
