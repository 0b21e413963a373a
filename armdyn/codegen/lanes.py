"""Generate C that evaluates a Function at several points at once, one point per lane of a vector register.

GCC and Clang have vector types; their sums and products are one instruction on every processor of
today, and the results equal those of one point alone.
"""

import re
from collections.abc import Iterable
from contextlib import suppress
from importlib.resources import files
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


class UnwrittenError(Exception):
    """An instruction of CasADi for which there is no C here; caught in every solve, which then has no such code."""


def prelude() -> str:
    """C preamble of the functions of `in_lanes`: the vector type and functions on it."""
    target = '#pragma GCC target("avx2")\n' if _AVX2 else ""  # without fused products: the same numbers everywhere
    return f"{target}enum {{ LANES = {LANES} }};\n" + files(__package__).joinpath("lanes.c").read_text()


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
