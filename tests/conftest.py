"""Shared by all tests: settings of hypothesis, order of the tests, URDFs as text."""

import gc
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import settings

import armdyn as ad

# Before numpy is imported: matrices are small, and each thread of BLAS would wait for the other on a core of a worker.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Of the hundreds of processes that the tests spawn only the first compiles armdyn's modules, and only the first run
# rewrites the asserts of the tests.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Examples are the same in every run, and none is judged by the clock of a busy machine.
settings.register_profile("armdyn", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None, max_examples=1000)  # --hypothesis-profile=search: others, and more
settings.load_profile("armdyn")

# A script's background job, or nohup, ignores SIGINT, and so would all processes that the tests interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector):
    """Of two workers one reads the files from the last to the first: each compiles half of them in a fresh clone."""
    report = yield
    if os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:] in "13579" and isinstance(collector, pytest.Dir):
        report.result.reverse()
    return report


def pytest_collection_modifyitems(items):
    """Files with slow tests come first, so that no process is left with one in the end; all workers have one order."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: (item.path not in slow, item.path))


def pytest_collection_finish():
    """Collected tests stay to the end: garbage collection of them would take 6 % of the time.

    Objects of tests are collected less often than by default, which takes 1 %.
    """
    gc.freeze()
    gc.set_threshold(20_000)


@pytest.fixture
def file(tmp_path):
    """Writes a URDF, given as text, and gives its path."""

    def write(text):
        path = tmp_path / "arm.urdf"
        path.write_text(text)
        return path

    return write


@pytest.fixture
def read(file):
    """Reads a robot from a URDF, given as text."""

    def from_text(text, **options):
        return ad.Robot.from_urdf(file(text), **options)

    return from_text


@pytest.fixture
def write_problem(tmp_path, monkeypatch):
    """Writes a problem file, in a folder of its own that is the working folder, and gives its name."""
    (tmp_path / "home").mkdir()
    monkeypatch.chdir(tmp_path / "home")

    def put(text):
        Path("problem.toml").write_text(text)
        return "problem.toml"

    return put


@pytest.fixture(scope="session")
def chromium():
    """A browser for all tests of a process; each page has a profile of its own."""
    from show.browser import launched

    with launched() as browser:
        yield browser


@pytest.fixture
def unrendered():
    """Figures of the test are not rendered."""
    from undrawn import unrendered

    with unrendered():
        yield


@pytest.fixture
def tiny_disk(tmp_path):
    """A file system of 64 KiB, for users who may mount one."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(disk)]
    if subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("no file system can be mounted")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)
