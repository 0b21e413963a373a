"""Many problems on all cores: each as alone, whatever fails."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal import many as module
from problems import paper_arm

ARM = paper_arm("rr")
QUICK = ad.MinimumTimeOptions(starts=2)


def problems(count, robot=ARM):
    goals = np.random.default_rng(3).uniform(-1.2, 1.2, (count, 2))
    return [ad.MinimumTimeProblem(robot, q_start=[0.0, 0.0], q_goal=goal) for goal in goals]


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2, 3])
def test_every_problem_has_the_solution_that_it_has_alone(workers):
    requests, messages = problems(4), list[str]()
    found = ad.solve_many(requests, replace(QUICK, workers=workers), messages.append)
    assert [one.problem for one in found] == requests
    assert [one.duration for one in found] == [
        ad.solve_minimum_time(one, replace(QUICK, workers=1)).duration for one in requests
    ]
    assert len(messages) == 4
    assert messages[-1].startswith("4 of 4 solved, 4 usable")


def test_no_problems_no_solutions():
    assert ad.solve_many([]) == []


def impossible(problem, options):
    if problem.q_goal[0] > 0:
        raise ZeroDivisionError("no way")
    return ad.solve_minimum_time(problem, options)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_problem_that_raises_says_so_and_the_others_are_solved(workers, monkeypatch):
    monkeypatch.setattr(module, "solve_minimum_time", impossible)
    requests = problems(5)
    found = ad.solve_many(requests, replace(QUICK, workers=workers))
    bad = [one.q_goal[0] > 0 for one in requests]
    assert 0 < sum(bad) < 5
    assert [one.status == "failed" and "ZeroDivisionError: no way" in one.message for one in found] == bad
    assert [one.usable for one in found] == [not each for each in bad]
    assert not any(one.moves for one, each in zip(found, bad, strict=True) if each)


def deadly(problem, options):
    if problem.q_goal[0] > 0 and os.getpid() != HERE:
        os.kill(os.getpid(), signal.SIGKILL)
    return ad.solve_minimum_time(problem, options)


HERE = os.getpid()


@pytest.mark.slow
def test_a_problem_that_kills_its_workers_does_not_stop_the_others(monkeypatch):
    monkeypatch.setattr(module, "solve_minimum_time", deadly)
    requests = problems(5)
    bad = [one.q_goal[0] > 0 and k > 0 for k, one in enumerate(requests)]  # the first is solved here
    found = ad.solve_many(requests, replace(QUICK, workers=2))
    assert any(bad)
    assert ["its worker died" in one.message for one in found] == bad
    assert [one.usable for one in found] == [not each for each in bad]


INTERRUPTED = """
import armdyn as ad, numpy as np
arm = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
goals = np.random.default_rng(3).uniform(-1, 1, (60, 2))
requests = [ad.MinimumTimeProblem(arm, q_start=np.zeros(2), q_goal=goal) for goal in goals]
found = ad.solve_many(requests, ad.MinimumTimeOptions(starts=6, workers=WORKERS), lambda text: print(text, flush=True))
print("left", sum(one.status == "interrupted" for one in found), "usable", sum(one.usable for one in found), flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c_leaves_the_solutions_that_are_finished(workers):
    code = INTERRUPTED.replace("WORKERS", str(workers))
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        lines = [process.stdout.readline() for _ in range(3)]
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        began = time.monotonic()
        rest = process.stdout.read().splitlines()
        assert time.monotonic() - began < 20  # a solve listens every few iterations; a loaded machine is slow
    assert process.returncode == 0
    assert lines[-1].startswith("3 of 60 solved, 3 usable")
    words = rest[-1].split()
    left, usable = int(words[1]), int(words[3])
    assert usable >= 3
    assert left + usable == 60
    assert left > 0


def test_a_wrong_problem_is_refused():
    with pytest.raises(ad.ArmdynError, match=r"problems\[1\]"):
        ad.solve_many([problems(1)[0], ARM])
