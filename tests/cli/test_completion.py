"""Shell completion installs for bash, zsh and fish, and completes."""

import os
import pty
import re
import select
import shutil
import subprocess
import sys
import time

import pytest

LONG = 60.0
"""Time limit of a shell that waits for `armdyn` to be imported [s]."""


@pytest.fixture
def home(tmp_path):
    """A home without anything, and an `armdyn` on its PATH."""
    script = tmp_path / "bin" / "armdyn"
    script.parent.mkdir()
    script.write_text(f"#!{sys.executable}\nfrom armdyn.cli import main\nmain()\n")
    script.chmod(0o755)
    more = {"HOME": str(tmp_path), "PATH": f"{script.parent}:{os.environ['PATH']}", "TERM": "xterm"}
    return {name: value for name, value in os.environ.items() if not name.startswith("XDG_")} | more


def install(shell, home):
    """Output of `armdyn --install-completion` within a shell."""
    # A command after it, or the shell would become the command, which then finds no shell above it.
    command = [shell, "-c", "armdyn --install-completion; exit 0"]
    return subprocess.run(command, env=home, capture_output=True, text=True, timeout=LONG)


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("bash"), reason="needs bash")
def test_completion_installs_for_bash_and_works(home, tmp_path):
    bash = ["bash", "--norc", "-c"]
    # A command after it, or bash would become the command, which then finds no shell above it.
    done = subprocess.run(
        [*bash, "armdyn --install-completion; exit $?"], env=home, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert "bash_completions/armdyn.sh" in (tmp_path / ".bashrc").read_text()
    command = (
        'source "$HOME/.bashrc"; COMP_WORDS=({}); COMP_CWORD={}; _armdyn_completion armdyn; echo "${{COMPREPLY[@]}}"'
    )
    for words, number, expected in (
        ("armdyn mint", 1, {"mintime"}),
        ("armdyn mintime --q-s", 2, {"--q-start"}),
        ("armdyn mintime ur1", 2, {"ur10", "ur10_limited"}),
    ):
        done = subprocess.run(
            [*bash, command.format(words, number)], env=home, capture_output=True, text=True, timeout=120
        )
        assert set(done.stdout.split()) == expected, (words, done.stdout, done.stderr)


@pytest.mark.skipif(not shutil.which("fish"), reason="needs fish")
def test_fish(home):
    done = install("fish", home)
    assert "fish completion installed" in done.stdout, done.stderr
    for words, expected in (
        ("armdyn mint", {"mintime"}),
        ("armdyn mintime --q-s", {"--q-start"}),
        ("armdyn mintime ur1", {"ur10", "ur10_limited"}),
    ):
        shown = subprocess.run(
            ["fish", "-c", f"complete -C '{words}'"], env=home, capture_output=True, text=True, timeout=LONG
        )
        assert {line.split("\t")[0] for line in shown.stdout.splitlines()} == expected, shown.stderr


def typed(keys, env, wanted):
    """Output of an interactive zsh after keys typed at its prompt, without cursor movements."""
    ours, theirs = pty.openpty()
    shell = subprocess.Popen(["zsh", "-i"], stdin=theirs, stdout=theirs, stderr=theirs, env=env, start_new_session=True)
    os.close(theirs)
    shown, sent, end = "", False, time.monotonic() + LONG
    try:
        while wanted not in shown and time.monotonic() < end:
            if select.select([ours], [], [], 0.1)[0]:
                text = os.read(ours, 4096).decode(errors="replace")
                shown += re.sub(r"\x1b\[[0-9;?]*[A-Za-z]|\x1b[=>]|[\x07\r]", "", text)
            if not sent and "READY> " in shown:
                os.write(ours, keys.encode())
                sent = True
    finally:
        shell.kill()
        shell.wait()
        os.close(ours)
    return shown


@pytest.mark.skipif(not shutil.which("zsh"), reason="needs zsh")
def test_zsh(home):
    done = install("zsh", home)
    assert "zsh completion installed" in done.stdout, done.stderr
    # The first Tab of a session loads the function, the second completes.
    assert "mintime" in typed("armdyn mint\t\t", home | {"PS1": "READY> "}, "mintime")
