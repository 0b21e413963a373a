import multiprocessing
import os
import signal
import sys
import threading
import time
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest

from armdyn.optimal.problem.status import Stop, stopping
from armdyn.paper.parallel import as_completed
from armdyn.parallel import concurrently, in_processes, shared_pool

HERE = os.getpid()
FORK = multiprocessing.get_context("fork")
PATIENCE = 20  # [s] after which an event counts as missing


def square(k):
    return k * k, os.getpid()


@pytest.mark.slow
@pytest.mark.parametrize("together", [in_processes, as_completed])
@pytest.mark.parametrize("workers", [1, 2, 3, None])
def test_every_job_is_done_once(workers, together):
    results = list(together([partial(square, k) for k in range(10)], workers))
    squares = [result for result, _ in results]
    assert (squares if together is in_processes else sorted(squares)) == [k * k for k in range(10)]
    processes = min(workers or os.cpu_count() or 1, 10)  # each begins with a job of its own
    assert len({pid for _, pid in results} - {HERE}) == (0 if processes == 1 else processes)


def test_the_first_job_may_be_done_here():
    results = list(in_processes([partial(square, k) for k in range(10)], 2, first_here=True))
    assert [result for result, _ in results] == [k * k for k in range(10)]
    assert results[0][1] == HERE and HERE not in {pid for _, pid in results[1:]}


def test_no_jobs_no_results():
    assert list(in_processes([], 2)) == list(as_completed([], 2)) == []


def plus(k, context):
    return context[0] + k, os.getpid()


def test_a_shared_pool_forks_once_for_all_series_of_jobs():
    with shared_pool([100], 2) as pool:
        first, second = (list(pool([partial(plus, k) for k in series])) for series in (range(6), range(6, 10)))
    assert [result for result, _ in first + second] == [100 + k for k in range(10)]
    assert len({pid for _, pid in first + second} - {HERE}) == 2


def in_a_thread(event, k, context):
    """The first job waits for the last, so that both are under way at once."""
    if k == 0:
        assert event.wait(PATIENCE)
    if k == 3:
        event.set()
    return context[0] + k, os.getpid(), threading.get_ident()


def test_threads_share_the_process_and_keep_the_order():
    event = threading.Event()
    with shared_pool([100], 2, threads=True) as pool:
        results = list(pool([partial(in_a_thread, event, k) for k in range(4)]))
    assert [(result, pid) for result, pid, _ in results] == [(100 + k, HERE) for k in range(4)]
    assert threading.get_ident() not in {thread for _, _, thread in results}


def refused(context):
    raise ValueError(context)


def test_an_error_in_a_thread_is_raised_here():
    with shared_pool("no", 2, threads=True) as pool, pytest.raises(ValueError, match="no"):
        list(pool([refused, refused]))


def endless(k, context):
    while k:
        signal.pause()
    return os.getpid()


def test_a_shared_pool_works_on_when_a_series_is_not_read_to_its_end():
    with shared_pool([100], 2) as pool:
        with closing(pool([partial(endless, k) for k in range(4)])) as results:
            next(results)
        assert [result for result, _ in pool([partial(plus, k) for k in range(4)])] == [100, 101, 102, 103]


def test_a_shared_pool_of_one_works_here():
    with shared_pool([100], 1) as pool:
        assert list(pool([partial(plus, 1)])) == [(101, HERE)]


def overtaken(event, k):
    """The first job waits for the last."""
    if k == 0:
        assert event.wait(PATIENCE)
    if k == 3:
        event.set()
    return k


@pytest.mark.parametrize(
    ("together", "orders"), [(in_processes, [[0, 1, 2, 3]]), (as_completed, [[1, 2, 3, 0], [1, 2, 0, 3]])]
)
def test_in_order_or_as_they_end(together, orders):
    event = FORK.Event()
    assert list(together([partial(overtaken, event, k) for k in range(4)], 2)) in orders


def finds(done, k):
    """Which jobs had ended when it was begun."""
    before = set(done)
    done.append(k)
    return k, before


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_a_job_is_begun_when_those_that_it_waits_for_have_ended(workers):
    with FORK.Manager() as manager:
        after = {0: [3], 1: [0, 2], 4: []}
        done = manager.list()
        results = dict(as_completed([partial(finds, done, k) for k in range(5)], workers, after))
    assert results.keys() == set(range(5))
    assert all(results[k] >= set(others) for k, others in after.items())


@pytest.mark.parametrize("workers", [1, 2])
def test_jobs_that_wait_for_each_other_are_refused(workers):
    jobs = as_completed([int, int, int], workers, {1: [2], 2: [1]})
    assert next(jobs) == 0
    with pytest.raises(ValueError, match=r"\[1, 2\] wait for each other"):
        next(jobs)


def dies_elsewhere(k):
    if k % 2 and os.getpid() != HERE:
        os.kill(os.getpid(), signal.SIGKILL)
    return k, os.getpid()


@pytest.mark.parametrize("together", [in_processes, as_completed])
def test_a_dead_workers_job_is_done_here(together):
    results = sorted(together([partial(dies_elsewhere, k) for k in range(6)], 2))
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


def first_of_all(k):
    while k:
        signal.pause()
    return k


def gone(deadline=PATIENCE):
    """Whether the workers are gone in time."""
    until = time.monotonic() + deadline
    while multiprocessing.active_children() and time.monotonic() < until:
        time.sleep(0.01)
    return not multiprocessing.active_children()


def test_a_caller_that_stops_does_not_wait():
    for result in in_processes([partial(first_of_all, k) for k in range(3)], 2):
        assert result == 0
        break
    assert gone()


def listens(file, begun):
    """As a solve does, which then returns."""
    with stopping(PATIENCE) as stop:
        begun.set()
        while not stop:
            time.sleep(0.01)
    file.write_text("interrupted" if stop.interrupted else "late")


def is_deaf(file, begun):
    begun.set()
    time.sleep(PATIENCE)
    file.write_text("whole")


def test_who_stops_asking_interrupts_and_waits_two_seconds(tmp_path):
    begun = [FORK.Event(), FORK.Event()]
    files = [tmp_path / "listens", tmp_path / "deaf"]
    callers_own = FORK.Process(target=signal.pause, daemon=True)
    callers_own.start()
    jobs = [partial(listens, files[0], begun[0]), partial(is_deaf, files[1], begun[1]), int]
    with closing(as_completed([int, *jobs], 3)) as results:
        assert next(results) == 0
        assert all(event.wait(PATIENCE) for event in begun)
        began = time.monotonic()
    assert time.monotonic() - began < 3  # 1.5 s, and the delays of a busy machine
    spared = callers_own.is_alive()  # no other process was interrupted
    callers_own.kill()
    callers_own.join()
    assert files[0].read_text() == "interrupted" and not files[1].exists() and spared
    assert gone()


def waits_for(stop, begun):
    begun.release()
    while not stop:
        time.sleep(0.01)
    return os.getpid()


def test_an_interruption_reaches_the_workers():
    stop, begun = Stop(time.perf_counter() + PATIENCE), FORK.Semaphore(0)
    when_both_are_at_it = threading.Thread(target=lambda: (begun.acquire(), begun.acquire(), stop.interrupt()))
    when_both_are_at_it.start()
    pids = list(in_processes([partial(waits_for, stop, begun)] * 2, 2))
    when_both_are_at_it.join()
    assert HERE not in pids and len(set(pids)) == 2
    assert stop.interrupted and not stop.late


def survives_ctrl_c():
    os.kill(os.getpid(), signal.SIGINT)
    return os.getpid()


def test_ctrl_c_does_not_kill_workers():
    assert HERE not in list(in_processes([survives_ctrl_c] * 2, 2))


def nested(line):
    line.send([*in_processes([os.getpid] * 2, 2), *as_completed([os.getpid] * 2, 2)])


def test_a_worker_has_no_workers_of_its_own():
    ours, theirs = multiprocessing.Pipe()
    process = FORK.Process(target=nested, args=(theirs,), daemon=True)
    process.start()
    assert ours.recv() == [process.pid] * 4
    process.join()


def lines():
    """The sockets that this process has."""
    found = set()
    for entry in Path("/proc/self/fd").iterdir():
        try:
            found.add(str(entry.readlink()))
        except OSError:  # the listing's own
            continue
    return {name for name in found if name.startswith("socket:")}


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_worker_keeps_no_line_but_its_own():
    before = lines()
    other = in_processes([int, int], 2)  # of another crew, which is there at the same time
    assert next(other) == 0
    held = [sockets - before for sockets in in_processes([lines] * 3, 3)]
    other.close()
    assert [len(sockets) for sockets in held] == [1, 1, 1] and len(set.union(*held)) == 3


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel's doing")
def test_jobs_that_a_thread_left_behind_are_done():
    results = in_processes([partial(square, k) for k in range(6)], 2)
    known = []
    thread = threading.Thread(target=lambda: known.append(next(results)))
    thread.start()
    thread.join()  # and its workers end with it
    assert [square for square, _ in [*known, *results]] == [k * k for k in range(6)]
    assert gone()


@pytest.mark.slow
def test_a_job_that_does_not_poll_its_stop_is_given_up():
    stop = Stop(deadline=time.perf_counter() + 0.1)
    with concurrently(partial(time.sleep, PATIENCE), None, stop.__bool__, "unknown") as result:
        began = time.monotonic()
        assert result() == result() == "unknown"
    assert time.monotonic() - began < PATIENCE / 2  # two grace periods of 0.75 s
    with concurrently(partial(square, 3), None, lambda: True, None) as result:
        assert result()[0] == 9 and result()[1] != HERE  # it has ended within the grace period
