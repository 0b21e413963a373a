"""Standard output as a command finds it: closed, without Unicode, with a reader that goes, full."""

import os
import subprocess
import sys

import pytest

from oracles import two_links

PLAIN_C = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
CODE = "from armdyn.cli import main; main()"


def shell(line, **environment):
    command = f'armdyn() {{ "{sys.executable}" -c "{CODE}" "$@"; }}; {line}'
    return subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, timeout=120, env=os.environ | environment
    )


@pytest.mark.slow
@pytest.mark.parametrize("command", ["--help", "presets", "urdf rr", "doctor panda --json"])
def test_a_reader_that_has_gone_is_no_error(command):
    done = shell(f"armdyn {command} | true; echo ${{PIPESTATUS[0]}}")
    assert (done.stdout, done.stderr) == ("0\n", "")


def test_closed_standard_output_is_named():
    done = shell("armdyn urdf rr >&-")
    assert done.returncode == 2
    assert done.stderr == "armdyn: standard output is closed; to discard it, send it to /dev/null\n"


@pytest.mark.slow
def test_closed_standard_error_disturbs_nothing():
    done = shell("armdyn urdf rr 2>&- <&-")
    assert done.returncode == 0 and done.stdout.rstrip().endswith("</robot>")
    assert shell("armdyn urdf rrrr 2>&-").returncode == 2


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is none")  # noqa: PTH110
@pytest.mark.parametrize("command", ["urdf rr", "presets", "presets --json", "robots --json", "--help"])
def test_full_standard_output_is_reported_once(command):
    done = shell(f"armdyn {command} > /dev/full")
    assert done.returncode == 5
    message = "armdyn: disk full while writing standard output; what was written before is whole"
    assert " ".join(done.stderr.split()) == message


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is none")  # noqa: PTH110
def test_full_standard_error_changes_no_exit_code():
    assert shell("armdyn urdf rrrr 2> /dev/full").returncode == 2


@pytest.mark.slow
@pytest.mark.parametrize("encoding", [{"PYTHONIOENCODING": "ascii"}, PLAIN_C])
def test_a_terminal_without_unicode_gets_escapes(encoding, tmp_path):
    (tmp_path / "arm.urdf").write_text(two_links().replace('robot name="', 'robot name="é蛇🦾', 1), "utf-8")
    done = shell(f"armdyn doctor '{tmp_path}/arm.urdf'", **encoding)
    assert done.returncode == 0 and not done.stderr
    assert r"\xe9\u86c7\U0001f9be" in done.stdout


@pytest.mark.slow
def test_robots_are_listed_in_ascii():
    done = shell("armdyn robots", PYTHONIOENCODING="ascii")
    assert done.returncode == 0 and "* of all joints, + of some, - of none" in " ".join(done.stdout.split())
