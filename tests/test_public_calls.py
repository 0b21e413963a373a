"""Whatever a public call is given, it does its work or raises an `ArmdynError`: soon, in little memory, in few words.

Every argument is tried with values of other types, and with hostile ones of its own type.
"""

import inspect
import itertools
import re
import resource
import signal
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ArmdynError
from public_calls import functions, methods, values
from test_arguments import NONSENSE, NUMBERS

BOMB = [0.0]
for _ in range(40):
    BOMB = [BOMB, BOMB]
ENDLESS = (range(10**9), np.broadcast_to(0.0, 10**12), BOMB, b"a" * 10**8)
"""Numbers without end, that take no memory as long as nobody reads them."""
TEXTS = ("\ud800", "\0", "a" * 100_000, "a\nb", "/", b"x", 5)
BY_TYPE = {
    "float|Value|Vector": (True, "1", np.nan, np.inf, -1, 1e300, 10**5000, 5e-324),
    "int": (10**40, -10**40, 2.5, True, -1, 0),
    "bool": (1, None, "no", np.zeros(2)),
    "str|Form|Literal|Path|Rule|Index|Sync": TEXTS,
    "Array|tuple|Sequence|Iterable|Fraction": (*ENDLESS, np.zeros((2, 2, 2)), [[]], [np.zeros(2)], 5, "ab", [None]),
    "Sequence|Iterable|tuple": (range(10**9), itertools.repeat(None), ["\ud800"], ["a" * 100_000], [[]]),
    "Mapping|Values": ({"\ud800": 1.0}, {"a": "b"}, {None: None}, {"ramp": None}, [1], "ab"),
    "Callable": (1, "loud", b"x"),
}
"""Hostile values by what the annotation of an argument says."""
OTHERS = (None, 3, "x", True, ad.Loop(), ad.Robot, object())
"""Of other types than any argument's but a few."""


def junk(annotation):
    """What an argument of a type is tried with."""
    own = [value for kinds, some in BY_TYPE.items() if re.search(kinds, str(annotation)) for value in some]
    return (*NONSENSE, *OTHERS, *own)


class TooLong(BaseException):
    """No `except Exception` stops it."""


@contextmanager
def bounded(seconds, mebibytes):
    """At most so many seconds of this process' own work, and so much more memory."""

    def late(number, frame):
        raise TooLong(f"more than {seconds} s")

    before = signal.signal(signal.SIGPROF, late)
    Path("/proc/self/clear_refs").write_text("5")  # the highest resident size begins anew
    start = resident("VmRSS")
    limits = resource.getrlimit(resource.RLIMIT_AS)
    most = (resident("VmSize") + 1024 * 1024) * 1024  # or a call that fails would take the machine's memory
    resource.setrlimit(resource.RLIMIT_AS, (most, limits[1]))
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
        resource.setrlimit(resource.RLIMIT_AS, limits)
    assert resident("VmHWM") - start < mebibytes * 1024


def resident(name):
    """Of /proc/self/status [KiB]."""
    return int(re.search(rf"{name}:\s*(\d+)", Path("/proc/self/status").read_text())[1])
