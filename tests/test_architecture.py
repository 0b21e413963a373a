"""The map is true: every function of its table of equations exists, every room is named."""

import ast
import importlib
import re
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MAP = (ROOT / "docs" / "architecture.md").read_text()
EQUATIONS = MAP.split("## From the paper's equations to functions")[1]
NAMES = sorted({name for name in re.findall(r"`([a-z_.]+\.[A-Za-z_.]+)`", EQUATIONS) if "/" not in name})


@pytest.mark.parametrize("name", NAMES)
def test_a_function_of_the_table_of_equations_exists(name):
    parts = ["armdyn", *name.split(".")]
    for end in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:end]))
        except ModuleNotFoundError:
            continue
        for part in parts[end:]:
            found = getattr(found, part)
        return
    pytest.fail(f"there is no {name}")


def test_every_equation_is_in_the_table():
    numbers = set()
    for first, last in re.findall(r"\((\d+)\)(?: to \((\d+)\))?", EQUATIONS):
        numbers |= set(range(int(first), int(last or first) + 1))
    assert numbers == set(range(1, 36))


def test_every_folder_is_on_the_map():
    assert rooms_of("optimal") == set(re.findall(r"^\| `([a-z_]+)/` \|", MAP, flags=re.M))
    assert rooms_of("control") == set(re.findall(r"^\| `control/([a-z_]+)` \|", MAP, flags=re.M))
    assert rooms_of("models") == set(re.findall(r"^\| `models/([a-z_]+)` \|", MAP, flags=re.M))


def rooms_of(layer):
    return {path.name for path in (ROOT / "armdyn" / layer).iterdir() if (path / "__init__.py").exists()}


def test_every_file_named_is_there():
    for name in re.findall(r"`((?:[a-z_]+/)+[a-z_]+\.py)`", MAP):
        rooms = (
            ROOT,
            ROOT / "armdyn",
            ROOT / "armdyn" / "optimal",
            ROOT / "armdyn" / "models",
            ROOT / "armdyn" / "control",
        )
        assert any((root / name).exists() for root in rooms), name


@pytest.mark.slow
def test_no_two_classes_share_a_name():
    found = Counter(
        node.name
        for path in (ROOT / "armdyn").rglob("*.py")
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.ClassDef)
    )
    assert [name for name, count in found.items() if count > 1] == []
