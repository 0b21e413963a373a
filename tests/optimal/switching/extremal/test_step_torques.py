"""Free torques of a rollout: derivatives of its arcs by their singular controls, against neighbouring rollouts."""

import numpy as np
import pytest

from armdyn.optimal.arcs.arc import Mode
from armdyn.optimal.switching.extremal.change import Change, SingularControl
from armdyn.optimal.switching.extremal.rollout import Rollout
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.refinement import shooting_problem
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory
from problems import paper_problem

U, L, F = Mode.UPPER, Mode.LOWER, Mode.FREE


def rolled_out():
    """Two torques of RRR free at once, the first while another joint switches."""
    problem = paper_problem("rrr")
    still = Trajectory.at_rest(problem.q_start, np.zeros(3), 0.1)
    own = shooting_problem(Task.of(problem, MinimumTimeOptions(compile=False)), still)
    changes = (
        Change(1, F, control=SingularControl((0.002, -0.003, 0.001), ((0, (0.004, 0.001)),))),
        Change(0, L),
        Change(2, F, control=SingularControl((-0.001, 0.004))),
        Change(1, U),
        Change(2, U),
    )
    states = 0.1 * np.random.default_rng(3).normal(size=(5, 6))
    return Rollout.of(
        own, SwitchingStructure((U, L, U), changes, np.array([0.02, 0.04, 0.05, 0.07, 0.09]), states, 0.1)
    )


def test_torques_are_their_controls_where_they_are_free():
    rollout = rolled_out()
    assert [layer.sum(axis=1).max() for layer in rollout.torques.layers] == [1, 1]
    unit, steps = rollout.shooting.torque_unit[1], np.flatnonzero((rollout.arc == 1) | (rollout.arc == 2))
    s = (rollout.times[steps] - 0.02) / 0.05
    x = 2 * s - 1
    smooth = 0.002 - 0.003 * x + 0.001 * (3 * x**2 - 1) / 2
    leap = np.where(rollout.arc[steps] == 1, 1, -1) * (0.004 + 0.001 * x)
    np.testing.assert_allclose(rollout.torques.tau[0][steps, 1], unit * (smooth + leap), atol=1e-12)


@pytest.mark.slow
def test_arcs_answer_to_all_unknowns_as_differences_say():
    rollout, small = rolled_out(), 1e-6
    by, still = rollout.arcs[1], np.zeros_like(rollout.structure.states)
    slack, by_room = rollout.slack
    for z, unknown in enumerate(np.eye(rollout.structure.width)):
        there, here = (rollout.perturbed(sign * small * unknown, still) for sign in (1, -1))
        ends = (there.end[rollout.last] - here.end[rollout.last]) / (2 * small)
        # Differences of numbers that are known to 1e-12 or so, by 2e-6.
        np.testing.assert_allclose(by[:, :, z], ends, rtol=1e-5, atol=1e-5 * max(1.0, np.max(np.abs(ends))))
        rooms = (there.slack[0] - here.slack[0]) / (2 * small)
        np.testing.assert_allclose(by_room[:, z], rooms, rtol=1e-5, atol=1e-5 * max(1.0, np.max(np.abs(rooms))))
    assert slack.size == 4 * int(rollout.torques.free_mask.sum())
