"""armdyn itself: one solve from the straight start, by collocation or as a curve; `solve_minimum_time` as it comes."""

from protocol import INTERVALS, Answer, main

import armdyn as ad
from armdyn.optimal.curves.excess import sampled
from armdyn.optimal.curves.program import torque_equations
from armdyn.optimal.curves.refinement import refine_curve
from armdyn.optimal.curves.solve import straight_curve
from armdyn.optimal.mesh.condensed import prepare_quickly, solve_quickly
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.within_limits import follow


def build(problem, method):
    """One of the three, ready to solve."""
    options = ad.MinimumTimeOptions(calm=0, compile=True)
    task = Task.of(problem, options)
    if method == "full":
        if task.policy.strategy.curves_alone:
            torque_equations(task.dynamics, True)
        else:
            prepare_quickly(task, options.intervals, task.alone())

        def solve():
            solution = ad.solve_minimum_time(problem, options)
            word = "certified" if solution.certificate.ok else str(solution.status)
            return Answer(solution.trajectory, word)

        return solve

    if method == "curve":
        straight = straight_curve(task, task.policy.curves.intervals)
        torque_equations(task.dynamics, True)

        def solve_curve():
            refined = refine_curve(task, straight)
            return Answer(follow(task, sampled(task, refined.curve)), str(refined.solved.result.status))

        return solve_curve

    guess = spline(problem, [])
    prepare_quickly(task, INTERVALS, task.alone())

    def solve_once():
        attempt = solve_quickly(task, guess, INTERVALS, task.alone())
        return Answer(attempt.trajectory, str(attempt.status))

    return solve_once


if __name__ == "__main__":
    main(build, ("full", "mesh", "curve"))
