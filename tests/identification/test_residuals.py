"""Tests of the residuals' patterns, on logs without a fault."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.identification import FitOptions, IdentifyOptions, identify
from armdyn.identification.equations import Equations, means_of
from armdyn.identification.fitting import fit
from armdyn.identification.log import Signals
from armdyn.identification.residuals import _Tests
from simulated_logs import simulated_log


def test_turning_about_a_vertical_axis_changes_no_torque():
    robot, every = ad.Robot.from_library("ur5"), 20
    one = Signals.of(simulated_log(robot, duration=2.0).in_order(robot), 0.005)
    equations = Equations.of(robot, "friction", [one], 0.02)
    columns, known = equations.at(one.q, one.v, one.a, every)
    torque = means_of(one.tau, every) - known
    found = fit(equations.unknowns, columns, torque, FitOptions(weights=(1.0,)))
    gradient = _Tests(equations, found, columns, torque, [(one, every)]).gradient
    assert not np.any(gradient[0])  # rounding made 7.9e10 mrad of backlash of it
    assert np.all(np.any(gradient[1:] != 0, axis=(1, 2)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2, 19, 22, 37])  # five of the eleven of 40 that were given a pattern
def test_encoder_steps_of_a_slow_arm_are_no_pattern(seed):
    # At 0.1 rad/s a step of 1e-4 rad is one sample of 1 ms: errors of the accelerations exceed those of the torques.
    prior, rng = ad.Robot.from_library("kinova"), np.random.default_rng(seed)
    coulomb = rng.uniform(0.002, 0.02, prior.nv) * prior.limits.effort_upper
    payload = ad.Payload(mass=1.0, com=(0, 0, 0.05), inertia=(1e-3, 1e-3, 1e-3))
    true = prior.with_payload(payload).with_friction(coulomb / 2, coulomb, 0.02)
    log = simulated_log(true, seed, duration=4.0)
    assert identify(prior, log, "payload", IdentifyOptions(held_out=0)).warnings == ()
