"""Generate C that evaluates a Function at several points at once, one point per lane of a vector register.

GCC and Clang have vector types; their sums and products are one instruction on every processor of
today, and the results equal those of one point alone.
"""

import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import casadi as ca


def _has_avx2() -> bool:
    """Whether this processor has AVX2, as Linux says."""
    with suppress(OSError), Path("/proc/cpuinfo").open("rb") as file:  # the first core's lines are enough
        return bool(re.search(rb"^flags\b.*\bavx2\b", file.read(4096), re.MULTILINE))
    return False


_AVX2 = _has_avx2()
LANES = 4 if _AVX2 else 2
"""Doubles in a register: two in those of every x86-64 and ARMv8, four in those of AVX2."""

_WRITTEN = {
    ca.OP_ADD: "{} + {}",
    ca.OP_SUB: "{} - {}",
    ca.OP_MUL: "{} * {}",
    ca.OP_DIV: "{} / {}",
    ca.OP_NEG: "-{}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2.0 * {}",
    ca.OP_INV: "1.0 / {}",
}
_LIBRARY = ("sin", "cos", "tan", "tanh", "sqrt", "exp", "log", "fabs")
"""Functions of the C library, which take one number at a time."""
_CALLED = {getattr(ca, f"OP_{name.upper()}"): name for name in _LIBRARY}
_TURNS = """typedef long long W __attribute__((vector_size(LANES * sizeof(double))));

/* Sine of x after `quarter` quarter turns: x = n pi / 2 + r with |r| <= pi / 4, and the polynomials of fdlibm in r
   (k_sin.c, k_cos.c; its pi / 2 in parts, so that n times the first is exact): within an ulp of 1. */
static inline __attribute__((always_inline)) V turned(V x, int quarter) {
    for (int i = 0; i < LANES; i++)
        if (!(fabs(x[i]) < 1e5)) return quarter ? cos_each(x) : sin_each(x);
    const V magic = broadcast(0x1.8p52);
    V t = x * 0x1.45f306dc9c883p-1 + magic, n = t - magic;
    V r = x - n * 0x1.921fb544p+0 - n * 0x1.0b4611a626331p-34, z = r * r;
    V sine = r + z * r * (-0x1.5555555555549p-3 + z * (0x1.111111110f8a6p-7 + z * (-0x1.a01a019c161d5p-13
             + z * (0x1.71de357b1fe7dp-19 + z * (-0x1.ae5e68a2b9cebp-26 + z * 0x1.5d93a5acfd57cp-33)))));
    V half = 0.5 * z, w = 1.0 - half;
    V cosine = w + ((1.0 - w - half) + z * z * (0x1.555555555554cp-5 + z * (-0x1.6c16c16c15177p-10
               + z * (0x1.a01a019cb159p-16 + z * (-0x1.27e4f809c52adp-22 + z * (0x1.1ee9ebdb4b1c4p-29
               - z * 0x1.8fae9be8838d4p-37))))));
    W turns = (W)t + quarter, odd = -(turns & 1), sign = (turns & 2) << 62;
    return (V)(((odd & (W)cosine) | (~odd & (W)sine)) ^ sign);
}
#define sin_v(x) turned(x, 0)
#define cos_v(x) turned(x, 1)
"""
"""Sine and cosine of all places at once: a seventh of the time of a solve, place by place."""


class UnwrittenError(Exception):
    """An instruction of CasADi for which there is no C here; caught in every solve, which then has no such code."""


def prelude() -> str:
    """C preamble of the functions of `in_lanes`: the vector type and functions on it."""
    lines = [
        *(['#pragma GCC target("avx2")'] if _AVX2 else []),  # without fused products: the same numbers everywhere
        "#include <math.h>",
        f"enum {{ LANES = {LANES} }};",
        f"typedef double V __attribute__((vector_size({LANES} * sizeof(double))));",
        "static inline V broadcast(double x) { return x - (V){0}; }",
    ]
    for name in _LIBRARY:
        body = f"for (int i = 0; i < LANES; i++) x[i] = {name}(x[i]); return x;"
        lines.append(f"static inline V {name}_{'each' if name in ('sin', 'cos') else 'v'}(V x) {{ {body} }}")
    return "\n".join(lines) + "\n" + _TURNS


def in_lanes(function: ca.Function) -> str:
    """A function of dense SX in C: `static void name(const V *i0, …, V *o0, …)`.

    Raises:
        UnwrittenError: it has an instruction that is not known here.
    """
    given = [f"const V *i{k}" for k in range(function.n_in())]
    given += [f"V *o{k}" for k in range(function.n_out())]
    lines = [f"static void {function.name()}({', '.join(given)}) {{"]
    held: dict[int, str] = {}
    for k in range(function.n_instructions()):
        code, put, taken = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if code == ca.OP_CONST:
            lines.append(f"double c{k}={function.instruction_constant(k):.16e};")  # as CasADi writes them: `compiled`
            held[put[0]] = f"broadcast(c{k})"
        elif code == ca.OP_INPUT:
            held[put[0]] = f"i{taken[0]}[{taken[1]}]"
        elif code == ca.OP_OUTPUT:
            lines.append(f"o{put[0]}[{put[1]}] = {held[taken[0]]};")
        else:
            lines.append(f"V t{k} = {_expression(code, [held[place] for place in taken])};")
            held[put[0]] = f"t{k}"
    return "\n".join([*lines, "}\n"])


def table(name: str, numbers: Iterable[int]) -> str:
    """A table of whole numbers in C."""
    return f"static const int {name}[] = {{{', '.join(str(int(number)) for number in numbers)}}};\n"


def _expression(code: int, arguments: list[str]) -> str:
    if code in _WRITTEN:
        return _WRITTEN[code].format(*arguments)
    if code in _CALLED:
        return f"{_CALLED[code]}_v({arguments[0]})"
    raise UnwrittenError(f"CasADi's instruction {code}")
