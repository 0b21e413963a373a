"""Functions as machine code: C that CasADi writes, compiled once, kept on disk.

CasADi's virtual machine takes 10 to 15 times as long as the compiled code for an interval's Hessian.
A library is named after a hash of its source and of what compiles it, so that it fits or is not found. It is put in
its place whole, so that processes may build the same one at the same time, and under a checksum.

What is loaded is a copy of the very bytes that the checksum was compared with, under a name that nobody can foresee
and that is gone at once: nothing that happens to the library meanwhile or later reaches this process.
"""

import ctypes
import hashlib
import os
import platform
import shutil
import tempfile
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import casadi as ca

from armdyn.codegen.background import build_later
from armdyn.codegen.cache import cache_directory, private_folder, protected
from armdyn.codegen.compiler import FLAGS, CompilerError, built
from armdyn.codegen.deadline import NoTimeError, left
from armdyn.errors import ArmdynWarning
from armdyn.files import read_sealed, write_sealed

T = TypeVar("T")

_WORTH_IT = 30_000
"""Instructions up to which a library is built unasked: about three seconds, once."""
_LARGEST = 2**28
"""A library that is read [bytes]: hundreds of times what an arm's takes."""

_told: set[str] = set()
"""What this process was warned of."""

_EACH = 2e-4
"""About how long the compiler takes for an instruction, with other work beside it [s]."""


def compiled(
    functions: Sequence[ca.Function], compile_mode: bool | None = None, later: bool = False
) -> list[ca.Function]:
    """The same functions in machine code; they evaluate, and cannot be differentiated.

    Args:
        functions: without free variables, with different names.
        compile_mode: False: as they are. True: compile them, however long it takes. None: use what is on disk, and
            compile small ones; large ones are built in the background. What is on disk but damaged is compiled again.
        later: with None: small ones are built in the background, too.

    Returns:
        As they are, too, where there is no C compiler, or it fails, or there is no place to build.

    Warns:
        ArmdynWarning: the cache cannot be used or is not this user's alone, or the compiler fails; once per process.

    Raises:
        SettingError: `ARMDYN_CACHE` is no absolute path.
        NoTimeError: to compile would take, or has taken, longer than `deadline.until` allows.
    """
    functions = list(functions)
    compiler = _compiler()
    if compile_mode is False or compiler is None:
        return functions
    generator = ca.CodeGenerator("armdyn.c", {"with_header": False})
    for function in functions:
        generator.add(function)

    def loaded(library: str) -> list[ca.Function]:
        return [ca.external(function.name(), library) for function in functions]

    size = sum(function.n_instructions() for function in functions)
    return _had(_Recipe.of(compiler, generator.dump(), size, loaded), compile_mode, later) or functions


def compiled_library(source: str, instructions: int, compile_mode: bool | None = None) -> ctypes.CDLL | None:
    """A library of C as `compiled` makes one of functions.

    Args:
        source: in C.
        instructions: about how many, by which it is decided whether to build it unasked.
        compile_mode: as for `compiled`.

    Returns:
        None: what `compiled` leaves as it is.
    """

    def loaded(library: str) -> ctypes.CDLL:
        try:
            return ctypes.CDLL(library)
        except OSError as error:
            raise RuntimeError(str(error)) from error

    compiler = _compiler()
    if compile_mode is False or compiler is None:
        return None
    return _had(_Recipe.of(compiler, source, instructions, loaded), compile_mode)


def _compiler() -> str | None:
    """Its path."""
    return shutil.which(os.environ.get("CC") or "cc") or shutil.which("gcc")


def _had(recipe: "_Recipe[T]", compile_mode: bool | None, later: bool = False) -> T | None:
    """What a recipe makes; None: go on without."""
    build = bool(compile_mode) or (recipe.instructions <= _WORTH_IT and not later)
    later = not build
    kept = cache_directory()
    try:
        try:
            return _machine_code(recipe, protected(kept), build, later)
        except OSError as error:
            _warn_once(f"the cache of machine code, {kept}, is not used (ARMDYN_CACHE may name another)", error)
        with private_folder() as folder:  # not kept: a process needs each library once
            return _machine_code(recipe, folder, build)
    except (OSError, CompilerError) as error:
        _warn_once("solving without machine code, which takes several times as long", error)
        return None


@dataclass(frozen=True)
class _Recipe(Generic[T]):
    """What a library is made from.

    Attributes:
        source: in C.
        compiler: its path.
        library: the file's name.
        instructions: of the source, about.
        loaded: what to make of a library's path; raises RuntimeError where it cannot be loaded.
    """

    source: str
    compiler: str
    library: str
    instructions: int
    loaded: Callable[[str], T]

    @classmethod
    def of(cls, compiler: str, source: str, instructions: int, loaded: Callable[[str], T]) -> "_Recipe[T]":
        made_by = (ca.CasadiMeta.version(), platform.machine(), compiler, *FLAGS, source)
        name = hashlib.sha256("\n".join(made_by).encode()).hexdigest()[:32] + ".so"
        return cls(source, compiler, name, instructions, loaded)

    def load(self, data: bytes, folder: Path) -> T:
        """From a library's bytes."""
        handle, copy = tempfile.mkstemp(".so", ".", folder)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            return self.loaded(copy)
        finally:
            Path(copy).unlink()  # it lives on as long as it is used


def _machine_code(recipe: _Recipe[T], folder: Path, build: bool, later: bool = False) -> T | None:
    """What the folder's library holds, which is built where it is damaged, or missing and wanted; None: not yet.

    Raises:
        OSError: the folder will not do: it is full, say, or nothing in it can be loaded.
        CompilerError: there is no library to be had.
    """
    library = folder / recipe.library
    there = os.path.lexists(library)
    data = read_sealed(library, _LARGEST)
    if data is not None:
        with suppress(RuntimeError):  # whole, but not for this system: a home that several share
            return recipe.load(data, folder)
    if not (there or build):
        if later:
            build_later(library, recipe.compiler, recipe.source)
        return None
    if recipe.instructions * _EACH > left() / 2:  # half of the time is for the solve
        raise NoTimeError
    data = built(recipe.source, recipe.compiler, folder)
    try:
        fast = recipe.load(data, folder)
    except RuntimeError as error:
        raise OSError(f"what {recipe.compiler} built in {folder} cannot be loaded") from error
    if library.is_dir() and not library.is_symlink():
        shutil.rmtree(library)  # a file cannot be put in a folder's place
    write_sealed(library, data)
    return fast


def _warn_once(what: str, why: Exception) -> None:
    """Say something that a process is told once, whatever the reason is the next time."""
    if what not in _told:
        warnings.warn(f"{what}: {getattr(why, 'strerror', None) or why}", ArmdynWarning, stacklevel=3)
        _told.add(what)
