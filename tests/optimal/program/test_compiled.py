"""Machine code is the same functions, built once, and never needed."""

import shutil
import time
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

from armdyn.dynamics import Dynamics
from armdyn.optimal.program.assembly import build_nlp
from armdyn.optimal.program.compiled import cache_directory, compiled
from armdyn.optimal.program.deadline import NoTimeError, until
from armdyn.optimal.task.scheme import Scheme
from problems import paper_arm

needs_compiler = pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("ARMDYN_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def function(n=3):
    x = ca.SX.sym("x", n)
    return ca.Function("f", [x], [ca.sin(x) * ca.sumsqr(x)])


@needs_compiler
def test_same_numbers_and_one_library(own_cache):
    plain = function()
    for _ in range(2):
        (fast,) = compiled([plain], True)
        assert fast.class_name() == "External"
        x = np.random.default_rng(0).normal(size=3)
        np.testing.assert_allclose(np.array(fast(x)), np.array(plain(x)), rtol=1e-15)  # an ulp of sin
    assert len(list(own_cache.iterdir())) == 1  # no source, no half-built file


@needs_compiler
def test_several_at_once_build_one_library(own_cache):
    with ThreadPoolExecutor(4) as pool:
        made = list(pool.map(lambda _: compiled([function()], True)[0], range(4)))
    assert {float(f([1, 2, 3])[0]) for f in made} == {float(function()([1, 2, 3])[0])}
    assert len(list(own_cache.iterdir())) == 1


def test_virtual_machine_where_asked_or_where_there_is_no_compiler(own_cache, monkeypatch):
    plain = function()
    assert compiled([plain], False) == [plain]
    monkeypatch.setenv("PATH", str(own_cache))
    assert compiled([plain], True) == [plain]


@needs_compiler
def test_compiler_that_fails_is_done_without(own_cache, monkeypatch):
    monkeypatch.setenv("CC", "false")
    plain = function()
    assert compiled([plain], True) == [plain]
    assert not any(own_cache.iterdir())


@needs_compiler
def test_large_functions_are_not_built_unasked(monkeypatch):
    monkeypatch.setattr("armdyn.optimal.program.compiled._WORTH_IT", 5)
    plain = function()
    assert compiled([plain]) == [plain]
    (built,) = compiled([plain], True)
    assert compiled([plain])[0].class_name() == built.class_name()  # now it is on disk
    assert cache_directory().exists()


@needs_compiler
def test_compiled_derivatives_of_a_transcription():
    dynamics = Dynamics(paper_arm("rr"), free_last_body=True)
    slow, fast = (build_nlp(dynamics, Scheme(control="constant", compile=ask), 4) for ask in (False, True))
    random = np.random.default_rng(1)
    x, p = (random.uniform(0.5, 1.5, size=slow.functions[name].numel()) for name in "xp")
    lam = random.normal(size=slow.functions["g"].numel())
    for got, expected in (
        (fast.jacobian(x, p)[1], slow.jacobian(x, p)[1]),
        (fast.hessian(x, p, 1.0, lam), slow.hessian(x, p, 1.0, lam)),
    ):
        scale = np.max(np.abs(expected.full()))
        assert np.max(np.abs((got - expected).full())) < 1e-14 * scale  # the C library's sin and cos: an ulp


@needs_compiler
def test_no_compiler_is_started_for_which_there_is_no_time(own_cache):
    with until(time.perf_counter() + 1e-6), pytest.raises(NoTimeError):
        compiled([function()], True)
    assert not own_cache.exists()
    built = compiled([function()], True)[0]
    with until(0.0):  # what is on disk takes none
        assert compiled([function()], True)[0].class_name() == built.class_name() == "External"


@needs_compiler
def test_a_compiler_that_takes_too_long_is_left(own_cache, monkeypatch, tmp_path):
    slow = tmp_path / "slow"
    slow.write_text("#!/bin/sh\nexec sleep 60\n")
    slow.chmod(0o755)
    monkeypatch.setenv("CC", str(slow))
    monkeypatch.setattr("armdyn.optimal.program.compiled._EACH", 0.0)
    with until(time.perf_counter() + 0.2), pytest.raises(NoTimeError):
        compiled([function()], True)
    assert not any(own_cache.iterdir())
