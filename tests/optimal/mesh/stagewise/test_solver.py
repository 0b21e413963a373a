"""Our own method against IPOPT, and how it ends where there is nothing to be found."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.mesh.condensed import assemble_condensed, guess_jobs, solve_on_knots, solve_quickly
from armdyn.optimal.mesh.direct import solve_on_mesh
from armdyn.optimal.mesh.ipopt import Ipopt, NlpData
from armdyn.optimal.mesh.layout import mesh
from armdyn.optimal.mesh.stagewise.solver import Stagewise
from armdyn.optimal.mesh.starts import Guesses, spline, splines, via_guesses
from armdyn.optimal.problem.options import Acceptable, Scheme, SolverSettings
from armdyn.optimal.problem.status import Stop
from armdyn.optimal.problem.task import Task
from optimal.mesh.condensed_program import condensed_program
from problems import paper_problem

pytestmark = pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler")

N = 20
CONSTANT = Scheme("constant", compile=True)
TIGHT = SolverSettings(1e-9, 500, barrier=1e-2)


def solver(task, settings=TIGHT):
    return Stagewise.of(task.dynamics, CONSTANT, N, settings)


def data(start, p, sides):
    """Of the program, whose equations are all zero."""
    equal = np.zeros(0)
    return NlpData(start, p, sides, (equal, equal))


def program(task):
    """Start, parameters and bounds of the straight guess's program."""
    (data,) = assemble_condensed(replace(task, scheme=CONSTANT), Guesses.of(spline(task.problem, [])), mesh(N))
    kept = data.layout.condensed(N)
    lower, upper = data.x_bounds
    return data.x[kept], data.p, (lower[kept], upper[kept])


@pytest.mark.parametrize("arm", ["r", "rr", "rrr"])
def test_ipopts_iterations_to_ipopts_optimum(arm):
    task = Task.of(paper_problem(arm, effort_weight=0.001))
    start, p, sides = program(task)
    equal = np.zeros(2 * task.problem.robot.nv * N)
    numbers = NlpData(start, p, sides, (equal, equal))
    own = solver(task).solve(numbers, Stop())
    other = Ipopt(condensed_program(task.dynamics, N), TIGHT).solve(numbers, Stop())
    assert own.status is other.status is ad.Status.SOLVED and own.message == other.message == "Solve Succeeded"
    assert own.iterations == other.iterations
    # Newton's steps are the same but for rounding.
    assert own.x[-1] == pytest.approx(other.x[-1], rel=1e-10)
    np.testing.assert_allclose(own.x, other.x, atol=1e-7)


@pytest.mark.parametrize("kind", [{"velocity_limit": 12.0}, {"position_limit": ((-1.7, -2.0), (1.7, 2.0))}])
def test_limits_in_the_middle_of_intervals_as_with_all_unknowns(kind):
    problem = paper_problem("rr", **kind)
    task = replace(Task.of(problem), scheme=CONSTANT)
    full = solve_on_mesh(task, spline(problem, []), N, TIGHT)
    again = solve_on_knots(task, full.trajectory, mesh(N), TIGHT)
    assert full.status is again.status is ad.Status.SOLVED
    assert again.trajectory.duration == pytest.approx(full.trajectory.duration, rel=1e-7)  # both to 1e-9, scaled
    np.testing.assert_allclose(again.trajectory.q, full.trajectory.q, atol=2e-5)  # by the square root, in the optimum
    beyond = (
        np.abs(again.trajectory.v) / problem.limits.velocity,
        np.abs(again.trajectory.q) / np.maximum(problem.limits.position_upper, -problem.limits.position_lower),
    )
    assert 1 - 1e-3 < max(np.max(part) for part in beyond) <= 1 + 1e-7  # reached, and loosened by 1e-8


def test_multipliers_are_those_of_the_solution():
    task = Task.of(paper_problem("rr"))
    start, p, sides = program(task)
    own = solver(task)
    found = own.solve(data(start, p, sides), Stop())
    np.testing.assert_allclose(own.values(found.x, p)[0], 0, atol=TIGHT.tolerance)
    # Along T the Lagrangian, T + λ'c, is flat; its slope by differences, whose error is 1e-6² and rounding over 1e-6.
    step = np.zeros(found.x.size)
    step[-1] = 1e-6
    rise = own.values(found.x + step, p)[0] - own.values(found.x - step, p)[0]
    assert 1 + found.lam_g @ rise / 2e-6 + found.lam_x[-1] == pytest.approx(0, abs=1e-6)
    held = (found.x > sides[1] - 1e-6) & (sides[0] < sides[1])  # torques at their upper limit
    assert held.any() and np.all(found.lam_x[held] > 0)


def test_every_guess_of_a_search_converges_back_from_where_the_filter_stops():
    task = replace(Task.of(paper_problem("rrr")), scheme=CONSTANT)
    guesses = splines(task.problem, via_guesses(task.problem, 0, 24))
    jobs = guess_jobs(task, guesses, [(15, task.coarse()[k % 2]) for k in range(24)])
    assert all(job(task).usable for job in jobs)


def test_an_infeasible_program_is_called_infeasible():
    task = Task.of(paper_problem("rr"))
    start, p, (lower, upper) = program(task)
    upper[-1] = 0.5 * solver(task).solve(data(start, p, (lower, upper)), Stop()).x[-1]  # half of the least duration
    found = solver(task).solve(data(start, p, (lower, upper)), Stop())
    assert found.status is ad.Status.INFEASIBLE and found.message == "Restoration Failed"


def test_a_joint_that_is_held_back_entirely():
    task = Task.of(paper_problem("rr"))
    start, p, (lower, upper) = program(task)
    torques = solver(task).joints * 2 + np.arange(N) * 6 + 1  # the second joint's
    lower[torques] = upper[torques] = 0.0
    found = solver(task).solve(data(start, p, (lower, upper)), Stop())
    assert found.status is ad.Status.SOLVED
    np.testing.assert_array_equal(found.x[torques], 0)
    np.testing.assert_allclose(solver(task).values(found.x, p)[0], 0, atol=TIGHT.tolerance)


def test_no_numbers():
    task = Task.of(paper_problem("rr"))
    start, p, sides = program(task)
    found = solver(task).solve(data(start, p * np.nan, sides), Stop())
    assert found.status is ad.Status.FAILED and found.message == "Invalid Number Detected"
    np.testing.assert_array_equal(np.isfinite(found.x), True)


class Impatient(Stop):
    """At the third poll it returns True, or raises its error."""

    def __init__(self, failure=None):
        super().__init__()
        self.calls, self.failure = 0, failure

    def __bool__(self):
        self.calls += 1
        if self.calls == 3 and self.failure:
            raise self.failure
        return self.calls == 3


def test_stop_is_polled_every_few_iterations():
    task = Task.of(paper_problem("rr"))
    start, p, sides = program(task)
    found = solver(task).solve(data(start, p, sides), Impatient())
    assert found.status is ad.Status.TIME_LIMIT and found.message == "time limit reached"
    assert found.iterations == 20
    stop = Stop(interrupted=True)
    assert solver(task).solve(data(start, p, sides), stop).status is ad.Status.INTERRUPTED
    with pytest.raises(KeyboardInterrupt):
        solver(task).solve(data(start, p, sides), Impatient(KeyboardInterrupt()))


def test_iteration_limit(capfd):
    task = Task.of(paper_problem("rr"))
    start, p, sides = program(task)
    found = solver(task, replace(TIGHT, max_iterations=3)).solve(data(start, p, sides), Stop())
    assert found.status is ad.Status.ITERATION_LIMIT and found.iterations == 3
    assert not "".join(capfd.readouterr())


def test_problems_that_it_is_not_for():
    dynamics = Task.of(paper_problem("rr")).dynamics
    for other in ({"control": "linear"}, {"compile": False}):
        assert Stagewise.of(dynamics, replace(CONSTANT, **other), N, TIGHT) is None


def test_where_iterations_end_the_best_iterate_will_do_if_it_is_close():
    task = Task.of(paper_problem("rr"))
    start, p, sides = program(task)
    exact = solver(task).solve(data(start, p, sides), Stop())
    settings = replace(TIGHT, max_iterations=exact.iterations - 1)
    for close, status in ((1e-2, ad.Status.SOLVED), (1e-20, ad.Status.ITERATION_LIMIT)):
        near = replace(solver(task), settings=replace(settings, acceptable=Acceptable(close, close)))
        found = near.solve(data(start, p, sides), Stop())
        assert found.status is status and found.iterations == exact.iterations - 1
        assert found.x[-1] == pytest.approx(exact.x[-1], rel=1e-4)


def test_a_start_at_the_solution_is_hardly_left():
    task = Task.of(paper_problem("rr"))
    start, p, sides = program(task)
    exact = solver(task).solve(data(start, p, sides), Stop())
    far, near = (
        replace(solver(task), settings=settings).solve(data(exact.x, p, sides), Stop())
        for settings in (TIGHT, replace(TIGHT, barrier=1e-8, push=1e-5))
    )
    assert near.status is far.status is ad.Status.SOLVED
    assert 2 * near.iterations < far.iterations
    assert near.x[-1] == pytest.approx(exact.x[-1], rel=1e-7)  # the last barrier, 1e-9, of eighty bounds


def test_curvature_along_an_intervals_torques_alone_leads_to_the_same_optimum():
    task = Task.of(paper_problem("rrr"))
    guess = spline(task.problem, [])
    alike = [
        solve_quickly(replace(task, scheme=CONSTANT), guess, N, replace(TIGHT, convex=convex)) for convex in (0.0, 1e-5)
    ]
    assert alike[0].iterations != alike[1].iterations  # it was needed
    assert alike[0].usable and alike[1].usable
    assert alike[1].trajectory.duration == pytest.approx(alike[0].trajectory.duration, rel=1e-8)


def test_where_the_cost_hardly_falls_the_best_iterate_will_do():
    task = Task.of(paper_problem("rr"))
    start, p, sides = program(task)
    exact = solver(task).solve(data(start, p, sides), Stop())
    for cost, message in ((1.0, "Solved To Acceptable Level"), (-1.0, "Solve Succeeded")):
        settings = replace(TIGHT, acceptable=Acceptable(1e-2, 1e-2, cost, after=1))
        found = solver(task, settings).solve(data(start, p, sides), Stop())
        assert found.status is ad.Status.SOLVED and found.message == message
        assert (found.iterations < exact.iterations) == (cost > 0)
        assert found.x[-1] == pytest.approx(exact.x[-1], rel=1e-4)
