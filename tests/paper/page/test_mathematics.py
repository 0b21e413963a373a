"""Mathematics as MathML: linear notation is set, and other text is unchanged."""

import re
from xml.etree import ElementTree

import pytest

from armdyn.paper.page.errata import errata_table
from armdyn.paper.page.mathematics import formula, scientific, typeset
from armdyn.show.markup import Html


def letters(markup):
    return "".join(ElementTree.fromstring(f"<p>{markup}</p>").itertext())


def test_a_formula_is_mathml_without_an_address():
    made = formula(r"\pi/\sqrt{|r|}")
    root = ElementTree.fromstring(made)
    assert root.tag == "math" and root.get("display") == "inline"
    assert root.find(".//msqrt") is not None and "".join(root.itertext()) == "π/|r|"
    assert "http" not in made


@pytest.mark.parametrize(
    "text, set_as",
    [
        ("t_f", "msub"),
        ("∫ (1 + ½ τᵀτ) dt", "mfrac"),
        ("− k_D θ̇", "mover"),
        ("π/√|r|", "msqrt"),
        ("m → m + M", "mi"),
        ("τ3", "msub"),
    ],
)
def test_the_papers_notation_is_set(text, set_as):
    made = typeset(f"before {text}, after")
    assert made.startswith("before <math") and made.endswith("</math>, after")
    assert f"<{set_as}>" in made


def test_longer_notation_wins_and_words_stay():
    assert typeset("+ k_D θ̇").count("<math") == 1
    assert typeset("offset_t_from τ12") == "offset_t_from τ12"
    assert letters(typeset("max Re λ = -1.05 1/s at 3 N m")) == "maxReλ = -1.05 1/s at 3\u00a0N\u00a0m"


def test_text_is_escaped_and_markup_is_not():
    assert typeset("<b> & t_f").startswith("&lt;b&gt; &amp; <math")
    assert typeset(Html("<b>t_f</b>")) == "<b>t_f</b>"


def test_powers_of_ten():
    assert letters(scientific(2.34e-9)) == "2.3×10−9"
    assert scientific(0.0) == "0"


def test_every_equation_has_the_printed_and_the_right_form():
    page = errata_table()
    rows = re.findall(r"<tr>(.*?)</tr>", page)[1:]
    numbers = [re.search(r'class="first">([^<]*)<', row)[1] for row in rows]
    assert numbers == ["(7)", "(11)", "after (13)", "(14), (15)", "(16)–(21)", "(28)–(30)", "(31)", "(35)"]
    for row in rows:
        printed, right = re.findall(r'<td class="text formula[^"]*">(<math.*?</math>)</td>', row)
        assert letters(printed) != letters(right)
