import os
import sys
import threading

import numpy as np
import pytest

from armdyn.locks import built_once, one_at_a_time
from armdyn.models import Robot
from armdyn.models.scene.collision import collision_model


@pytest.fixture
def hurried():
    """Threads take turns five thousand times as often."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def together(calls):
    found, start = [None] * len(calls), threading.Barrier(len(calls))

    def run(k):
        start.wait()
        found[k] = calls[k]()

    threads = [threading.Thread(target=run, args=(k,)) for k in range(len(calls))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found


def test_threads_that_ask_for_the_same_get_the_same(hurried):
    made = []

    @built_once(maxsize=4)
    def build(k, *, more=0):
        """Its docstring."""
        made.append(k)
        return [k + more]

    assert len({id(thing) for thing in together([lambda: build(1)] * 8)}) == 1
    assert made == [1]
    assert build(1, more=2) == [3] and made == [1, 1]
    assert build.__doc__ == "Its docstring." and build.__wrapped__.cache_info().currsize == 2


def test_who_builds_may_build_from_cached_objects():
    @built_once(maxsize=4)
    def build(k):
        return [*build(k - 1), k] if k else []

    assert build(3) == [1, 2, 3]


def test_a_fork_waits_for_its_turn_and_leaves_nothing_locked():
    taken, leave = threading.Event(), threading.Event()

    def works():
        with one_at_a_time:
            taken.set()
            leave.wait(20)
            finished.append(True)

    finished = []
    thread = threading.Thread(target=works)
    thread.start()
    assert taken.wait(20)
    threading.Thread(target=leave.set).start()
    if (pid := os.fork()) == 0:
        free = together([lambda: one_at_a_time.acquire(timeout=20)])
        os._exit(0 if finished and free == [True] else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
    thread.join()
    assert together([lambda: one_at_a_time.acquire(blocking=False) and one_at_a_time.release() is None]) == [True]


def test_threads_that_look_at_one_arms_distances(hurried):
    robot = Robot.from_library("panda")
    model = collision_model(robot, (), True)
    poses = np.random.default_rng(0).uniform(-1, 1, (2, robot.nv))
    alone = [model.distances(q) for q in poses]
    found = together([lambda q=q: [model.distances(q) for _ in range(400)] for q in poses])
    for each, right in zip(found, alone, strict=True):  # coal begins where it ended the time before: 1e-6 [m]
        np.testing.assert_allclose(each, [right] * 400, atol=1e-5)
