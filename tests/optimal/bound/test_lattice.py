"""Work on bounds of a chain: a count that ends it, and as many processes as there are."""

import os
import signal

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.models.scene.reaching import frame_placement
from armdyn.optimal.bound.chain import chain_bound, covers
from armdyn.optimal.bound.lattice import Effort, Lattice
from armdyn.optimal.bound.leg import bound_legs
from armdyn.optimal.problem.policy.bound import BoundPolicy
from problems import paper_arm

HOME = np.array([0.1, 0.4])


@pytest.fixture(scope="module")
def chain():
    """There and back of a two-link arm that slows down at its velocity limits, two branches each: problems, stops."""
    robot = paper_arm("rr").with_limits(None, 2.0)
    goals = [
        ad.GoalPose(robot.tip, frame_placement(robot, robot.tip, np.array(q)).translation.copy())
        for q in ([0.9, 0.5], [1.5, -0.7])
    ]
    ways = ((HOME, [0.9, 0.5]), ([0.9, 0.5], [1.5, -0.7]), ([1.5, -0.7], HOME))
    return [ad.MinimumTimeProblem(robot, q_start=a, q_goal=b) for a, b in ways], [HOME, *goals, HOME]


def test_processes_make_no_difference(chain):
    found, left = [], []
    for workers in (1, 2):
        effort = Effort(40, workers=workers)
        found.append(chain_bound(*chain, 3.0, effort))
        left.append(effort.left)
    assert found[0] == found[1]
    assert left[0] == left[1] < 40


def test_the_bound_rises_with_its_programs_and_says_so(chain):
    lines = []
    none, many = (chain_bound(*chain, 3.0, Effort(n, report=lines.append, others=0.5)) for n in (0, 400))
    problems, stops = chain
    legs = [bound_legs(problem, BoundPolicy())[0] for problem in problems]
    by_velocity = Lattice(legs, covers(legs, stops, 3.0, lambda: False)).path().duration
    assert none == by_velocity < many < 3.0
    assert lines[0] == f"proven: not below {0.5 + none:.4f} s; 400 linear programs are left"


@pytest.mark.slow
def test_an_interrupt_ends_the_proof_and_keeps_the_cycle():
    robot = paper_arm("rr").with_limits(None, 2.0)
    reach = frame_placement(robot, robot.tip, np.array([0.9, 0.5])).translation.copy()
    cycle = ad.Cycle(robot, start=HOME, steps=[ad.Move(ad.GoalPose(robot.tip, reach), name="there")], closed=True)
    lines = []

    def pressed(line):
        lines.append(line)
        if line.startswith("proven:"):
            os.kill(os.getpid(), signal.SIGINT)

    options = ad.MinimumTimeOptions(search="quick", workers=1)
    found = ad.solve_cycle(cycle, options, pressed)
    assert sum(line.startswith("proven:") for line in lines) == 1
    assert found.usable
    assert 0 < found.lower_bound < found.duration
    whole = ad.solve_cycle(cycle, options)
    assert found.lower_bound <= whole.lower_bound <= whole.duration


def test_programs_of_a_cycle_are_a_number():
    with pytest.raises(ProblemError, match="bound_programs is 0; it must be at least 1"):
        ad.MinimumTimeOptions(bound_programs=0)
