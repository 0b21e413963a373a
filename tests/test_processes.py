import multiprocessing
import os
import signal
import threading
import time
from functools import partial

import pytest

from armdyn.optimal.problem.stop import Stop
from armdyn.processes import in_processes

HERE = os.getpid()


def slow_square(k):
    time.sleep(0.05 * (k % 3 == 0))  # others overtake it
    return k * k, os.getpid()


@pytest.mark.parametrize("workers", [1, 2, 3, None])
def test_results_come_in_the_jobs_order(workers):
    results = list(in_processes([partial(slow_square, k) for k in range(10)], workers))
    assert [square for square, _ in results] == [k * k for k in range(10)]
    crew = min(workers or os.cpu_count() or 1, 10)  # each begins with a job of its own
    assert len({pid for _, pid in results} - {HERE}) == (0 if crew == 1 else crew)


def test_no_jobs_no_results():
    assert list(in_processes([], 2)) == []


def dies_elsewhere(k):
    if k % 2 and os.getpid() != HERE:
        os.kill(os.getpid(), signal.SIGKILL)
    return k, os.getpid()


def test_what_a_dead_worker_left_is_done_here():
    results = list(in_processes([partial(dies_elsewhere, k) for k in range(6)], 2))
    assert [k for k, _ in results] == list(range(6))
    assert {results[1][1], results[3][1], results[5][1]} == {HERE}


def raises(k):
    if k == 2:
        raise ValueError(f"job {k}")
    return k


def test_an_error_is_raised_here_when_its_turn_comes():
    results = in_processes([partial(raises, k) for k in range(4)], 2)
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(ValueError, match="job 2"):
        next(results)


def waits(k, seconds):
    time.sleep(seconds)
    return k


def test_who_has_seen_enough_waits_for_nobody():
    started = time.perf_counter()
    for result in in_processes([partial(waits, 0, 0.0), partial(waits, 1, 60.0), partial(waits, 2, 60.0)], 2):
        assert result == 0
        break
    assert time.perf_counter() - started < 10  # far less than what is under way
    deadline = time.perf_counter() + 10
    while multiprocessing.active_children() and time.perf_counter() < deadline:
        time.sleep(0.01)
    assert not multiprocessing.active_children()


def waits_for(stop):
    while not stop.interrupted:
        time.sleep(0.01)
    return os.getpid()


def test_an_interruption_reaches_the_workers_and_ctrl_c_does_not_kill_them():
    stop = Stop(time.perf_counter() + 60)
    timer = threading.Timer(0.3, stop.interrupt)
    timer.start()
    pids = list(in_processes([partial(waits_for, stop)] * 2, 2))
    assert HERE not in pids and len(set(pids)) == 2
    assert stop and stop.interrupted and not stop.late


def nested(line):
    line.send(list(in_processes([os.getpid, os.getpid], 2)))


def test_a_worker_has_no_workers_of_its_own():
    ours, theirs = multiprocessing.Pipe()
    process = multiprocessing.get_context("fork").Process(target=nested, args=(theirs,), daemon=True)
    process.start()
    assert ours.recv() == [process.pid, process.pid]
    process.join()
