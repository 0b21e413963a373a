"""Derivatives of the minimum time from the multipliers, against differences of solved minimum times."""

import numpy as np
import pytest

from problems import paper_problem, solve, solved

STEP = 1e-4
"""Of central differences of numbers good to 1e-10: 1e-6, and the third derivative's share."""


def slope(duration, at):
    return (duration(at + STEP) - duration(at - STEP)) / (2 * STEP)


def test_one_link_by_differences():
    by = solved("r").sensitivities()
    assert by.payload_mass == pytest.approx(slope(lambda m: solve(paper_problem("r", m)).duration, 0.1006), rel=1e-4)
    for side, derivative in ((0, -by.effort_lower[0]), (1, by.effort_upper[0])):

        def duration(limit, side=side):
            limits = ([-3.0], [limit]) if side else ([-limit], [3.0])
            return solve(paper_problem("r", effort_limit=limits)).duration

        assert derivative == pytest.approx(slope(duration, 3.0), rel=1e-4)
    np.testing.assert_array_equal(by.velocity, [0.0])  # its 1000 rad/s are far away


def test_a_velocity_limit_that_holds_by_differences():
    def held(limit):
        return solve(paper_problem("r", velocity_limit=limit))

    by = held(10.0).sensitivities()
    # Both by meshes, which differ by 1e-7 of the duration.
    assert by.velocity[0] == pytest.approx(slope(lambda v: held(v).duration, 10.0), rel=1e-3)
    assert by.velocity[0] < 0


@pytest.mark.slow
def test_two_links_by_differences():
    solution = solved("rr")
    assert solution.certificate.ok, solution.message
    by = solution.sensitivities()
    assert by.payload_mass == pytest.approx(slope(lambda m: solve(paper_problem("rr", m)).duration, 0.1006), rel=1e-3)
    for i in range(2):

        def duration(limit, i=i):
            limits = np.array([3.0, 3.0])
            limits[i] = limit
            return solve(paper_problem("rr", effort_limit=limits)).duration

        assert by.effort()[i] == pytest.approx(slope(duration, 3.0), rel=1e-3)


@pytest.mark.parametrize("arm", ["r", "rr"])
def test_more_torque_is_never_slower_and_more_payload_never_faster(arm):
    by = solved(arm).sensitivities()
    assert by.payload_mass > 0
    assert np.all(by.effort_upper <= 0) and np.all(by.effort_lower >= 0) and np.all(by.effort() < 0)
