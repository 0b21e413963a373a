"""Run the C compiler within bounds of time and memory."""

import os
import signal
import subprocess
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from armdyn.codegen.deadline import NoTimeError, left

FLAGS = ("-O1", "-fPIC", "-shared", "-ffp-contract=off")
"""Level 1 has nearly all of the speed at half of level 2's build time; no contraction: the same numbers everywhere."""
_TIMEOUT = 60.0
"""Longest run of the compiler [s]: six times that of a Panda's curves on an idle core."""
_MEMORY = 2**20
"""Address space of each of the compiler's processes [KiB], 1 GiB: twice that of a Panda's curves."""
_LIMITED = (
    f"ulimit -v {_MEMORY} 2>/dev/null; ulimit -t {_TIMEOUT:.0f}; "
    'exec 3<&0; (read -r _ <&3; kill -KILL 0) & exec "$@" </dev/null 3<&-'
)
"""The compiler's command line in sh. Its processes inherit the limits, the first where the system has it, unlike macOS.
Standard input is our pipe: when we end, it closes, and the compiler's whole process group is killed."""
_LOOK = 0.1
"""Polling period of the solve's stop while the compiler runs [s]."""

_hung: set[str] = set()
"""Compilers that exceeded the time limit: this process does not run them again."""


class CompilerError(Exception):
    """The library cannot be built, in this folder or another."""


def built(source: str, compiler: str, folder: Path) -> bytes:
    """Compile C to a shared library in a temporary folder within `folder`; the bytes of the library.

    Raises:
        OSError: there is no room, say.
        CompilerError: the compiler fails, or takes too long.
        NoTimeError: it takes longer than `deadline.until` allows.
    """
    if compiler in _hung:
        raise CompilerError(_too_long(compiler))
    with tempfile.TemporaryDirectory(prefix=".", dir=folder) as scratch:
        text, built, log_file = (Path(scratch, f"armdyn.{kind}") for kind in ("c", "so", "log"))
        text.write_text(source)
        command = [compiler, *FLAGS, "-o", str(built), str(text), "-lm"]
        with log_file.open("wb") as log:  # no pipe: a hanging compiler may have children, which would hold it
            # Our own text; the compiler is the one on the user's path.
            process = subprocess.Popen(  # noqa: S603
                ["/bin/sh", "-c", _LIMITED, "sh", *command],
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                cwd=scratch,
                process_group=0,
            )
            try:
                code = _exit_code(process, compiler)
            finally:
                with suppress(ProcessLookupError), process:  # which closes its standard input and waits for it
                    os.killpg(process.pid, signal.SIGKILL)  # with its children and the process that waits for us
        if code or not built.is_file():
            words = log_file.read_bytes()[:500].decode(errors="replace").replace(scratch, "").split("\n")[0]
            raise CompilerError(f"the C compiler, {compiler}, failed (exit {code}) {words}".strip())
        return built.read_bytes()


def _exit_code(process: "subprocess.Popen[bytes]", compiler: str) -> int:
    """Wait for the compiler within its time limit; returns its exit code.

    Raises:
        CompilerError: it takes too long.
        NoTimeError: it takes longer than `deadline.until` allows, or that was stopped.
    """
    latest = time.monotonic() + _TIMEOUT
    while True:
        with suppress(subprocess.TimeoutExpired):
            return process.wait(max(0.0, min(_LOOK, left(), latest - time.monotonic())))
        if left() <= 0:
            raise NoTimeError
        if time.monotonic() >= latest:
            _hung.add(compiler)
            raise CompilerError(_too_long(compiler))


def _too_long(compiler: str) -> str:
    return f"the C compiler, {compiler}, took longer than {_TIMEOUT:g} s"
