"""Programs of many guesses have the numbers that each has alone."""

import numpy as np
import pytest

from armdyn.optimal.mesh.condensed import condensed_starts
from armdyn.optimal.mesh.layout import CondensedLayout, Layout
from armdyn.optimal.mesh.starts import Guesses, splines, via_guesses
from armdyn.optimal.mesh.unknowns import Scales, bounds, mesh, to_unknowns
from armdyn.optimal.problem.task import Task
from problems import paper_problem


@pytest.mark.parametrize("intervals", [15, 40])
@pytest.mark.parametrize("arm", ["rr", "rrr"])
def test_programs_of_many_guesses_are_those_of_each_to_the_last_bit(arm, intervals):
    problem = paper_problem(arm)
    layout = CondensedLayout(Layout(problem.robot.nv, Task.of(problem).scheme))
    guesses = splines(problem, via_guesses(problem, 0, 12), 0.4)
    starts = condensed_starts(problem, layout, guesses, intervals)
    fractions, kept = np.diff(mesh(intervals)), layout.kept(intervals)
    for k in range(12):
        guess = guesses.motion(k, problem.robot.joint_names)
        scales = Scales.of(problem, guess)
        lower, upper = bounds(problem, layout.full, intervals, scales)
        x = np.clip(to_unknowns(guess, layout.full, fractions, scales), lower, upper)
        for own, alone in zip(starts, (x, lower, upper), strict=False):
            np.testing.assert_array_equal(own[k], alone[kept])


def test_motions_are_sampled_at_equal_parts_and_joined_in_order():
    problem = paper_problem("rr")
    motions = [one.motion(0, ()) for one in (splines(problem, [[np.array(via)]]) for via in ([0.5, 1.0], [2.0, 0.0]))]
    both = Guesses.sampled(motions, 21)
    again = Guesses.joined([both.chosen([0]), both.chosen([1])])
    for k, motion in enumerate(motions):
        at = motion(motion.duration * np.linspace(0, 1, 21))
        np.testing.assert_allclose(both.motion(k, ()).q, at.q, atol=1e-12)
        np.testing.assert_array_equal(again.q[k], both.q[k])
