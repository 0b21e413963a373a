"""Damaged libraries of the cache of machine code, and the outcomes."""

import contextlib
import ctypes
import multiprocessing
import os
import shutil
import subprocess
import tempfile
import warnings
from collections import Counter
from pathlib import Path

import casadi as ca
import numpy as np

from armdyn.codegen.compiled import compiled
from armdyn.errors import ArmdynWarning

SLICE, TIME = 500, 20  # how many in one process, and [s] that one may take


def _content(change):
    """A damage that leaves a file with other content."""

    def damage(path, whole, rng):
        path.write_bytes(change(whole, rng))

    damage.__name__ = change.__name__
    return damage


def empty(whole, rng):
    return b""


def noise(whole, rng):
    return rng.bytes(rng.choice((1, 31, 32, 33, 4096, len(whole))))


def cut(whole, rng):
    return whole[: rng.integers(len(whole))]


def beheaded(whole, rng):
    return whole[rng.integers(1, len(whole)) :]


def flip(whole, rng):
    changed = bytearray(whole)
    for _ in range(rng.choice((1, 3, 30))):
        changed[rng.integers(len(changed))] ^= 1 << rng.integers(8)
    return bytes(changed)


def zeros(whole, rng):
    """As a file system may leave after a crash."""
    start = rng.integers(len(whole) // 2)
    return whole[:start].ljust(len(whole), b"\0")


def longer(whole, rng):
    return whole + rng.bytes(rng.choice((1, 32, 10_000_000)))


def twice(whole, rng):
    return whole + whole


def unsealed(whole, rng):
    return whole[:-32]


def folder(path, whole, rng):
    path.mkdir()
    if rng.random() < 0.5:
        (path / "inside").write_bytes(whole)


def pipe(path, whole, rng):
    os.mkfifo(path)


def device(path, whole, rng):
    path.symlink_to(rng.choice(("/dev/zero", "/dev/random", "/dev/full", "/dev/tty")))


def dangling(path, whole, rng):
    path.symlink_to(rng.choice(("nowhere", path.name, "/nowhere/at/all")))


def link(path, whole, rng):
    """To a library that is whole, but anybody's."""
    other = path.parent.parent / path.name
    other.write_bytes(whole)
    path.symlink_to(other)


def endless(path, whole, rng):
    path.write_bytes(whole)
    os.truncate(path, 2**40)


def writable(path, whole, rng):
    path.write_bytes(whole)
    path.chmod(rng.choice((0o666, 0o622, 0o660, 0o602)))


DAMAGES = [
    *map(_content, (empty, noise, cut, beheaded, flip, zeros, longer, twice, unsealed)),
    folder, pipe, device, dangling, link, endless, writable,
]  # fmt: skip


def fuzz_cache(count: int, seed: int) -> Counter[str]:
    """Outcomes of a number of damaged libraries, by the kind of damage; those that begin with BAD must not occur."""
    found: Counter[str] = Counter()
    number, end = seed, seed + count
    while number < end:
        with tempfile.TemporaryDirectory() as place:
            ours, theirs = multiprocessing.Pipe(duplex=False)
            numbers = range(number, min(number + SLICE, end))
            worker = multiprocessing.get_context("fork").Process(target=_try, args=(numbers, Path(place), theirs))
            worker.start()
            theirs.close()
            with contextlib.suppress(EOFError):
                while ours.poll(TIME):
                    found[ours.recv()] += 1
                    number += 1
            worker.kill()  # hangs, or has ended
            worker.join()
        if number < numbers.stop:
            found[f"BAD: process ended by {worker.exitcode} at number {number}"] += 1
            number += 1
    return found


def _try(numbers, place, line):
    """Damage, compile and evaluate; one word for each number."""
    os.environ["ARMDYN_CACHE"] = str(place / "real")
    x = ca.SX.sym("x", 3)
    plain = ca.Function("f", [x], [ca.sin(x) * ca.sumsqr(x)])
    compiled([plain], True)
    (real,) = (place / "real").iterdir()
    (place / "real.so").write_bytes(real.read_bytes()[:-32])
    copier = place / "copier"  # a quick compiler: it has this one answer
    copier.write_text(f'#!/bin/sh\nwhile [ "$1" != -o ]; do shift; done\ncp {place}/real.so "$2"\n')
    copier.chmod(0o700)
    os.environ |= {"ARMDYN_CACHE": str(place / "cache"), "CC": str(copier)}
    compiled([plain], True)
    (library,) = (place / "cache").iterdir()
    whole, expected = library.read_bytes(), float(plain([1, 2, 3])[0])
    for number in numbers:
        rng = np.random.default_rng(number)
        shutil.rmtree(library) if library.is_dir() else library.unlink()
        damage = DAMAGES[rng.integers(len(DAMAGES))]
        damage(library, whole, rng)
        before = library.lstat()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", ArmdynWarning)
                (fast,) = compiled([plain], True)
            after = library.lstat()
            same = (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
            right = float(fast([1, 2, 3])[0]) == expected and library.read_bytes() == whole and not same
            line.send(f"{damage.__name__}: built again" if right else f"BAD: {damage.__name__}: wrong, or as it was")
        except BaseException as error:
            line.send(f"BAD: {damage.__name__}: {type(error).__name__}: {error}")


def planted(place: Path) -> tuple[bytes, Path]:
    """A library that leaves a trace when it is loaded, and where."""
    trace, text, built = place / "trace", place / "planted.c", place / "planted.so"
    text.write_text(
        f'#include <fcntl.h>\n__attribute__((constructor)) static void run(void) {{ creat("{trace}", 0600); }}\n'
    )
    subprocess.run(["cc", "-fPIC", "-shared", "-o", built, text], check=True)
    ctypes.CDLL(built)
    trace.unlink()  # it does
    return built.read_bytes(), trace
