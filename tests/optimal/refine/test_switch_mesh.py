from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.refine.switch_mesh import at_switches
from armdyn.optimal.search.starts import spline
from armdyn.optimal.solve.condensed import has_stagewise, solve_quickly
from armdyn.optimal.task.tableau import Scheme
from armdyn.optimal.task.task import Task
from problems import paper_problem


def on_equal_intervals(problem, scheme=None):
    task = Task.of(problem)
    task = replace(task, scheme=scheme or replace(task.scheme, control="constant"))
    return task, solve_quickly(task, spline(problem, []), 40, task.fine())


@pytest.fixture(scope="module")
def located():
    """A solution on equal intervals, and the same refined at its switches."""
    task, attempt = on_equal_intervals(paper_problem("rr", position_limit=(-np.inf, np.inf)))
    if not has_stagewise(task):
        pytest.skip("the stagewise method needs a compiler")
    return task, attempt, at_switches(task, attempt)


def test_switches_are_located_to_a_ten_thousandth_of_the_duration(located):
    task, _, sharp = located
    middle = sharp.trajectory(sharp.trajectory.duration * (sharp.mesh[:-1] + sharp.mesh[1:]) / 2)
    off = np.abs(middle.tau) < (1 - task.policy.arcs.near) * task.problem.limits.effort_upper
    assert np.diff(sharp.mesh) @ np.any(off, axis=1) < 1e-3
    assert np.any(off)  # else nothing was to be located


def test_duration_is_nearer_to_that_of_exact_switching_times(located):
    task, attempt, sharp = located
    exact = ad.solve_minimum_time(task.problem, ad.MinimumTimeOptions(guesses=(sharp.trajectory,), starts=1))
    assert exact.certified
    errors = [abs(each.trajectory.duration / exact.duration - 1) for each in (attempt, sharp)]
    assert errors[1] < 1e-5 < errors[0]


def test_without_the_stagewise_method_a_mesh_stays_as_it_is():
    task, attempt = on_equal_intervals(paper_problem("rr"), Scheme("constant", compile=False))
    assert at_switches(task, attempt) is attempt


@pytest.mark.slow
def test_a_joint_that_starts_near_its_position_limit_is_certified():
    # Equal intervals show a contact from the start on; it begins after a tenth of the duration.
    problem = ad.MinimumTimeProblem(
        ad.Robot.from_spec(ad.ArmSpec.paper("rrr"), ad.Payload(mass=0.16545153616794545)),
        q_start=(-0.5502782980754111, -1.1850936601934012, 3.140660667507336),
        q_goal=(-0.23464747070748926, 0.03015400417049108, 0.5901285518949932),
    )
    found = ad.solve_minimum_time(problem)
    assert found.certified
    assert found.duration == pytest.approx(0.193014352, abs=1e-8)
