"""C in lanes gives each place the numbers that it would get alone."""

import ctypes
import shutil

import casadi as ca
import numpy as np
import pytest

from armdyn.codegen.compiled import compiled_library
from armdyn.codegen.lanes import LANES, UnwrittenError, in_lanes, prelude, table

needs_compiler = pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler")


def everything():
    """A function with all that is written in C, two inputs and two outputs, one of them with a constant."""
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y")
    first = ca.vertcat(x[0] + y, x[1] - y, x[2] * y, x[0] / y, -x[1], x[2] ** 2, 2 * x[0], 1 / x[1], 4.25)
    second = [call(x[0]) for call in (ca.sin, ca.cos, ca.tan, ca.tanh, ca.sqrt, ca.exp, ca.log)]
    return ca.Function("everything", [x, y], [first, ca.vertcat(*second, ca.fabs(-x[1]))])


def aligned(rows):
    """An array of vectors, each at a multiple of its size, as C has them."""
    room = np.empty((rows + 1) * LANES)
    first = -room.ctypes.data // 8 % LANES
    return room[first : first + rows * LANES].reshape(rows, LANES)


@needs_compiler
def test_each_lane_is_a_place_of_its_own(tmp_path, monkeypatch):
    monkeypatch.setenv("ARMDYN_CACHE", str(tmp_path / "cache"))
    plain = everything()
    body = "void call(const V *x, const V *y, V *a, V *b) { everything(x, y, a, b); }"
    library = compiled_library(prelude() + in_lanes(plain) + body, plain.n_instructions(), True)
    random = np.random.default_rng(0)
    x, y, a, b = (aligned(rows) for rows in (3, 1, 9, 8))
    x[:], y[:] = random.uniform(0.5, 2, x.shape), random.uniform(0.5, 2, y.shape)
    library.call(*(array.ctypes.data_as(ctypes.c_void_p) for array in (x, y, a, b)))
    for lane in range(LANES):
        expected = plain(x[:, lane], y[:, lane])
        np.testing.assert_array_equal(a[:, lane], np.array(expected[0]).ravel())  # IEEE's own operations
        np.testing.assert_allclose(b[:, lane], np.array(expected[1]).ravel(), rtol=1e-15)  # an ulp of the C library


def test_unsupported_operations_are_refused():
    x = ca.SX.sym("x")
    with pytest.raises(UnwrittenError):
        in_lanes(ca.Function("f", [x], [ca.if_else(x > 0, x, 2)]))


def test_a_table():
    assert table("places", [3, 1, 2]) == "static const int places[] = {3, 1, 2};\n"
