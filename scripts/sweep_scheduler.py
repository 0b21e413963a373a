"""Cost of the scheduler of a sweep: cases that do nothing, or sleep, with rows like those of real ones.

python scripts/sweep_scheduler.py --cases 100000
python scripts/sweep_scheduler.py --cases 100000 --cluster
"""

import argparse
import os
import tempfile
import time
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import armdyn as ad
from armdyn.studies.executor import local_executor
from armdyn.studies.study import Axis, Study
from armdyn.studies.tasks.task import CaseResult


@dataclass(frozen=True)
class Sleep:
    """A case that sleeps [s]; its row is as long as a fastest motion's, with a motion of a given size."""

    seconds: float
    motion: int = 0

    @property
    def neighbours(self):
        """Whether motions are sent to neighbours."""
        return "add" if self.motion else "off"

    def work(self, settings, guess, revisit=False):
        """Sleep."""
        if self.seconds:
            time.sleep(self.seconds)
        facts, motion = {f"fact_{i}": 0.123456789 for i in range(8)}, os.urandom(self.motion)
        return CaseResult(status="slept", good=True, message="x" * 70, facts=facts, motion=motion)

    def description(self):
        """The numbers of the rows."""
        return {"task": "sleep", "seconds": self.seconds, "motion": self.motion}


@contextmanager
def crews(cluster, workers):
    """Who works: processes of this machine, or a Dask cluster of as many."""
    if not cluster:
        yield partial(local_executor, workers=workers)
        return
    from distributed import LocalCluster

    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None, silence_logs=50) as running:
        yield ad.dask_executor(running.scheduler_address)


def main():
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--sleep", type=float, default=0.0, help="of each case [s]")
    parser.add_argument("--motion", type=int, default=0, help="kept of each case, and sent to its neighbours [bytes]")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--sync", choices=("full", "normal"), default="full")
    parser.add_argument("--cluster", action="store_true")
    parser.add_argument("--folder", type=Path, help="of the database; a temporary one by default")
    given = parser.parse_args()
    axis = Axis(name="payload", low=0.0, high=1.0)
    study = Study(task=Sleep(given.sleep, given.motion), axes=(axis,), method="random", count=given.cases)
    with tempfile.TemporaryDirectory(dir=given.folder) as folder, crews(given.cluster, given.workers) as executor:
        file = Path(folder) / "s.sqlite"
        run = ad.run_study(study, file, executor, sync=given.sync)
        size, again = file.stat().st_size, time.perf_counter()
        ad.run_study(study, file, executor, sync=given.sync)
        resumed = time.perf_counter() - again
    if run.counts != {"slept": given.cases}:
        raise SystemExit(f"rows are missing: {run.counts}")
    ideal = given.sleep * given.cases / given.workers
    print(f"{'Dask cluster' if given.cluster else 'processes'}, {given.workers} workers, sync {given.sync}")
    print(
        f"{given.cases} cases of {given.sleep:g} s: {run.seconds:.1f} s, {1e3 * run.seconds / given.cases:.3f} ms each"
    )
    print(f"besides their sleep: {1e3 * (run.seconds - ideal) / given.cases:.3f} ms each")
    print(
        f"database {size / 1e6:.1f} MB, {size / given.cases:.0f} bytes each; to find that all is done: {resumed:.2f} s"
    )


if __name__ == "__main__":
    main()
