"""No circle of imports: those within functions and those of modules that are named in a text count, too."""

import ast
import importlib
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "armdyn"


def modules_of(package):
    """Path of every module of a package by its full name."""
    return {
        ".".join(path.relative_to(package.parent).with_suffix("").parts).removesuffix(".__init__"): path
        for path in package.rglob("*.py")
    }


def imports_of(name, modules):
    """Names that a module imports anywhere, and its texts, which may name modules; docstrings and types excepted."""
    nodes, skipped = list(ast.walk(ast.parse(modules[name].read_text()))), set()
    for node in nodes:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            skipped.update(id(inner) for one in node.body for inner in ast.walk(one))
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            skipped.add(id(node.value))
    for node in nodes:
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: a relative import"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            yield from (each if each in modules else node.module for each in names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and "." in node.value:
            yield node.value
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "facade":
            stub = ast.parse(modules[name].with_suffix(".pyi").read_text())
            yield from (line.module for line in stub.body if isinstance(line, ast.ImportFrom))


def graph_of(package):
    """Modules that each module imports."""
    modules = modules_of(package)
    return {name: {found for found in imports_of(name, modules) if found in modules} - {name} for name in modules}


@pytest.mark.slow
def test_no_circle():
    graph = graph_of(PACKAGE)
    assert graph["armdyn"] >= {"armdyn.optimal", "armdyn.show.values"}  # lazy imports are seen
    TopologicalSorter(graph).prepare()  # raises CycleError, which names the modules of a circle


@pytest.mark.parametrize(
    "hidden",
    [
        "def f():\n    from small.top import value",
        "NAMED = 'small.top'",
        "__getattr__, __dir__, __all__ = facade(__name__, __file__)",
    ],
)
def test_a_hidden_circle_is_found(hidden, tmp_path):
    package = tmp_path / "small"
    package.mkdir()
    (package / "__init__.py").write_text(hidden)
    (package / "__init__.pyi").write_text("from small.top import value as value\n")
    (package / "top.py").write_text("import small\n")
    with pytest.raises(CycleError):
        TopologicalSorter(graph_of(package)).prepare()


def test_the_core_does_not_name_the_paper():
    """Beside the package that reproduces it and the commands, which offer it, only `ArmSpec.paper` does."""
    modules = modules_of(PACKAGE)
    lines = [
        (name, line)
        for name, path in modules.items()
        if not name.startswith(("armdyn.paper", "armdyn.cli"))
        for line in path.read_text().replace("ArmSpec.paper", "").replace("def paper(cls", "").splitlines()
        if "paper" in line.lower()
    ]
    assert not lines


def test_scripts_import_what_exists():
    for path in sorted((PACKAGE.parent / "scripts").rglob("*.py")):
        lines = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
        for line in lines:
            if line.module.split(".")[0] == "armdyn":
                module = importlib.import_module(line.module)
                assert [one.name for one in line.names if not hasattr(module, one.name)] == [], path.name
