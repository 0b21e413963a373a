"""Programs of many guesses have the numbers that each has alone."""

import numpy as np
import pytest

from armdyn.optimal.mesh.condensed import assemble_condensed
from armdyn.optimal.mesh.direct import assemble_mesh
from armdyn.optimal.mesh.layout import mesh
from armdyn.optimal.mesh.starts import Guesses, splines, via_guesses
from armdyn.optimal.problem.task import Task
from problems import paper_problem


@pytest.mark.parametrize("intervals", [15, 40])
@pytest.mark.parametrize("arm", ["rr", "rrr"])
def test_programs_of_many_guesses_are_those_of_each_to_the_last_bit(arm, intervals):
    task = Task.of(paper_problem(arm))
    guesses = splines(task.problem, via_guesses(task.problem, 0, 12), 0.4)
    several = assemble_condensed(task, guesses, mesh(intervals))
    for k, own in enumerate(several):
        alone = assemble_mesh(task, guesses.motion(k, task.problem.robot.joint_names), intervals)
        for numbers, expected in ((own.x, alone.x), (own.p, alone.p), *zip(own.x_bounds, alone.x_bounds, strict=True)):
            np.testing.assert_array_equal(numbers, expected)


def test_motions_are_sampled_at_equal_parts_and_joined_in_order():
    problem = paper_problem("rr")
    motions = [one.motion(0, ()) for one in (splines(problem, [[np.array(via)]]) for via in ([0.5, 1.0], [2.0, 0.0]))]
    both = Guesses.sampled(motions, 21)
    again = Guesses.joined([both.chosen([0]), both.chosen([1])])
    for k, motion in enumerate(motions):
        at = motion(motion.duration * np.linspace(0, 1, 21))
        np.testing.assert_allclose(both.motion(k, ()).q, at.q, atol=1e-12)
        np.testing.assert_array_equal(again.q[k], both.q[k])
