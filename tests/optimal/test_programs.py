"""Programs for other solvers: CasADi's IPOPT against armdyn's own solves on the same mesh from the same guess."""

import re
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.curves.layout import CurveSpec
from armdyn.optimal.curves.solve import solve_curve, straight_curve
from armdyn.optimal.mesh.direct import solve_on_mesh
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.task import Task
from problems import POSES, paper_arm, paper_problem

PAGE = Path(__file__).parents[2] / "docs" / "programs.md"
START, GOAL = POSES["rr"]
MORE = {
    "plain": {},
    "rows": {"acceleration_limit": 100.0},
    "linear": {"path_constraints": [ad.TorqueRateLimit(200.0)]},
    "effort": {"effort_weight": 1.0},
    "via": {"via": [[-0.5, 0.5]]},
}
PENDULUM = ad.MinimumTimeProblem(ad.Robot.from_library("cart_pole"), q_start=[0.0, 0.0], q_goal=[1.0, 0.0])
KINDS = pytest.mark.parametrize("more", MORE.values(), ids=MORE)


def rr(**more):
    return ad.MinimumTimeProblem(paper_arm("rr", 0.1006), q_start=START, q_goal=GOAL, **more)


def solved(program, **options):
    """By CasADi's own derivatives and IPOPT's own options."""
    solver = ca.nlpsol("solver", "ipopt", program.nlp, {"ipopt": {"print_level": 0, "sb": "yes"}, "print_time": False})
    found = solver(**program.bounds, **options)
    assert solver.stats()["success"]
    return program.trajectory(found["x"]), float(found["f"])


def check(program):
    """Sizes and names that fit, a guess within its bounds."""
    n, m = program.x.numel(), program.g.numel()
    for array in (program.lower, program.upper, program.units, program.guess):
        assert array.shape == (n,)
    assert program.row_lower.shape == program.row_upper.shape == (m,)
    assert len(set(program.names)) == n and len(set(program.row_names)) == m and "" not in program.names
    assert np.all(program.lower <= program.guess) and np.all(program.guess <= program.upper)
    assert np.all(program.units > 0)


@pytest.mark.slow
def test_the_page_solves_what_it_says():
    made = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S):
        exec(block, made)
    task = Task.of(made["problem"])
    own = solve_on_mesh(task, spline(task.problem, []), 20, task.alone())
    assert own.usable and made["solver"].stats()["success"]
    # The same program by the same IPOPT; both tolerances are 1e-8.
    assert made["motion"].duration == pytest.approx(own.trajectory.duration, rel=1e-8)
    slower = made["slower"]
    assert np.max(slower.v[:, 0]) == pytest.approx(10.0, rel=1e-6)  # bounds are relaxed by 1e-8 of the scaled ones
    assert slower.duration > made["motion"].duration


@pytest.mark.slow
@KINDS
def test_a_mesh_by_another_solver_is_armdyns(more):
    problem = rr(**more)
    program = ad.build_mesh(problem, 12)
    check(program)
    motion, _ = solved(program)
    task = Task.of(problem)
    own = solve_on_mesh(task, spline(problem, []), 12, replace(task.alone(), tolerance=1e-9))
    assert own.usable
    # Both end at 1e-8 of the scaled conditions; a cost that is flat in the duration has ten times that.
    assert motion.duration == pytest.approx(own.trajectory.duration, rel=1e-7)


@pytest.mark.slow
@KINDS
def test_a_curve_by_another_solver_is_armdyns(more):
    problem = rr(**more)
    program = ad.build_curve(problem, 16)
    check(program)
    motion, _ = solved(program)
    task = Task.of(problem)
    task = replace(task, policy=task.policy.changed("curves", tolerance=1e-10))
    own = solve_curve(task, straight_curve(task, 16), CurveSpec.of(task))
    assert own.converged
    # Both end at 1e-8 of the scaled conditions, and relax limits by as much.
    assert motion.duration == pytest.approx(own.curve.duration, rel=1e-6)


@pytest.mark.parametrize("build", [ad.build_mesh, ad.build_curve])
def test_names_and_units_are_the_motions(build):
    """The guess read back, against its unknowns by name."""
    problem = rr(velocity_limit=20.0)
    program = build(problem, 8)
    motion = program.trajectory(program.guess)
    named = dict(zip(program.names, program.guess * program.units, strict=True))
    assert named["T[0]"] == pytest.approx(motion.duration, rel=1e-14)
    first, last = ("q[0]", "q[8]") if build is ad.build_mesh else ("point[0]", "point[11]")
    for pose, place in ((START, first), (GOAL, last)):
        assert [named[f"{place}.joint{i}"] for i in (1, 2)] == pytest.approx(list(pose), rel=1e-14)
    if build is ad.build_mesh:
        upper = dict(zip(program.names, program.upper * program.units, strict=True))
        assert upper["v[3].joint2"] == pytest.approx(20.0) and upper["middle v[3].joint2"] == pytest.approx(20.0)
        assert upper["tau[7].joint1"] == pytest.approx(problem.limits.actuators.upper[0])
        assert program.row_names[:3] == (
            "interval[0] middle q.joint1",
            "interval[0] middle q.joint2",
            "interval[0] middle v.joint1",
        )


def test_a_guess_of_ones_own():
    problem = rr()
    guess = spline(problem, [np.array([-0.5, 0.8])])
    mesh, curve = (build(problem, 20, guess) for build in (ad.build_mesh, ad.build_curve))
    t = np.linspace(0, 1, 9)
    for program, error in ((mesh, 1e-3), (curve, 0.1)):  # a curve's control points, not its poses, are on the guess
        motion = program.trajectory(program.guess)
        assert motion.duration == pytest.approx(guess.duration)
        near = motion(t * motion.duration).q - guess(guess.t[0] + t * guess.duration).q
        assert np.max(np.abs(near)) < error


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: ad.build_mesh(1), "problem is 1; it must be a MinimumTimeProblem"),
        (lambda: ad.build_mesh(rr(), 0), "intervals is 0; it must be at least 1"),
        (lambda: ad.build_curve(rr(), guess=1), "guess is 1; it must be a Trajectory"),
        (lambda: ad.build_mesh(rr(), 4, spline(paper_problem("r"), [])), "moves 1 joint, .* has 2"),
        (lambda: ad.build_curve(PENDULUM), "a passive joint has none; build_mesh"),
        (lambda: ad.build_mesh(rr(), 4).trajectory([1.0]), "x has 1 unknowns; the program has 49"),
    ],
)
def test_mistakes_are_named(build, words):
    with pytest.raises(ProblemError, match=words):
        build()
