"""With any arguments a public call works or raises an `ArmdynError`: soon, in little memory, in few words.

Every argument is tried with values of other types, and with hostile ones of its own type.
"""

import inspect
import itertools
import os
import re
import resource
import signal
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import armdyn as ad
from armdyn.arguments import shown
from armdyn.errors import ArmdynError
from public_calls import LOOP, NONSENSE, functions, methods, values

BOMB = [0.0]
for _ in range(40):
    BOMB = [BOMB, BOMB]
ENDLESS = (range(10**9), np.broadcast_to(0.0, 10**12), BOMB, b"a" * 10**8)
"""Numbers without end, that take no memory until they are read."""
TEXTS = ("\ud800", "\0", "a" * 100_000, "a\nb", "/", b"x", 5)
BY_TYPE = {
    "float|Value|Vector": (True, "1", np.nan, np.inf, -1, 1e300, 10**5000, 5e-324),
    "int": (10**40, -(10**40), 2.5, True, -1, 0),
    "bool": (1, None, "no", np.zeros(2)),
    "str|Form|Literal|Path|Rule|Index|Sync": TEXTS,
    "Array|tuple|Sequence|Iterable|Fraction": (*ENDLESS, np.zeros((2, 2, 2)), [[]], [np.zeros(2)], 5, "ab", [None]),
    "Sequence|Iterable|tuple": (range(10**9), itertools.repeat(None), ["\ud800"], ["a" * 100_000], [[]]),
    "Mapping|Values": ({"\ud800": 1.0}, {"a": "b"}, {None: None}, {"ramp": None}, [1], "ab"),
}
"""Hostile values by the annotation of an argument."""
OTHERS = (None, 3, "x", True, LOOP, ad.Robot, object())
"""Of other types than any argument's but a few."""


ALIASES = {"address": "scheduler", "text": "^it: ", "placement": "pose", "trajectory": "motion", "joints": "passive"}
ALIASES |= {
    "ki": "gains",
    "name": "no frame|no pose",
    "duration": "samples|motion cannot be started",
    "frame": "frame|dwell",
    "values": "--limit",
}
"""Other names of arguments in messages; of a file or a name its value is enough."""
RESULTS = {
    ad.MotionProgram,
    *(
        ad.ControllerCheck,
        ad.ControllerPreset,
        ad.Arc,
        ad.Certificate,
        ad.CycleCost,
        ad.CycleSolution,
        ad.GainPlane,
        ad.Estimate,
        ad.LowerBound,
        ad.Margins,
        ad.MonteCarlo,
        ad.ReserveCurve,
    ),
    *(ad.RouthTable, ad.Run, ad.Sample, ad.SampledLoop, ad.SampledStability, ad.Samples, ad.Scene, ad.Sensitivities),
    *(
        ad.LogError,
        ad.Solution,
        ad.TimeOptimality,
        ad.Tuned,
        ad.Status,
        ad.ArmdynError,
        ad.ArmdynWarning,
        ad.ContactError,
        ad.CycleError,
    ),
}
"""Made by armdyn alone, of numbers that it has checked."""
INNER = {
    *(
        "along",
        "from_problem",
        "at_goal",
        "bounded",
        "check",
        "required_distances",
        "same_place",
        "derivative_limit",
        "ends_within",
        "fits",
        "from_table",
        "least_duration",
        "of",
        "of_option",
        "on",
    ),
    *(
        "report",
        "rows",
        "tightened",
        "torque_rate_limit",
        "values",
        "with_stability",
        "with_effort",
        "without",
        "without_motors",
    ),
    "from_description",  # takes a package, and the internet
    "from_table",  # of a file that was read
}
"""Methods that the pipeline calls with its own values."""


def junk(annotation):
    """Values tried for an argument of a type; a function of the user's may do anything."""
    own = [value for kinds, some in BY_TYPE.items() if re.search(kinds, str(annotation)) for value in some]
    right = callable if "Callable" in str(annotation) else lambda value: False
    return [value for value in (*NONSENSE, *OTHERS, *own) if not right(value)]


SECONDS, MEBIBYTES, LONGEST = 5.0, 256, 1500
"""That a call may take at most, of time and more memory, and characters of its message; most take a thousandth."""


class TooLong(BaseException):
    """No `except Exception` stops it."""


@contextmanager
def soon():
    """No more of this process' own work than may be."""

    def late(number, frame):
        raise TooLong(f"more than {SECONDS} s")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


@contextmanager
def little_memory(wrong, where):
    """Adds a fault if more memory was used than allowed; four times as much is the hard limit."""
    Path("/proc/self/clear_refs").write_text("5")  # the highest resident size begins anew
    start, limits = resident("VmRSS"), resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, ((resident("VmSize") + 4096 * MEBIBYTES) * 1024, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limits)
    if resident("VmHWM") - start > 1024 * MEBIBYTES:
        wrong.append(f"{where}: more than {MEBIBYTES} MiB")


def resident(name):
    """Of /proc/self/status [KiB]."""
    return int(re.search(rf"{name}:\s*(\d+)", Path("/proc/self/status").read_text())[1])


@pytest.fixture(scope="module")
def calls(tmp_path_factory):
    """The three tables, in a folder of their own."""
    folder = tmp_path_factory.mktemp("calls")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield {"values": values(), "functions": functions(folder), "methods": methods(folder)}


def test_every_public_call_is_tried(calls):
    there = {getattr(call, "__func__", call) for table in calls.values() for call in table}
    for name, made in ((name, getattr(ad, name)) for name in ad.__all__):
        assert not callable(made) or made in there | RESULTS, name
        own = inspect.isclass(made) and not issubclass(made, str | tuple | Exception)
        for within, method in inspect.getmembers(made, inspect.isroutine) if own else ():
            function = getattr(method, "__func__", method)
            if not callable(function):  # a cached property
                continue
            if not (within.startswith("_") or within in INNER or len(inspect.signature(function).parameters) < 2):
                assert function in there, f"{name}.{within}"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("table", ["values", "functions", "methods"])
def test_with_any_arguments_it_works_or_reports_the_fault(table, calls):
    wrong = []
    for call, right in calls[table].items():
        call(**right)
        annotations = {name: one.annotation for name, one in inspect.signature(call).parameters.items()}
        annotations |= ad.RobotOptions.__annotations__ if "keywords" in annotations else {}
        for name in right:
            where = f"{call.__qualname__}({name})"
            with little_memory(wrong, where):
                for value in junk(annotations.get(name, "float")):
                    why = "" if value is right[name] else what_is_wrong(call, right, name, value)
                    wrong += [f"{where}, {shown(value)}: {why}"] if why else []
    assert not wrong, "\n".join(wrong)


def what_is_wrong(call, right, name, value):
    """With a value for one argument; empty if nothing is."""
    words = "|".join([*name.split("_"), ALIASES.get(name, name)])
    try:
        with np.errstate(all="ignore"), soon():
            call(**right | {name: value})
    except ArmdynError as error:
        message = str(error)
        message.encode()
        if not 0 < len(message) <= LONGEST:
            return f"a message of {len(message)} characters"
        said = os.fsdecode(value[:99]) or "." if isinstance(value, str | bytes) else None
        named = re.search(words, message, re.IGNORECASE) or (said is not None and said in message)
        return "" if named else f"does not name it: {message}"
    except (Exception, TooLong) as error:
        return f"{type(error).__name__}: {str(error)[:200]}"
    return ""
