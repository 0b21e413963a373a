"""Singular arcs: the torque that time leaves free is a line in every interval."""

import numpy as np

import armdyn as ad
from armdyn.optimal.arcs.arc import Arc, Mode
from armdyn.optimal.arcs.phases import TABLEAU, Phases
from armdyn.optimal.arcs.solving import solve_phases
from armdyn.optimal.proof.pontryagin import pontryagin
from armdyn.optimal.task.task import Task
from problems import both_sides

STRUCTURE = ((0.126, Mode.UPPER), (0.151, Mode.FREE), (0.271, Mode.LOWER), (0.353, Mode.UPPER), (0.145, Mode.LOWER))
"""Of the cart-pole's swing-up with 20 N, durations to a millisecond [s]."""


def guess(robot):
    """What such torques do, the free one falling from 16 to 2 N."""
    ends = np.append(0.0, np.cumsum([duration for duration, _ in STRUCTURE]))
    tau = np.zeros((10, 2))
    tau[:, 0] = [20, 20, -16, -2, -20, -20, 20, 20, -20, -20]
    rest = np.zeros((10, 2))
    return ad.replay_torques(robot, ad.Trajectory(both_sides(ends), rest, rest, tau, robot.joint_names, "guess"))


def test_free_torques_are_lines_within_their_limits():
    robot = ad.Robot.from_library("cart_pole")
    task = Task.of(ad.MinimumTimeProblem(robot, q_start=[0, 0], q_goal=[0, np.pi]))
    arcs = [Arc(duration, (mode, Mode.PASSIVE)) for duration, mode in STRUCTURE]
    phases = solve_phases(task, arcs, guess(robot), 30)
    assert isinstance(phases, Phases)
    assert abs(phases.duration - 1.0452574) < 3e-6  # lines in intervals dealt out evenly leave 1e-6 of it
    hamiltonian, switching, worst = pontryagin(task.problem, phases)
    assert np.max(np.abs(hamiltonian)) < 1e-4  # what is certified
    assert worst < 1e-3  # ten times that, on a mesh that knows nothing of the arc; 5e-4 measured
    inside = np.flatnonzero(phases.arc_of == 1)
    # S stays near zero all along the arc, where elsewhere it has peaks of 0.05.
    assert np.max(np.abs(switching[inside[1:], 0])) < 1e-4 < 0.01 < np.max(np.abs(switching[:, 0]))
    for tau in phases.tau[inside, :, 0]:
        line = np.polynomial.Polynomial.fit(TABLEAU.c, tau, 1)
        np.testing.assert_allclose(tau, line(TABLEAU.c), atol=1e-7)  # IPOPT's 1e-10 of 20 N, and its conditioning
        assert -20.001 <= line(0.0) <= 20.001
    assert not np.any(phases.tau[:, :, 1])
