import re
from pathlib import Path

import pytest

import armdyn
from armdyn.paper.printed import published
from armdyn.paper.printed.examples import PAYLOADS
from armdyn.paper.printed.published import Printed


def test_last_digits_are_known():
    assert Printed.of("4.260") == Printed(4.26, 1e-3, "4.260")
    assert Printed.of("0.0977").unit == 1e-4


def test_every_table_has_the_ten_payloads_and_no_other():
    for example in range(1, 7):
        assert all(published.printed_time(example, payload) for payload in PAYLOADS)
        assert published.printed_time(example, 0.3) is None
        assert len(published.total_torque(example)) == {"r": 1, "rr": 2, "rrr": 3}[_arm(example)]
    assert all(published.switching(payload) for payload in PAYLOADS)
    assert published.switching(0.3) is None and published.total_torque(1, 0.2) is None


def test_tables_truncate_the_four_digits_of_the_text():
    for example in (1, 2, 3):
        table, text = published.printed_time(example, 0.1006), published.time_in_text(example)
        assert 0 < text.value - table.value < table.unit
    for example in (4, 5, 6):
        assert published.printed_time(example, 0.1006) == published.time_in_text(example)


def test_no_other_module_contains_a_published_result():
    results = {published.printed_time(example, m).value for example in range(1, 7) for m in PAYLOADS}
    results |= {number.value for m in PAYLOADS for number in published.switching(m)}
    results |= {number.value for example in range(1, 7) for number in published.total_torque(example)}
    results |= {published.time_in_text(example).value for example in range(1, 7)}
    results |= {number.value for example in (4, 5, 6) for number in published.torque_in_text(example)}
    package = Path(armdyn.__file__).parent
    # models has the paper's inputs, Table 1 among them, and the links' colours.
    files = [f for f in package.rglob("*.py") if f.name != "published.py" and f.parent.parent.name != "models"]
    assert len(files) > 40
    for file in files:
        numbers = re.findall(r"(?<![\w.])\d*\.\d+(?![\w.])", file.read_text())
        assert not results & set(map(float, numbers)), file


def _arm(example):
    return "r" * (1 + (example - 1) % 3)


@pytest.mark.parametrize("text", ["", "three"])
def test_a_wrong_number_is_refused(text):
    with pytest.raises(ValueError, match="could not convert"):
        Printed.of(text)
