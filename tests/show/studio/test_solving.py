"""The solver's process: the newest request wins."""

import multiprocessing
import os
import signal
import time

from armdyn.optimal.problem.status import stopping
from armdyn.show.studio.solving import NewestFirst


def slowly(seconds):
    """Its argument after that many seconds, or at once if interrupted; negative: its process dies."""
    if seconds < 0:
        os._exit(1)
    stopped = []
    signal.signal(signal.SIGINT, lambda number, frame: stopped.append(1))
    end = time.monotonic() + seconds
    while time.monotonic() < end and not stopped:
        time.sleep(0.01)
    return seconds, bool(stopped)


def next_result(solver, seconds=30.0):
    end = time.monotonic() + seconds
    while (found := solver.newest()) is None:
        assert time.monotonic() < end
        time.sleep(0.01)
    return found


def test_the_newest_request_is_done_and_the_running_one_is_stopped_for_it():
    with NewestFirst(slowly, 60.0) as solver:
        began = time.monotonic()
        assert solver.seconds is not None
        for request in (50.0, 40.0, 0.1):  # the first two are never begun
            solver.request(request)
        assert next_result(solver)[1] == (60.0, True)
        assert next_result(solver)[1] == (0.1, False)
        assert time.monotonic() - began < 30.0
        assert solver.newest() is None


def test_it_is_stopped_also_where_ctrl_c_is_ignored_by_inheritance():
    def until_stopped(seconds):
        with stopping(seconds) as stop:
            while not stop:
                time.sleep(0.01)
        return stop.interrupted

    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with NewestFirst(until_stopped, 20.0) as solver:
            solver.request(0.1)
            assert next_result(solver)[1] is True
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_short_computation_is_left_to_end():
    with NewestFirst(slowly, 0.2) as solver:
        solver.request(0.6)
        assert next_result(solver)[1] == (0.2, False)
        assert next_result(solver)[1] == (0.6, False)


def test_a_process_that_dies_is_replaced():
    with NewestFirst(slowly, -1.0) as solver:
        assert next_result(solver) == (-1.0, None)
        solver.request(0.0)
        assert next_result(solver)[1] == (0.0, False)


def test_no_process_is_left():
    with NewestFirst(slowly, 60.0):
        assert multiprocessing.active_children()
    end = time.monotonic() + 10
    while multiprocessing.active_children() and time.monotonic() < end:
        time.sleep(0.01)
    assert not multiprocessing.active_children()
