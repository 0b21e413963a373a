"""The trajectory of a solution with arcs."""

import numpy as np

from armdyn.optimal.verify.arc import BANG
from problems import solved


def test_a_solution_with_arcs_is_sampled_at_knots_and_jumps():
    phases = solved("rr").phases
    motion = phases.torques
    assert all(mode in BANG for arc in phases.arcs for mode in arc.modes)
    assert motion.t[0] == 0.0 and motion.t[-1] == phases.t[-1]
    at = motion(phases.t)
    # Knots are samples: nothing between them is sampled.
    np.testing.assert_allclose(at.q, phases.q, atol=1e-13)
    np.testing.assert_allclose(at.v, phases.v, atol=1e-11)
    assert set(np.abs(motion.tau).ravel()) == {3.0}
    ends = np.cumsum([arc.duration for arc in phases.arcs])[:-1]
    jumps = motion.t[:-1][np.any(np.diff(motion.tau, axis=0) != 0, axis=1)]
    np.testing.assert_allclose(jumps, ends, atol=1e-12)
