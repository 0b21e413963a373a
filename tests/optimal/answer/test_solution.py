"""What a solution says of itself."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

import armdyn as ad
from problems import solved


def test_its_parts_say_the_same():
    solution = solved("rr")
    assert solution.success and solution.status is ad.Status.SOLVED
    assert solution.duration == solution.trajectory.duration == solution.phases.duration
    assert sum(arc.duration for arc in solution.arcs) == pytest.approx(solution.duration, rel=1e-12)
    assert solution.trajectory.joint_names == solution.problem.robot.joint_names
    assert solution.trajectory.model_hash in ("", solution.problem.robot.model_hash)
    assert list(solution.local_optima) == sorted(solution.local_optima)
    assert solution.iterations > 0 and solution.solve_time > 0
    assert solution.worst_violation is None and solution.clearance is None and solution.via_times == ()


def test_errors_of_the_replay_are_the_certificates():
    solution = solved("rr")
    replay = ad.replay_torques(solution.problem.robot, solution.trajectory)
    missed = solution.problem.beside_goal(replay)
    assert (
        solution.replay_error == solution.certificate.goal_error == pytest.approx(np.abs(missed[:2]).max(), abs=1e-12)
    )
    assert solution.replay_velocity_error == pytest.approx(np.abs(missed[2:]).max(), abs=1e-10)


def test_sensitivities_need_arcs():
    solution = solved("r")
    assert solution.sensitivities() is not None
    assert replace(solution, phases=None).sensitivities() is None


def test_it_does_not_change():
    with pytest.raises(FrozenInstanceError):
        solved("r").duration = 0.0
