"""Ctrl-C at any moment: exit code 130 and one line, or the command has ended before."""

import json
import signal
import subprocess
import sys
import time

import pytest

from cycles import BOLT

MARK = "here\n"
BEGIN = f"import sys; from armdyn.cli import main; sys.stderr.write({MARK!r}); sys.stderr.flush(); main()"
"""The command line, which prints when it has started. The time before is Python's own start, but for some 4 ms."""

AT_IMPORT = """
import importlib.abc, os, signal, sys
class Press(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Press())
sys.argv[1:] = {arguments!r}
from armdyn.cli import main
main()
"""
"""Presses Ctrl-C when a module begins to be imported."""

AT_CALL = """
import os, signal, sys
from armdyn import models
sys.argv[1:] = ["doctor", "rr"]
def press(*_, **__):
    os.kill(os.getpid(), signal.SIGINT)
    {then}
models.Robot.from_source = press
from armdyn.cli import main
main()
"""


BESIDE_A_CALL = """
import contextlib, os, signal, sys
from armdyn.cli import interrupts, main
enter = contextlib._GeneratorContextManager.__enter__
def press(self):
    found = enter(self)
    if interrupts._State.working and not interrupts._State.pressed:
        os.kill(os.getpid(), signal.SIGINT)
    return found
contextlib._GeneratorContextManager.__enter__ = press
main()
"""
"""Presses Ctrl-C between the console's code, which would answer it, and the command's own."""


def python(code, *arguments):
    return subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=120)


def ends_in_a_line(done):
    assert done.returncode == 130, done.stderr
    assert done.stderr == "armdyn: interrupted; nothing is saved\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "arguments"),
    [
        ("armdyn.cli.app", []),
        ("typer", ["robots"]),
        ("rich.table", ["presets"]),
        ("numpy", ["presets"]),
        ("pinocchio", ["doctor", "rr"]),
        ("casadi", ["doctor", "rr"]),
        ("armdyn.optimal", ["mintime", "rr"]),
        ("yourdfpy", ["urdf", "rr"]),
    ],
)
def test_within_an_import(module, arguments, tmp_path, monkeypatch):
    monkeypatch.setenv("ARMDYN_CACHE", str(tmp_path))  # which may have the arm of rr
    ends_in_a_line(python(AT_IMPORT.format(module=module, arguments=arguments)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "options"), [("armdyn.show.plots", []), ("armdyn.show.page.motions", ["--no-figure"])]
)
def test_a_motion_that_is_saved_is_said_to_be_where_drawings_are_not_made(module, options, tmp_path):
    command = ["pid", "r", "--duration", "5", *options, "--out", str(tmp_path / 'a "b"')]
    done = python(AT_IMPORT.format(module=module, arguments=command))
    assert done.returncode == 130 and (tmp_path / 'a "b"' / "trajectory.npz").exists()
    assert done.stderr == f'armdyn: interrupted; the motion is saved in {tmp_path}/a "b"\n'
    done = python(AT_IMPORT.format(module=module, arguments=[*command, "--json"]))
    assert json.loads(done.stdout)["message"] == f'interrupted; the motion is saved in {tmp_path}/a "b"'


def test_within_an_import_for_a_machine():
    done = python(AT_IMPORT.format(module="numpy", arguments=["robots", "--json"]))
    ends_in_a_line(done)
    ended = {"success": False, "status": "interrupted", "message": "interrupted; nothing is saved", "warnings": []}
    assert json.loads(done.stdout) == {"schema": "armdyn-json-1", "command": "", **ended}


@pytest.mark.slow
@pytest.mark.parametrize("then", ["pass", "while True: pass"])
def test_within_a_command(then):
    ends_in_a_line(python(AT_CALL.format(then=then)))


@pytest.mark.slow
def test_swallowed_by_someone_else():
    then = (
        "\n    try:\n        while True: pass\n    except KeyboardInterrupt:\n        raise ImportError('half of it')"
    )
    ends_in_a_line(python(AT_CALL.format(then=then)))


def test_while_an_object_is_deleted():
    then = "type('Deaf', (), {'__del__': lambda self: os.kill(os.getpid(), signal.SIGINT)})()\n    while True: pass"
    ends_in_a_line(python(AT_CALL.replace("os.kill(os.getpid(), signal.SIGINT)\n    ", "").format(then=then)))


def test_once_it_is_done_nothing_is_to_be_interrupted():
    late = "import atexit, os, signal, sys; sys.argv[1:] = ['--version']\n"
    late += "atexit.register(os.kill, os.getpid(), signal.SIGINT)\nfrom armdyn.cli import main; main()"
    done = python(late)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_job_in_the_background_hears_nothing():
    ignored = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
    done = python(ignored + AT_IMPORT.format(module="typer", arguments=["--version"]))
    assert done.returncode == 0 and done.stdout.startswith("armdyn ")


@pytest.mark.slow
def test_a_line_names_the_step_being_finished():
    then = "from armdyn.cli.console import working\n    from armdyn.optimal.problem.status import stopping"
    then += "\n    import time"
    then += "\n    with working('the motion'), stopping(60):\n        press_again()\n        time.sleep(1.0)"
    press = "press_again = lambda: os.kill(os.getpid(), signal.SIGINT)\nmodels.Robot.from_source"
    code = AT_CALL.replace("    os.kill(os.getpid(), signal.SIGINT)\n", "").replace("models.Robot.from_source", press)
    done = python(code.format(then=then))
    line = "armdyn: interrupted; still finishing the motion (Ctrl-C again ends it at once)\n"
    assert done.stderr.startswith(line)


def test_a_second_one_ends_code_without_signals():
    then = "import ctypes, subprocess\n    from armdyn.optimal.problem.status import stopping\n    with stopping(60):"
    then += "\n        signal.pthread_sigmask(signal.SIG_BLOCK, {{signal.SIGINT}})  # of the main thread alone"
    then += "\n        again = f'for k in 1 2; do sleep 0.5; kill -INT {os.getpid()}; done'"
    then += "\n        subprocess.Popen(['sh', '-c', again])\n        ctypes.CDLL(None).sleep(100)"
    then = then.replace("{{", "{").replace("}}", "}")
    code = AT_CALL.replace("    os.kill(os.getpid(), signal.SIGINT)\n", "")
    done = python(code.format(then=then))
    assert done.returncode == 130 and done.stderr.endswith("armdyn: interrupted; nothing is saved\n")


@pytest.mark.slow
def test_the_suite_hears_ctrl_c_also_where_it_is_ignored_by_inheritance():
    own = f"{__file__}::test_within_an_import_for_a_machine"
    command = ["sh", "-c", 'trap "" INT; exec "$@"', "sh", sys.executable, "-m", "pytest", "-q", "-n", "0", own]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_between_two_lines_of_code():
    ends_in_a_line(python(BESIDE_A_CALL, "presets"))
    done = python(BESIDE_A_CALL, "presets", "--json")
    assert done.returncode == 130 and json.loads(done.stdout)["status"] == "interrupted"


@pytest.mark.slow
@pytest.mark.parametrize(("arguments", "moments"), [(["doctor", "panda"], 20), (["--help"], 10)], ids=str)
def test_at_many_moments(arguments, moments):
    begun = time.perf_counter()
    python(BEGIN, *arguments)
    whole = time.perf_counter() - begun
    for k in range(1, moments + 1):
        command = subprocess.Popen(
            [sys.executable, "-c", BEGIN, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert command.stderr.readline() == MARK
        time.sleep(whole * k / moments)
        command.send_signal(signal.SIGINT)
        _, said = command.communicate(timeout=120)
        assert (command.returncode, said) in ((130, "armdyn: interrupted; nothing is saved\n"), (0, ""))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "module"),
    [
        (["cycle", "bolt.toml", "--costs"], "armdyn.cycle.costs"),
        (
            [
                "mintime",
                "ur5",
                "--q-start",
                "0,-1.2,1.5,-1.9,-1.5,0",
                "--q-goal",
                "1.2,-1,1.3,-1.9,-1.5,0",
                "--preset",
                "ur5",
            ],
            "armdyn.studies.preset_costs",
        ),
    ],
    ids=["cycle", "mintime"],
)
def test_while_conditions_cost_is_computed_keeps_the_motion(tmp_path, arguments, module):
    (tmp_path / "bolt.toml").write_text(BOLT)
    arguments = [str(tmp_path / one) if one == "bolt.toml" else one for one in arguments]
    code = f"""
import os, signal, sys, threading, {module} as costs
solve = costs.solve_minimum_time
def pressed(*a):
    threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGINT)).start()
    return solve(*a)
costs.solve_minimum_time = pressed
sys.argv[1:] = {[*arguments, "--json", "--no-report", "--no-figure", "--out", str(tmp_path / "out")]!r}
from armdyn.cli import main; main()
"""
    done = python(code)
    facts = json.loads(done.stdout)
    assert (done.returncode, facts["status"], facts["usable"]) == (130, "interrupted", True), done.stderr
    assert facts["message"].startswith("interrupted after the motion was found")
    assert (tmp_path / "out" / "trajectory.npz").exists()
    assert json.loads((tmp_path / "out" / "result.json").read_text())["status"] == "interrupted"


PRESSED = """
import os, signal, sys
from armdyn.cli import main
from armdyn.studies.tuning.tune import GainSearch
sys.argv = ["armdyn", *sys.argv[1:]]
plain = GainSearch.go
def go(*arguments):
    status = "generations" if {late} else None
    status = plain(*arguments) if status else status
    os.kill(os.getpid(), signal.SIGINT)
    return status or plain(*arguments)
GainSearch.go = go
main()
"""
"""`armdyn tune` with Ctrl-C before its search, or after it."""


@pytest.mark.slow
@pytest.mark.parametrize("late", [False, True])
def test_tune_is_interrupted_before_and_after_its_search(late, tmp_path):
    """It had exit code 2 where no controller had been run, and 0 where all had."""
    few = ["--generations", "1", "--members", "2", "--held-out", "2", "--duration", "0.3"]
    done = python(PRESSED.format(late=late), "tune", "r", *few, "--json", "--out", str(tmp_path))
    facts = json.loads(done.stdout)
    assert (done.returncode, facts["status"], facts["success"]) == (130, "interrupted", False), done.stderr
    assert facts["message"].endswith(f"controllers that were run are in {tmp_path}: the same command goes on")
