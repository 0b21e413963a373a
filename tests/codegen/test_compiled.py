"""Machine code is the same functions, built once, and never needed; and it is this user's own, or is not run."""

import os
import re
import shutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import casadi as ca
import numpy as np
import psutil
import pytest

import armdyn as ad
from armdyn.codegen.cache import protected
from armdyn.codegen.compiled import compiled
from armdyn.codegen.deadline import NoTimeError, left, until
from armdyn.dynamics import Dynamics
from armdyn.errors import ArmdynWarning
from armdyn.files import write_sealed
from armdyn.optimal.mesh.assembly import build_nlp
from armdyn.optimal.problem.options import Scheme
from armdyn.optimal.problem.status import Stop
from damaged_cache import DAMAGES, fuzz_cache, planted
from problems import paper_arm

needs_compiler = pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler")
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="gives a file or folder away")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("ARMDYN_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr("armdyn.codegen.compiled._warned", set())
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
def test_arms_of_other_lengths_and_masses_share_a_library(own_cache):
    plain = [acceleration(*one) for one in ((0.31, 1.7), (0.27, 0.9))]
    fast = [compiled([one], True)[0] for one in plain]  # both loaded before either is called
    assert [path.suffix for path in own_cache.iterdir() if path.name != "urdf"] == [".so"]
    at = np.random.default_rng(1).normal(size=(3, 2))
    found = [np.array(one(*at)).ravel() for one in fast]
    for one, expected in zip(found, plain, strict=True):
        np.testing.assert_allclose(one, np.array(expected(*at)).ravel(), rtol=1e-14)  # an ulp of sin
    assert np.max(np.abs(found[0] - found[1])) > 0.1  # they are two arms


def acceleration(length, mass):
    """That of an arm of two links, the first with this length [m] and mass [kg], of q, v and tau."""
    spec = ad.ArmSpec.paper("rr")
    spec = replace(spec, links=(replace(spec.links[0], length=length, mass=mass), spec.links[1]))
    given = [ca.SX.sym(name, 2) for name in ("q", "v", "tau")]
    return ca.Function("aba", given, [Dynamics(ad.Robot.from_spec(spec)).aba(*given)])


@needs_compiler
def test_several_at_once_build_one_library(own_cache):
    with ThreadPoolExecutor(4) as pool:
        made = list(pool.map(lambda _: compiled([function()], True)[0], range(4)))
    assert {float(f([1, 2, 3])[0]) for f in made} == {float(function()([1, 2, 3])[0])}
    assert len(list(own_cache.iterdir())) == 1


def test_virtual_machine_on_request_or_where_there_is_no_compiler(own_cache, monkeypatch):
    plain = function()
    assert compiled([plain], False) == [plain]
    monkeypatch.setenv("PATH", str(own_cache))
    assert compiled([plain], True) == [plain]


@needs_compiler
def test_compiler_that_fails_is_done_without(own_cache, monkeypatch):
    monkeypatch.setenv("CC", "false")
    plain = function()
    with pytest.warns(ArmdynWarning, match=r"without machine code.*: the C compiler, .*false, failed \(exit 1\)$"):
        assert compiled([plain], True) == [plain]
    assert compiled([plain], True) == [plain]  # said once: a warning is an error here
    assert not any(own_cache.iterdir())


@needs_compiler
def test_large_functions_are_not_built_by_default(own_cache, monkeypatch):
    monkeypatch.setattr("armdyn.codegen.compiled._WORTH_IT", 5)
    plain = function()
    assert compiled([plain]) == [plain]
    (built,) = compiled([plain], True)
    assert compiled([plain])[0].class_name() == built.class_name()  # now it is on disk
    assert own_cache.exists()


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


def library_in(folder):
    """The one library of a folder, and its content."""
    (library,) = folder.glob("*.so")
    return library, library.read_bytes()


@needs_compiler
@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_damaged_library_is_built_again(damage, own_cache):
    plain = function()
    compiled([plain], True)
    library, whole = library_in(own_cache)
    library.unlink()
    damage(library, whole, np.random.default_rng(3))
    (fast,) = compiled([plain])
    assert fast.class_name() == "External"
    assert float(fast([1, 2, 3])[0]) == float(plain([1, 2, 3])[0])
    assert len(library.read_bytes()) == len(whole)
    assert list(own_cache.iterdir()) == [library]


TRUNCATED = """
import os
import casadi as ca
from armdyn.codegen.compiled import cache_directory, compiled

x = ca.SX.sym("x", 200)
plain = ca.Function("f", [x], [ca.sin(x) * ca.sumsqr(x)])
(early,) = compiled([plain], True)
(library,) = cache_directory().glob("*.so")
if {before}:
    del early
os.truncate(library, 9000)
for fast in [*compiled([plain], True), *([] if {before} else [early])]:
    assert fast.class_name() == "External"
    assert float(fast(1)[0]) == float(plain(1)[0])
"""


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("before", [True, False], ids=["before it is loaded", "while it is in use"])
def test_truncated_library_ends_no_process(before):
    run = subprocess.run([sys.executable, "-c", TRUNCATED.format(before=before)], capture_output=True, text=True)
    assert (run.returncode, run.stderr) == (0, "")  # not by SIGBUS


@needs_compiler
def test_library_of_other_functions_is_not_taken_for_these(own_cache):
    x = ca.SX.sym("x", 3)
    compiled([ca.Function("f", [x], [ca.cos(x)])], True)
    other, content = library_in(own_cache)
    plain = function()
    compiled([plain], True)
    (library,) = set(own_cache.iterdir()) - {other}
    library.write_bytes(content)  # whole, with its checksum, the same names within
    assert float(compiled([plain], True)[0]([1, 2, 3])[0]) == float(plain([1, 2, 3])[0])


@needs_compiler
def test_large_damaged_library_is_built_again_by_default(own_cache, monkeypatch):
    compiled([function()], True)
    monkeypatch.setattr("armdyn.codegen.compiled._WORTH_IT", 5)
    library, _ = library_in(own_cache)
    library.write_bytes(b"")
    assert compiled([function()])[0].class_name() == "External"


@needs_compiler
@pytest.mark.parametrize(
    "whose",
    [
        "others write in it",
        "others write above it",
        pytest.param("another user's", marks=as_root),
        pytest.param("above another's", marks=as_root),
    ],
)
def test_folder_that_is_not_ours_alone_is_not_loaded_from(whose, own_cache, tmp_path):
    plain = function()
    compiled([plain], True)
    library, _ = library_in(own_cache)
    foreign, trace = planted(tmp_path)
    sealed = write_sealed(library, foreign).read_bytes()  # who plants it knows how
    if whose == "others write in it":
        own_cache.chmod(0o777)
    elif whose == "others write above it":
        tmp_path.chmod(0o770)
    else:
        os.chown(own_cache if whose == "another user's" else tmp_path, 12345, -1)
    with pytest.warns(ArmdynWarning, match=r"the cache of machine code, .*, is not used.*(others can|another user)"):
        (fast,) = compiled([plain], True)
    assert float(fast([1, 2, 3])[0]) == float(plain([1, 2, 3])[0])
    assert fast.class_name() == "External"
    assert library.read_bytes() == sealed  # no part of that folder is touched
    assert not trace.exists()
    compiled([plain], True)  # said once


@needs_compiler
@as_root
@pytest.mark.parametrize("how", ["another user's", "others can write it"])
def test_file_that_is_not_ours_alone_is_built_again(how, own_cache):
    plain = function()
    compiled([plain], True)
    library, _ = library_in(own_cache)
    before = library.stat().st_ino
    os.link(library, own_cache / "kept")  # or its number would be given again
    os.chown(library, 12345, -1) if how == "another user's" else library.chmod(0o666)
    assert compiled([plain], True)[0].class_name() == "External"
    assert library.stat().st_ino != before
    assert (library.stat().st_uid, library.stat().st_mode & 0o777) == (0, 0o644)


@needs_compiler
@pytest.mark.parametrize("place", ["/dev/null", "/proc/armdyn", "/dev/null/cache"])
def test_place_that_is_no_folder_is_done_without(place, monkeypatch):
    monkeypatch.setenv("ARMDYN_CACHE", place)
    with pytest.warns(ArmdynWarning, match=f"the cache of machine code, {place}, is not used"):
        (fast,) = compiled([function()], True)
    assert fast.class_name() == "External"  # built in a folder of its own


@needs_compiler
@pytest.mark.parametrize("failing", ["write_sealed", "_Recipe.load", "built"])
def test_full_disk_is_done_without(failing, own_cache, monkeypatch):
    def fail(*_, **__):
        raise OSError(28, "No space left on device", f"/somewhere/{np.random.default_rng().integers(1e9)}")

    monkeypatch.setattr(f"armdyn.codegen.compiled.{failing}", fail)
    plain = function()
    with pytest.warns(ArmdynWarning) as said:
        assert compiled([plain], True) == [plain]
        assert compiled([plain], True) == [plain]
    assert len(said) == 2  # of the cache and of the private folder, once each, though the files differ
    assert all(str(one.message).endswith(": No space left on device") for one in said)
    assert not any(own_cache.iterdir())


def script(path, text):
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return str(path)


@pytest.mark.parametrize(
    ("does", "said"),
    [
        ("echo no such machine >&2; echo more; exit 4", r"failed \(exit 4\) no such machine$"),
        ("exit 0", r"failed \(exit 0\)$"),
        ('while [ "$1" != -o ]; do shift; done; echo no library > "$2"', "cannot be loaded"),
        ("sleep 10 & cat; wait", "took longer than 0.2 s"),
    ],
    ids=["fails", "writes nothing", "writes nonsense", "hangs"],
)
def test_any_compiler_that_fails_is_done_without(does, said, tmp_path, own_cache, monkeypatch):
    monkeypatch.setenv("CC", script(tmp_path / "compiler", does))
    if "0.2" in said:
        monkeypatch.setattr("armdyn.codegen.compiler._TIMEOUT", 0.2)
    plain = function()
    with pytest.warns(ArmdynWarning) as warned:
        assert compiled([plain], True) == [plain]
    assert re.search(f"^solving without machine code.*{said}", str(warned[-1].message))
    assert not any(own_cache.iterdir())


def test_compiler_that_hung_is_not_run_again(tmp_path, monkeypatch):
    calls = tmp_path / "calls"
    monkeypatch.setenv("CC", script(tmp_path / "compiler", f"echo >> {calls}; sleep 10"))
    monkeypatch.setattr("armdyn.codegen.compiler._TIMEOUT", 0.4)
    with pytest.warns(ArmdynWarning, match="took longer than 0.4 s"):
        for _ in range(2):
            compiled([function()], True)
    assert calls.read_text() == "\n"


@needs_compiler
@pytest.mark.slow
def test_fuzzed_libraries_are_built_again():
    outcomes = fuzz_cache(150, seed=0)
    assert outcomes.total() == 150
    assert all(outcome.endswith(": built again") for outcome in outcomes)


@needs_compiler
def test_no_compiler_is_started_for_which_there_is_no_time(own_cache):
    with until(time.perf_counter() + 1e-6), pytest.raises(NoTimeError):
        compiled([function()], True)
    assert not own_cache.exists() or not any(own_cache.iterdir())
    built = compiled([function()], True)[0]
    with until(0.0):  # a library on disk needs no time
        assert compiled([function()], True)[0].class_name() == built.class_name() == "External"


@needs_compiler
def test_a_compiler_that_takes_too_long_is_left(own_cache, monkeypatch, tmp_path):
    slow = tmp_path / "slow"
    slow.write_text("#!/bin/sh\nexec sleep 60\n")
    slow.chmod(0o755)
    monkeypatch.setenv("CC", str(slow))
    monkeypatch.setattr("armdyn.codegen.compiled._EACH", 0.0)
    with until(time.perf_counter() + 2.0):
        with pytest.raises(NoTimeError):
            compiled([function()], True)
        assert left() > 0.5  # of the half that is kept for the solve without machine code
    assert not any(own_cache.iterdir())


def test_a_compiler_that_is_stopped_leaves_no_child(own_cache, monkeypatch, tmp_path):
    child = tmp_path / "child"
    monkeypatch.setenv("CC", script(tmp_path / "compiler", f"sleep 300 & echo $! > {child}; wait"))
    monkeypatch.setattr("armdyn.codegen.compiled._EACH", 0.0)
    with until(time.perf_counter() + 1.0), pytest.raises(NoTimeError):
        compiled([function()], True)
    assert_ended(int(child.read_text()))


def assert_ended(process, deadline=5.0):
    until = time.monotonic() + deadline
    while psutil.pid_exists(process) and psutil.Process(process).status() != psutil.STATUS_ZOMBIE:
        assert time.monotonic() < until
        time.sleep(0.01)


def test_the_builder_in_the_background_leaves_no_child(own_cache, tmp_path):
    child, library = tmp_path / "child", own_cache / "some.so"
    compiler = script(tmp_path / "compiler", f"sleep 300 & echo $! > {child}; wait")
    protected(own_cache)
    code = "from armdyn.codegen import builder, compiler; compiler._TIMEOUT = 0.5; builder.main()"
    subprocess.run([sys.executable, "-c", code], input=f"{compiler}\n{library}\nint x;", text=True, timeout=60)
    assert_ended(int(child.read_text()))


def test_a_compiler_has_one_gibibyte(tmp_path, monkeypatch):
    takes = f"exec {sys.executable} -c 'bytearray({{}} * 2**20)'"
    for size, ends in ((1100, "exit 1"), (600, "exit 0")):
        monkeypatch.setattr("armdyn.codegen.compiled._warned", set())
        monkeypatch.setenv("CC", script(tmp_path / f"compiler{size}", takes.format(size)))
        with pytest.warns(ArmdynWarning, match=ends):
            compiled([function()], True)


def test_an_interrupt_stops_the_compiler(own_cache, monkeypatch, tmp_path):
    monkeypatch.setenv("CC", script(tmp_path / "compiler", "exec sleep 60"))
    stop = Stop()
    threading.Timer(0.3, stop.interrupt).start()
    with until(np.inf, lambda: stop.interrupted), pytest.raises(NoTimeError):
        compiled([function()], True)
