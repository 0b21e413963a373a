"""Free torques of a march: how its arcs answer to their courses, against marches beside it."""

import numpy as np

from armdyn.optimal.arcs.arc import Mode
from armdyn.optimal.switching.extremal.change import Change
from armdyn.optimal.switching.extremal.march import March
from armdyn.optimal.switching.extremal.schedule import Schedule
from armdyn.optimal.switching.extremal.torques.course import Course
from armdyn.optimal.switching.settle import setting_of
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.task import Task
from problems import paper_problem

U, L, F = Mode.UPPER, Mode.LOWER, Mode.FREE


def marched():
    """Two torques of RRR free at once, the first while another joint switches."""
    own = setting_of(Task.of(paper_problem("rrr"), MinimumTimeOptions(compile=False)), 0.1)
    changes = (
        Change(1, F, course=Course((0.002, -0.003, 0.001), ((0, (0.004, 0.001)),))),
        Change(0, L),
        Change(2, F, course=Course((-0.001, 0.004))),
        Change(1, U),
        Change(2, U),
    )
    states = 0.1 * np.random.default_rng(3).normal(size=(5, 6))
    return March.of(own, Schedule((U, L, U), changes, np.array([0.02, 0.04, 0.05, 0.07, 0.09]), states, 0.1))


def test_torques_are_their_courses_where_they_are_free():
    march = marched()
    assert [layer.sum(axis=1).max() for layer in march.torques.layers] == [1, 1]
    unit, steps = march.setting.course[1], np.flatnonzero((march.arc == 1) | (march.arc == 2))
    s = (march.times[steps] - 0.02) / 0.05
    x = 2 * s - 1
    smooth = 0.002 - 0.003 * x + 0.001 * (3 * x**2 - 1) / 2
    leap = np.where(march.arc[steps] == 1, 1, -1) * (0.004 + 0.001 * x)
    np.testing.assert_allclose(march.torques.tau[0][steps, 1], unit * (smooth + leap), atol=1e-12)


def test_arcs_answer_to_all_unknowns_as_differences_say():
    march, small = marched(), 1e-6
    by, still = march.arcs[1], np.zeros_like(march.schedule.states)
    room, by_room = march.room
    for z, unknown in enumerate(np.eye(march.schedule.width)):
        there, here = (march.beside(sign * small * unknown, still) for sign in (1, -1))
        ends = (there.end[march.last] - here.end[march.last]) / (2 * small)
        # Differences of numbers that are known to 1e-12 or so, by 2e-6.
        np.testing.assert_allclose(by[:, :, z], ends, rtol=1e-5, atol=1e-5 * max(1.0, np.max(np.abs(ends))))
        rooms = (there.room[0] - here.room[0]) / (2 * small)
        np.testing.assert_allclose(by_room[:, z], rooms, rtol=1e-5, atol=1e-5 * max(1.0, np.max(np.abs(rooms))))
    assert room.size == 4 * int(march.torques.felt.sum())
