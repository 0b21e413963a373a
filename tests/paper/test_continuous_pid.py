"""The paper's PID loop with other equations of motion, and with the printed sign of k_D."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.control.tracking.arrival import Arrival
from armdyn.paper.closed_form import PlanarArm
from armdyn.paper.continuous_pid import ContinuousLoop, simulate
from armdyn.paper.printed.equations import PrintedArm
from pid_loops import example

FIRST = Arrival("last_entry_first_joint")


def test_given_equations_of_motion():
    robot, poses = example("RRR Ex6", grams=100.6)
    arm = PlanarArm.from_spec(ad.ArmSpec.paper("rrr"), ad.Payload(mass=0.1006))
    loops = [ContinuousLoop(robot, poses["q_goal"], dynamics=d) for d in (None, arm)]
    own, given = (simulate(loop, poses["q_start"], Arrival(), duration=1.0) for loop in loops)
    # Equal mechanics: differences are rounding, and the integrator's steps: 2e-10 measured.
    np.testing.assert_allclose(given.trajectory.q, own.trajectory.q, atol=1e-8)
    np.testing.assert_allclose(given.trajectory.tau, own.trajectory.tau, atol=1e-8)
    # The stencil's rounding, times the condition of D.
    assert given.max_real_eigenvalue == pytest.approx(own.max_real_eigenvalue, abs=5e-7)


def test_equation_7_as_printed_settles():
    robot, poses = example("RRR Ex6")
    printed = PrintedArm.from_spec(ad.ArmSpec.paper("rrr"), 0.1006)
    run = simulate(ContinuousLoop(robot, poses["q_goal"], dynamics=printed), poses["q_start"], FIRST)
    assert run.settled
    assert run.arrival_time == pytest.approx(8.2955, abs=2e-3)  # the reference was read off a grid of 5e-4 s


@pytest.mark.parametrize(("grams", "expected"), [(0, -1.393593196865138), (100.6, -1.3583095355056778)])
def test_equation_7_as_printed_is_stable(grams, expected):
    robot, poses = example("RRR Ex6")
    arm = PrintedArm.from_spec(ad.ArmSpec.paper("rrr"), grams / 1000)
    assert ContinuousLoop(robot, poses["q_goal"], dynamics=arm).growth() == pytest.approx(expected, abs=1e-6)


def wrong_sign(name, rule="last_entry_all_joints"):
    """Eqs (28) to (30) as printed, + k_D θ̇."""
    robot, poses = example(name, grams=100.6)
    return simulate(ContinuousLoop(robot, poses["q_goal"], error_rate=1.0), poses["q_start"], Arrival(rule))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["R Ex4", "RR Ex5", "RRR Ex6"])
def test_a_derivative_of_the_wrong_sign_diverges(name):
    run = wrong_sign(name)
    assert run.status == "diverged"
    assert run.message.startswith("diverged at t = ")
    assert run.arrival_time is None
    assert run.max_real_eigenvalue > 5
    assert 0 < run.trajectory.duration < 10  # up to there, and all of it finite: Trajectory checks


def test_passing_the_goal_of_an_unstable_loop_is_no_arrival():
    crossing = wrong_sign("R Ex4", "first_crossing")
    assert crossing.arrival_time is not None
    assert crossing.settled_time is None
    assert wrong_sign("R Ex4").arrival_time is None
