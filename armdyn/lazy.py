"""Packages that import a name at its first use (PEP 562).

`import armdyn` is then quick, and a program that only reads a robot does not import the optimiser.
"""

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path


def facade(package: str, file: str) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a package that imports its names lazily.

    The names are those of its type stub, the file `__init__.pyi`: a line `from MODULE import NAME as NAME` each. A
    module of the package, too, is found as its attribute, as if it had been imported with the package.

    Args:
        package: its `__name__`.
        file: its `__file__`.
    """
    lines = [line.split() for line in Path(file).with_suffix(".pyi").read_text("utf-8").splitlines()]
    home_of = {words[3]: words[1] for words in lines if words[:1] == ["from"]}

    def get(name: str) -> object:
        missing = AttributeError(f"module {package!r} has no attribute {name!r}", name=name)
        if name in home_of:
            value = getattr(import_module(home_of[name]), name)
        elif name.startswith("_"):
            raise missing
        else:
            try:
                value = import_module(f"{package}.{name}")
            except ModuleNotFoundError as error:
                if error.name != f"{package}.{name}":
                    raise
                raise missing from None
        setattr(sys.modules[package], name, value)  # found without `__getattr__` from now on
        return value

    def names() -> list[str]:
        return sorted(vars(sys.modules[package])["__all__"])  # without helpers and modules that happen to be loaded

    return get, names, sorted(home_of)
