"""Numbers of a solution."""

import json
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.answer.solution import minimum_time_summary
from armdyn.optimal.constraints.constraint import ConstraintReport
from armdyn.optimal.verify.rollout import ACCURACY
from problems import solved


def test_the_parts_of_a_solution_agree():
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
    missed, floor = np.abs(solution.problem.goal_error_of(replay)), solution.certificate.growth * ACCURACY
    assert solution.replay_error == solution.certificate.goal_error
    assert solution.replay_velocity_error == solution.certificate.goal_velocity_error
    # No better than this replay, and no worse than two integrators' errors, grown along the motion.
    assert missed[:2].max() <= solution.replay_error <= 2 * missed[:2].max() + floor
    assert missed[2:].max() <= solution.replay_velocity_error <= 2 * missed[2:].max() + floor


def test_sensitivities_need_costates():
    solution = solved("r")
    assert solution.sensitivities() is not None
    assert replace(solution, costates=None).sensitivities() is None


def test_it_does_not_change():
    with pytest.raises(FrozenInstanceError):
        solved("r").duration = 0.0


def test_a_certified_motion_gets_no_advice():
    solution = solved("rr")
    assert solution.usable and solution.certified and solution.certificate.extremal
    assert solution.what_to_do == ()
    assert solution.lower_bound is None and solution.gap is None and not solution.gap_proven


def test_a_motion_with_a_violated_constraint_is_not_usable():
    missed = ConstraintReport("jerk limits", "too jerky", 1.4, ("too jerky",))
    solution = replace(solved("rr"), constraint_reports=(missed,))
    assert solution.certificate.ok and not solution.usable and not solution.certified and not solution.gap_proven
    (line,) = solution.what_to_do
    assert "jerk limits" in line


def test_its_summary_says_each_thing_apart():
    solution = replace(solved("rr"), certificate=solved("rr").certificate.bounded(0.2, solved("rr").duration))
    summary = minimum_time_summary(solution)
    assert summary["usable"] is summary["certified"] is summary["extremal"] is summary["gap_proven"] is True
    assert summary["lower_bound"] == 0.2 and summary["gap"] == solution.duration / 0.2 - 1
    assert summary["idle"] == [] and summary["what_to_do"] == []
    assert [one["joint"] for one in summary["decides"]] == [one.joint for one in solution.decides]
    assert summary["certificate"]["adjoint_error"] == solution.certificate.adjoint_error
    assert summary["certificate"]["lands"] and summary["certificate"]["keeps_limits"]
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary


def test_a_motion_that_is_not_usable_has_no_gap():
    solution = solved("rr")
    certificate = solution.certificate.bounded(1e-3, solution.duration)
    assert replace(solution, certificate=certificate).gap is not None
    lost = replace(solution, certificate=replace(certificate, goal_error=1.0))
    assert not lost.usable and lost.gap is None
