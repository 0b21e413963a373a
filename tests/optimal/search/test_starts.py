"""Guesses: smooth, from pose to pose, within what the arm can do."""

import numpy as np

from armdyn.optimal.search.starts import detours, spline
from problems import paper_problem


def test_same_seed_same_guesses_and_they_fit_the_problem():
    problem = paper_problem("rr")
    first, second = ([spline(problem, way) for way in detours(problem, seed=1, count=3)] for _ in range(2))
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.q, b.q)
    np.testing.assert_allclose(spline(problem, []).q[[0, -1]], [problem.q_start, problem.q_goal], atol=1e-14)
    assert not np.array_equal(first[1].q, first[2].q)
