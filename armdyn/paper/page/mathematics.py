"""Mathematics of the page as MathML, which browsers set by themselves: no script, no picture, no request."""

import re
from functools import cache

from armdyn.show.markup import Html, join

_NOTATION = {
    "∫ (1 + ½ τᵀτ) dt": r"\int (1 + \tfrac12 \tau^{\mathrm T}\tau)\,\mathrm{d}t",
    "s³ − 10s² + 30s + 50": "s^3 - 10 s^2 + 30 s + 50",
    "½ τᵀτ": r"\tfrac12 \tau^{\mathrm T}\tau",
    "d₁₁": "d_{11}",
    "d₁₂": "d_{12}",
    "d₁₃": "d_{13}",
    "d₂₃": "d_{23}",
    "√|r|": r"\sqrt{|r|}",
    "|r|": "|r|",
    "e²": "e^2",
    "± k_D θ̇": r"\pm k_D\dot\theta",
    "+ k_D θ̇": r"+ k_D\dot\theta",
    "− k_D θ̇": r"- k_D\dot\theta",
    "m → m + M": r"m \to m + M",
    "max Re λ": r"\max\operatorname{Re}\,\lambda",
    "θ + π/2": r"\theta + \pi/2",
    "π/√|r|": r"\pi/\sqrt{|r|}",
    "2π/|r|": r"2\pi/|r|",
    "-π/2": r"-\pi/2",
    "cos θ": r"\cos\theta",
    "τ limit": r"\tau_{\mathrm{max}}",
    "k/det": r"k/\det",
    "π/20": r"\pi/20",
    "2π/r": r"2\pi/r",
    "M [g]": r"M\,[\mathrm{g}]",
    "t_f": "t_f",
    "k_D": "k_D",
    "|H|": "|H|",
    "τ1": r"\tau_1",
    "τ2": r"\tau_2",
    "τ3": r"\tau_3",
}
"""Linear notation in texts, tables and files, and its MathML."""

_FOUND = re.compile(
    "(" + "|".join(rf"(?<!\w){re.escape(one)}(?!\w)" for one in sorted(_NOTATION, key=len, reverse=True)) + ")"
)


@cache
def formula(latex: str, display: bool = False) -> Html:
    """A formula as MathML.

    Args:
        latex: as in mathematics mode.
        display: on a line of its own.
    """
    from latex2mathml.converter import convert  # only pages need it

    # The page's own parser knows the namespace.
    made = convert(latex, display="block" if display else "inline")
    return Html(made.replace(' xmlns="http://www.w3.org/1998/Math/MathML"', ""))


def typeset(text: str) -> Html:
    """A text, escaped, with the paper's notation in it set as mathematics; `Html` stays as it is."""
    if isinstance(text, Html):
        return text
    text = text.replace(" N m", "\u00a0N\u00a0m")  # a unit stays with its number
    return join(formula(_NOTATION[part]) if part in _NOTATION else part for part in _FOUND.split(text))


def scientific(value: float) -> Html:
    """A number to two digits as a power of ten."""
    if value == 0:
        return Html("0")
    digits, exponent = f"{value:.1e}".split("e")
    return formula(rf"{digits}\times 10^{{{int(exponent)}}}")
