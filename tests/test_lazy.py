"""`import armdyn` loads modules on use, and has the names of its type stubs."""

import ast
import copy
import importlib
import pickle
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import armdyn

FACADES = (
    "armdyn",
    "armdyn.control",
    "armdyn.dynamics",
    "armdyn.models",
    "armdyn.optimal",
    "armdyn.paper",
    "armdyn.trajectory",
)
HEAVY = (
    "numpy",
    "scipy",
    "casadi",
    "pinocchio",
    "matplotlib",
    "control",
    "mujoco",
    "pandas",
    "meshcat",
    "yourdfpy",
    "trimesh",
    "lxml",
    "rich",
    "typer",
)


def loaded(code: str) -> set[str]:
    """The modules that are there after some code, in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_importing_the_package_loads_nothing_big():
    assert not loaded("import armdyn") & set(HEAVY)


def test_a_problem_is_posed_without_the_solvers_modules():
    # A robot from a file: a generated one is written by yourdfpy, which loads trimesh, and that some of scipy.
    code = "import armdyn as ad; robot = ad.Robot.from_library('panda'); q = robot.model.lowerPositionLimit"
    there = loaded(
        f"{code}; ad.MinimumTimeProblem(robot, q_start=q, q_goal=q + 0.5); ad.MinimumTimeOptions(); ad.Dynamics"
    )
    assert "pinocchio" in there
    for module in ("scipy.integrate", "scipy.optimize", "scipy.special", "scipy.interpolate", "matplotlib", "meshcat"):
        assert module not in there


def test_a_page_of_saved_results_is_made_without_the_optimiser():
    there = loaded("import armdyn.show.page.report, armdyn.show.replay")
    assert "meshcat" in there
    for module in ("armdyn.optimal", "armdyn.cycle", "scipy", "trimesh", "matplotlib"):
        assert module not in there


@pytest.mark.slow
def test_all_names_are_there_and_nothing_that_draws_until_a_value_is_drawn():
    code = "from armdyn import *; import armdyn; assert set(armdyn.__all__) <= set(globals())"
    code += "; solve_minimum_time; simulate_pid; Solution.plot, Solution.report; from armdyn import optimal, control"
    code += "; from armdyn import rendering; import sys; there = {'armdyn.show.values', 'armdyn.show', 'matplotlib'"
    code += ", 'meshcat', 'yourdfpy', 'scipy.stats', 'typer', 'rich'} & set(sys.modules); assert not there, there"
    assert "armdyn.show.values" in loaded(f"{code}; rendering.renderer()")


@pytest.mark.parametrize("name", FACADES)
def test_a_facade_has_the_names_of_its_stub(name):
    package = importlib.import_module(name)
    stub = ast.parse(Path(package.__file__).with_suffix(".pyi").read_text())
    typed = {
        alias.asname: (line.module, alias.name)
        for line in stub.body
        if isinstance(line, ast.ImportFrom)
        for alias in line.names
    }
    assert typed, "nothing is lazy"
    for attribute, (module, its_name) in typed.items():
        assert attribute == its_name
        assert getattr(package, attribute) is getattr(importlib.import_module(module), attribute)
    assert set(typed) == set(package.__all__) - {"__version__"}
    # A name that is a module's, too, would be the module as soon as that is imported.
    assert not set(package.__all__) & {module.name for module in pkgutil.iter_modules(package.__path__)}


def test_modules_are_found_as_attributes_and_nothing_else():
    loaded("import armdyn; armdyn.optimal.problem; armdyn.models.robots; armdyn.errors.SpecError")
    with pytest.raises(AttributeError, match=r"module 'armdyn' has no attribute 'optimum'"):
        armdyn.optimum  # noqa: B018
    assert not hasattr(armdyn, "__wrapped__")
    with pytest.raises(ImportError):
        from armdyn.models import Robots  # noqa: F401


def test_pickle_and_copy():
    payload = armdyn.Payload(mass=0.1)
    assert pickle.loads(pickle.dumps(payload)) == copy.copy(payload) == payload
    assert pickle.loads(pickle.dumps(armdyn.Robot)) is armdyn.Robot
    assert issubclass(armdyn.errors.SpecError, armdyn.ArmdynError)


def test_a_module_that_cannot_be_imported_says_why(tmp_path):
    package = tmp_path / "broken"
    package.mkdir()
    (package / "__init__.py").write_text(
        "from armdyn.lazy import facade\n__getattr__, __dir__, __all__ = facade(__name__, __file__)\n"
    )
    (package / "__init__.pyi").write_text("from broken.part import thing as thing\n")
    (package / "part.py").write_text("import no_such_module\n")
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import broken"
    for name in ("broken.thing", "broken.part"):
        done = subprocess.run([sys.executable, "-c", f"{code}; {name}"], capture_output=True, text=True, check=False)
        assert "ModuleNotFoundError: No module named 'no_such_module'" in done.stderr


@pytest.mark.parametrize("name", FACADES)
def test_dir_has_the_public_names_only(name):
    package = importlib.import_module(name)
    assert dir(package) == sorted(package.__all__)
