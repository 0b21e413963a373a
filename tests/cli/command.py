"""The command line as the tests run it: in a process of its own, as a user does, or here, which takes no start."""

import contextlib
import json
import subprocess
import sys
from pathlib import Path

from typer.testing import CliRunner

from armdyn.cli.app import application

app = application()
COMMAND = [sys.executable, "-m", "armdyn"]


def run(*arguments, cwd=None):
    """The process that has ended: `returncode`, `stdout`, `stderr`."""
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, cwd=cwd, timeout=300)


def run_here(*arguments, cwd=None):
    """The same without a process; uncaught exceptions are raised."""
    with contextlib.chdir(cwd or Path.cwd()):
        done = CliRunner().invoke(app, [str(each) for each in arguments], prog_name="armdyn")
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    return subprocess.CompletedProcess(arguments, done.exit_code, done.stdout, done.stderr)


def answer(done, code=0):
    """The printed JSON: one object and nothing else."""
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return json.loads(done.stdout)


def run_json(*arguments, code=0, cwd=None, how=run_here):
    """The JSON of a command with `--json`; with `how=run` in a process of its own."""
    return answer(how(*arguments, "--json", cwd=cwd), code)
