import numpy as np
import pinocchio as pin

import armdyn as ad
from problems import cart, paper_arm


def test_double_integrator_with_a_jump_of_the_force_is_exact(tmp_path):
    half = 1.0
    t = np.array([0.0, np.nextafter(half, 0), half, 2 * half])
    zero = np.zeros((4, 1))
    motion = ad.Trajectory(t, zero, zero, [[1], [1], [-1], [-1]])
    replay = ad.replay_torques(cart(tmp_path), motion)
    # One unit of force for one second, then back: x = 1, v = 0. The polynomial is exact for DOP853.
    np.testing.assert_allclose([replay.q[-1, 0], replay.v[-1, 0]], [1.0, 0.0], atol=1e-14)


def test_energy_is_what_the_torque_puts_in():
    robot = paper_arm("rrr")
    random = np.random.default_rng(0)
    t = np.linspace(0, 0.3, 31)
    rest = np.zeros((31, 3))
    bent = np.tile([0.1, -0.4, 0.8], (31, 1))
    replay = ad.replay_torques(robot, ad.Trajectory(t, bent, rest, random.normal(size=(31, 3))))
    model, data = robot.model, robot.model.createData()

    def energy(k):
        return pin.computeMechanicalEnergy(model, data, replay.q[k], replay.v[k])

    fine = np.linspace(0, 0.3, 30 * 200 + 1)
    sample = replay(fine)
    power = np.sum(sample.tau * sample.v, axis=1)
    # The cubic between samples, 10 ms apart, carries the velocity to about 1e-4 of its 20 rad/s.
    np.testing.assert_allclose(energy(30) - energy(0), np.trapezoid(power, fine), rtol=1e-3)
