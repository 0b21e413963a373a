"""Stops of a solve: the clock and Ctrl-C only."""

import multiprocessing
import os
import signal
import threading

import numpy as np
import pytest

from armdyn.optimal.problem.status import Stop, stopping


def test_nothing_stops_it_unless_requested():
    stop = Stop()
    assert not stop and not stop.late and not stop.interrupted
    stop.interrupt()
    assert stop and stop.interrupted and not stop.late


def test_a_deadline_that_has_passed():
    assert Stop(deadline=0.0).late and Stop(deadline=0.0)
    assert not Stop(deadline=np.inf).late
    with stopping(-1.0) as stop:
        assert stop.late
    with stopping(3600.0) as stop:
        assert not stop


def test_ctrl_c_is_reported_once_and_raised_twice():
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), stopping(3600.0) as stop:
        os.kill(os.getpid(), signal.SIGINT)
        assert stop.interrupted
        os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


def test_other_threads_leave_signals_alone():
    before, seen = signal.getsignal(signal.SIGINT), []

    def work():
        with stopping(3600.0) as stop:
            seen.append((bool(stop), signal.getsignal(signal.SIGINT)))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [(False, before)]


def test_a_part_of_some_work_is_interrupted_with_it():
    whole = Stop()
    with stopping(3600.0, whole) as part:
        assert not part
        whole.interrupt()
        assert part.interrupted and not part.late
        os.kill(os.getpid(), signal.SIGINT)  # a terminal signals both; the first of a process never raises


def test_forks_see_an_interruption():
    stop, (ours, theirs) = Stop(), multiprocessing.Pipe()

    def stop_requested():
        for _ in range(2):
            theirs.recv()
            theirs.send(stop.interrupted)

    process = multiprocessing.get_context("fork").Process(target=stop_requested)
    process.start()
    answers = []
    for _ in range(2):
        ours.send("now?")
        answers.append(ours.recv())
        stop.interrupt()
    process.join()
    assert answers == [False, True]


def test_an_ignored_sigint_stays_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as nohup, or a background job of a script
    try:
        with stopping(3600.0) as stop:
            os.kill(os.getpid(), signal.SIGINT)
            assert not stop
    finally:
        signal.signal(signal.SIGINT, before)
