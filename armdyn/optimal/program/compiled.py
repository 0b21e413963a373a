"""Functions as machine code: C that CasADi writes, compiled once, kept on disk.

CasADi's virtual machine takes 10 to 15 times as long as the compiled code for an interval's Hessian.
A library is named after a hash of its source and of what compiles it, so that it fits or is not found,
and is put in its place whole, so that processes may build the same one at the same time.
"""

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import casadi as ca
import platformdirs

from armdyn.optimal.program.deadline import NoTimeError, left

_FLAGS = ("-O1", "-fPIC", "-shared", "-ffp-contract=off")
"""Level 1 has nearly all of the speed at half of level 2's build time; no contraction: the same numbers everywhere."""
_TIMEOUT = 300.0
"""For the compiler [s]."""
_WORTH_IT = 25_000
"""Instructions up to which a library is built unasked: about three seconds, once."""

_EACH = 2e-4
"""About how long the compiler takes for an instruction, with other work beside it [s]."""


def compiled(functions: Sequence[ca.Function], asked: bool | None = None) -> list[ca.Function]:
    """The same functions in machine code; they evaluate, and cannot be differentiated.

    Args:
        functions: without free variables, with different names.
        asked: False: as they are. True: compile them, however long it takes. None: use what is on disk, and
            compile small ones.

    Returns:
        As they are, too, where there is no C compiler, or it fails.

    Raises:
        NoTimeError: it would take, or has taken, longer than `deadline.until` allows.
    """
    functions = list(functions)
    compiler = shutil.which(os.environ.get("CC") or "cc") or shutil.which("gcc")
    if asked is False or compiler is None:
        return functions
    generator = ca.CodeGenerator("armdyn.c", {"with_header": False})
    for function in functions:
        generator.add(function)
    source = generator.dump()
    name = hashlib.sha256("\n".join((ca.CasadiMeta.version(), compiler, *_FLAGS, source)).encode()).hexdigest()[:32]
    library = cache_directory() / f"{name}.so"
    if not library.exists():
        if asked is None and sum(function.n_instructions() for function in functions) > _WORTH_IT:
            return functions
        # Half of the time is for the solve.
        if sum(function.n_instructions() for function in functions) * _EACH > left() / 2:
            raise NoTimeError
        if not _build(compiler, source, library):
            if left() <= 0:
                raise NoTimeError
            return functions
    return [ca.external(function.name(), str(library)) for function in functions]


def cache_directory() -> Path:
    """Where libraries are kept: `ARMDYN_CACHE`, or the user's cache directory."""
    return Path(os.environ.get("ARMDYN_CACHE") or platformdirs.user_cache_dir("armdyn"))


def _build(compiler: str, source: str, library: Path) -> bool:
    """Compile; whether it worked."""
    try:
        library.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryDirectory(dir=library.parent) as folder:
            text, built = Path(folder, "armdyn.c"), Path(folder, "armdyn.so")
            text.write_text(source)
            command = [compiler, *_FLAGS, "-o", str(built), str(text), "-lm"]
            # Our own text, no shell; the compiler is the one on the user's path.
            subprocess.run(command, check=True, capture_output=True, timeout=min(_TIMEOUT, left()))  # noqa: S603
            built.replace(library)
    except (OSError, subprocess.SubprocessError):
        return False
    return True
