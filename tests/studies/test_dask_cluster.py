"""Cases on a Dask cluster of separate processes."""

import os
import signal
from contextlib import contextmanager

import pytest

import armdyn as ad
from armdyn.errors import ClusterError, ProblemError
from armdyn.studies import dask_cluster as module
from armdyn.studies.dask_cluster import dask_executor
from armdyn.studies.rows import read_rows
from armdyn.studies.study import Axis, Study
from toys import Square, squares

STUDY = """
[arms.r]
q_start = [-1.5707963267948966]
q_goal = [0.15707963267948966]
[vary]
payload = { from = 0.05, to = 0.25, count = 6 }
reserve = { from = 0.0, to = 0.2, count = 4 }
"""


@pytest.fixture
def cluster():
    """Two workers, forked by a process that has imported their modules, as they are killed and started again."""
    import dask
    from distributed import LocalCluster
    from distributed.utils import get_mp_context

    with dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"}):
        get_mp_context().set_forkserver_preload(["distributed", "armdyn.studies.tasks.minimum_time"])
        with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50) as running:
            yield running


@pytest.mark.slow
def test_a_killed_worker_s_cases_are_done_by_another(cluster, tmp_path):
    killed = []

    def kill(progress):
        if progress.done >= 5 and not killed:
            killed.append(next(iter(cluster.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    (tmp_path / "study.toml").write_text(STUDY)
    study, executor = ad.read_study(tmp_path / "study.toml"), dask_executor(cluster.scheduler_address)
    run = ad.run_study(study, tmp_path / "s.sqlite", executor, kill)
    assert killed and run.counts == {"usable": 24}
    with read_rows(run.file) as rows:
        found = list(rows.rows())
    assert [row.k for row in found] == list(range(24)) and all(row.facts["certified"] for row in found)
    # The same as here without neighbours: certified to 1e-9, from any worker and any guesses.
    for k in (0, 11, 23):
        alone = ad.solve_minimum_time(study.task.problems.problem(study.parameters(k)))
        assert found[k].facts["duration_s"] == pytest.approx(alone.duration, rel=1e-8)


@pytest.mark.slow
def test_a_case_that_kills_every_worker_is_reported_in_its_row(cluster, tmp_path):
    study = squares(12, deadly=(1,), error=(2,))
    run = ad.run_study(study, tmp_path / "s.sqlite", dask_executor(cluster.scheduler_address))
    with read_rows(run.file) as rows:
        found = {row.k: row for row in rows.rows()}
    # The first time and Dask's allowed-failures, three; and the same alone.
    assert found[1].status == "worker_died" and found[1].attempts == 8
    assert found[2].status == "error" and found[2].message == "ZeroDivisionError: one over nothing"
    # None of the others is taken for one that kills, though Dask counts a death against all that a worker was given.
    assert all(row.status == "squared" for k, row in found.items() if k not in (1, 2)) and len(found) == 12


@pytest.mark.slow
def test_of_a_batch_only_the_killing_case_is_reported(cluster, tmp_path):
    study = squares(400, seconds=0.005, deadly=(250,))
    run = ad.run_study(study, tmp_path / "s.sqlite", dask_executor(cluster.scheduler_address))
    assert run.counts == {"squared": 399, "worker_died": 1}
    with read_rows(run.file) as rows:
        found = list(rows.rows())
    assert [row.k for row in found] == list(range(400)) and found[250].attempts == 8
    # Others of its batch were under way with it: their rows tell of more than one attempt.
    assert 1 < sum(row.attempts > 1 for row in found) < 400


@pytest.mark.slow
def test_a_neighbour_of_the_same_batch_is_a_guess(cluster, tmp_path):
    axis = Axis(name="x", low=0.0, high=299.0, count=300)
    study = Study(task=Square(neighbours="add", seconds=0.002), axes=(axis,))
    run = ad.run_study(study, tmp_path / "s.sqlite", dask_executor(cluster.scheduler_address))
    with read_rows(run.file) as rows:
        found = list(rows.rows())
    assert len(found) == 300 and all(row.facts["begun"] == row.begun_from for row in found)
    # Batches begin with the ready cases, 12 cases off at most, or with nothing; within a batch it is the case before.
    assert sum(row.begun_from == row.k - 1 for row in found) > 200


@pytest.mark.slow
def test_a_connection_that_breaks_is_made_again(cluster, tmp_path):
    crews, broken = [], []

    @contextmanager
    def watched(task):
        with dask_executor(cluster.scheduler_address)(task) as executor:
            crews.append(executor)
            yield executor

    def cut(progress):
        if progress.done >= 20 and not broken:
            broken.append(progress.done)
            client = crews[0]._client
            client.loop.add_callback(client.scheduler_comm.comm.abort)

    run = ad.run_study(squares(100, seconds=0.02), tmp_path / "s.sqlite", watched, cut)
    assert broken and run.counts == {"squared": 100}
    with read_rows(run.file) as rows:
        assert [row.k for row in rows.rows()] == list(range(100))


@pytest.mark.slow
def test_refused_if_it_cannot_be_reached(monkeypatch, tmp_path):
    from distributed import LocalCluster

    monkeypatch.setattr(module, "_TIMEOUT", 0.2)
    with pytest.raises(ClusterError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:1 "):
        ad.run_study(squares(2), tmp_path / "s.sqlite", dask_executor("127.0.0.1:1"))
    monkeypatch.setattr(module, "_TIMEOUT", 1.0)
    with (
        LocalCluster(n_workers=0, dashboard_address=None) as empty,
        pytest.raises(ClusterError, match="has no worker: start some"),
    ):
        ad.run_study(squares(2), tmp_path / "s.sqlite", dask_executor(empty.scheduler_address))


@pytest.mark.parametrize("address", ["", "node1", "node1:", ":8786", "node1:port", "node1:99999999"])
def test_an_address_is_host_and_port(address):
    with pytest.raises(ProblemError, match="write HOST:PORT"):
        dask_executor(address)
