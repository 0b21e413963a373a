"""Workers end with their owner, however it ends, and release the caller's pipes and files."""

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

import armdyn as ad

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the kernel's doing")

ARMDYN = [sys.executable, "-c", "from armdyn.cli import main; main()"]
LONG_CALL = """
import os
from functools import partial
from {room} import {together}

def busy(k):
    os.write(1, b"begun\\n")
    sum(range(10**12))  # never comes back to Python

list({together}([partial(busy, k) for k in range(2)], 2))
"""
SEARCH = """
import armdyn as ad
robot = ad.Robot.from_urdf("rrr.urdf", payload=ad.Payload(mass=0.5))
problem = ad.MinimumTimeProblem(robot, q_start=[-1.5, 0, 0], q_goal=[0.2, 0, 0])
ad.solve_minimum_time(problem, ad.MinimumTimeOptions(compile=False, workers=2))
"""
ENDINGS = pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM], ids=["SIGKILL", "SIGTERM"])


def owner_of(command, folder=None):
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder)


@pytest.fixture
def rrr(tmp_path):
    """A folder with rrr.urdf, written here: a process that writes it takes another half a second to start."""
    (tmp_path / "rrr.urdf").write_text(ad.urdf_from_spec(ad.ArmSpec.paper("rrr")))
    return tmp_path


def workers_of(owner, count=2, cpu=0.0, deadline=120.0):
    """Its workers, once a number of them has worked for a time [s]."""
    until = time.monotonic() + deadline
    while time.monotonic() < until:
        assert owner.poll() is None, owner.stderr.read()
        workers = psutil.Process(owner.pid).children()
        if len(workers) >= count and all(sum(worker.cpu_times()[:2]) >= cpu for worker in workers):
            return workers
        time.sleep(0.02)
    raise AssertionError(f"no {count} workers within {deadline} s")


def assert_nothing_is_left(owner, workers, how):
    """After two seconds at the most."""
    owner.send_signal(how)
    owner.communicate(timeout=2)  # no other process holds the pipes
    assert owner.returncode == -how
    until = time.monotonic() + 2
    left = workers
    while left and time.monotonic() < until:  # who waits for its parent, init, to look is no more
        left = [worker for worker in left if worker.is_running() and worker.status() != psutil.STATUS_ZOMBIE]
    assert not left


@ENDINGS
@pytest.mark.parametrize(
    ("room", "together"), [("armdyn.parallel", "in_processes"), ("armdyn.paper.parallel", "as_completed")]
)
def test_within_one_long_call(how, room, together):
    owner = owner_of([sys.executable, "-c", LONG_CALL.format(room=room, together=together)])
    assert [owner.stdout.readline() for _ in range(2)] == ["begun\n"] * 2
    assert_nothing_is_left(owner, workers_of(owner), how)


@pytest.mark.slow
@ENDINGS
def test_in_the_middle_of_a_search(how, rrr):
    """Without machine code, so that IPOPT solves in processes: the stagewise method has threads."""
    owner = owner_of([sys.executable, "-c", SEARCH], rrr)
    assert_nothing_is_left(owner, workers_of(owner, min(os.cpu_count(), 2), 0.2), how)


@pytest.mark.slow
@ENDINGS
def test_in_the_middle_of_the_whole_paper(how, tmp_path):
    owner = owner_of([*ARMDYN, "reproduce", "--payload", "0.5", "--out", str(tmp_path)])
    workers = workers_of(owner, min(os.cpu_count(), 2), 0.2)
    assert_nothing_is_left(owner, workers, how)


SOLVE = """
import armdyn as ad
start, goal = {poses}
robot = {robot}
problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, {more})
ad.solve_minimum_time(problem, ad.MinimumTimeOptions(workers=2))
print("solved", flush=True)
{then}
"""
UR5 = {
    "robot": "ad.Robot.from_library('ur5')",
    "poses": "[0, -1, 1, -1, -1.5, 0], [1, -1.2, 1, -1, -1.5, 0]",
    "more": "acceleration_limit=1000.0",  # more than torques allow: without, or with less, no machine code is needed
}
RRR = {"robot": "ad.Robot.from_urdf('rrr.urdf')", "poses": "[-1.5, 0, 0], [0.2, 0, 0]", "more": ""}


def compiling(folder, robot, then=""):
    """A process that solves, and the compiler that it has spawned, which sleeps, with the compiler's child."""
    child, compiler = folder / "child", folder / "compiler"
    compiler.write_text(f"#!/bin/sh\nsleep 300 &\necho $$ $! >> {child}.new; mv {child}.new {child}; wait\n")
    compiler.chmod(0o755)
    (folder / "cache").mkdir(mode=0o700)
    own = os.environ | {"CC": str(compiler), "ARMDYN_CACHE": str(folder / "cache")}
    command = [sys.executable, "-c", SOLVE.format(**robot, then=then)]
    owner = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=own, cwd=folder)
    until = time.monotonic() + 60
    while not child.exists():
        assert time.monotonic() < until and owner.poll() is None
        time.sleep(0.02)
    return owner, [int(pid) for pid in child.read_text().split()]


def runs(pid):
    """Whether a process is there, and no zombie; it may end while it is looked at."""
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def assert_all_end(pids, folder, deadline=5.0):
    """Compilers, their children and builders; and no mark is left by which others would wait for a library."""
    until = time.monotonic() + deadline
    while left := [pid for pid in pids if runs(pid)]:
        assert time.monotonic() < until, left
        time.sleep(0.02)
    while list(folder.glob("cache/*.building")):
        assert time.monotonic() < until
        time.sleep(0.02)


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("robot", [UR5, RRR], ids=["in the background", "awaited"])
def test_a_compiler_ends_with_its_owner(robot, how, rrr):
    owner, pids = compiling(rrr, robot, then="input()" if how is signal.SIGKILL else "")
    owner.send_signal(how)
    assert_all_end(pids, rrr)
    owner.kill()
    owner.communicate()
