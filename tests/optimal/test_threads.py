"""Threads that solve at once take turns, and get the same as alone. In processes, as a failure is a crash."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = str(Path(__file__).parents[1])

pytestmark = pytest.mark.slow

COMMON = """
import asyncio, faulthandler, hashlib, json, multiprocessing, sys, threading
faulthandler.enable()
import numpy as np
from armdyn.optimal import MinimumTimeOptions, Status, solve_minimum_time
from armdyn.paper import solve_indirect
from problems import paper_problem

def solved(arm, **options):
    return solve_minimum_time(paper_problem(arm), MinimumTimeOptions(workers=1, starts=4, **options))

def bits(arm):
    solution = solved(arm)
    assert solution.success, solution.message
    motion, certificate = solution.trajectory, solution.certificate
    numbers = [motion.t, motion.q, motion.v, motion.tau, solution.local_optima, certificate.hamiltonian_spread]
    return hashlib.sha256(np.concatenate([np.ravel(x) for x in numbers]).tobytes()).hexdigest()

def indirect(arm):
    solution = solve_indirect(paper_problem("r"))
    assert solution.success, solution.message
    return repr(solution.duration)

def together(calls):
    found = [None] * len(calls)
    def run(k):
        found[k] = calls[k]()
    threads = [threading.Thread(target=run, args=(k,)) for k in range(len(calls))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found
"""


def output_of(script, timeout=120):
    """The JSON that a script prints."""
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {TESTS!r})" + COMMON + script]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def alone():
    """Results of one solve after the other in this process, which has imported all that it takes."""
    own = {}
    exec(COMMON.replace("faulthandler.enable()", ""), own)
    return {"r": own["bits"]("r"), "rr": own["bits"]("rr"), "indirect": own["indirect"]("r")}


@pytest.fixture(scope="module")
def threads():
    """Results of the threads of one process, which begins with them: its start takes as long as they do."""
    return output_of("""
def late(arm):
    return str([solved(arm, time_limit=1e-3).status for _ in range(5)][-1])
async def both():
    return await asyncio.gather(*(asyncio.to_thread(bits, arm) for arm in ("r", "rr", "rr")))
def crew():
    options = MinimumTimeOptions(workers=2, starts=4)
    return repr(solve_minimum_time(paper_problem("rr"), options).duration)
print(json.dumps({
    "two arms": together([lambda: bits("r"), lambda: bits("rr")] * 2),
    "indirect": together([lambda: indirect("r"), lambda: bits("rr")] * 2),
    "late": together([lambda: late("rr"), lambda: bits("rr"), lambda: late("r"), lambda: bits("r")]),
    "asyncio": asyncio.run(both()),
    "crews": [*together([crew, crew]), repr(solved("rr").duration)],
}))
""")


def test_four_threads_of_two_arms(alone, threads):
    assert threads["two arms"] == [alone["r"], alone["rr"]] * 2


def test_the_indirect_method_in_parallel_with_the_direct_one(alone, threads):
    assert threads["indirect"] == [alone["indirect"], alone["rr"]] * 2


def test_one_threads_time_limit_is_its_own(alone, threads):
    assert threads["late"][1::2] == [alone["rr"], alone["r"]]


def test_asyncio_to_thread(alone, threads):
    assert threads["asyncio"] == [alone["r"], alone["rr"], alone["rr"]]


def test_threads_that_have_workers(threads):
    assert len(set(threads["crews"])) == 1


@pytest.fixture(scope="module")
def forks():
    """Results of children of one process: born during its solves, and two at once after them."""
    return output_of("""
over, found = threading.Event(), [bits("rr")]  # all that is imported is: Python's own lock is not ours to wait for
def solve():
    while not over.is_set():
        found.append(bits("rr"))
thread = threading.Thread(target=solve)
thread.start()
for _ in range(5):
    with multiprocessing.get_context("fork").Pool(1) as pool:
        found += pool.map(bits, ["rr"])
over.set()
thread.join()
with multiprocessing.get_context("fork").Pool(2) as pool:
    print(json.dumps({"during": sorted(set(found)), "pool": pool.map(bits, ["r", "rr", "r"])}))
""")


def test_daemon_workers_of_a_callers_pool(alone, forks):
    assert forks["pool"] == [alone["r"], alone["rr"], alone["r"]]


def test_a_fork_during_a_solve_solves_too(alone, forks):
    """Its child must find no lock taken, and no solver half-way."""
    assert forks["during"] == [alone["rr"]]
