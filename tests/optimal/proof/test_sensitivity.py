import numpy as np
import pytest

from problems import paper_problem, solve, solved


def test_sensitivities_against_finite_differences():
    solution = solved("rr")
    assert solution.certificate.ok, solution.message
    by = solution.sensitivities()

    def duration(mass=0.1006, effort_limit=3.0):
        return solve(paper_problem("rr", mass, effort_limit=effort_limit)).duration

    step = 1e-4  # central differences of numbers good to 1e-10: 1e-6, and the third derivative's share
    slope = (duration(mass=0.1006 + step) - duration(mass=0.1006 - step)) / (2 * step)
    assert by.payload_mass == pytest.approx(slope, rel=1e-3)
    for i in range(2):
        up, down = np.array([3.0, 3.0]), np.array([3.0, 3.0])
        up[i], down[i] = 3 + step, 3 - step
        slope = (duration(effort_limit=up) - duration(effort_limit=down)) / (2 * step)
        assert by.effort()[i] == pytest.approx(slope, rel=1e-3)
