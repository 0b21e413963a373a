"""Packages that import a name when it is first asked for (PEP 562).

`import armdyn` is then quick, and who only reads a robot does not wait for the optimiser.
"""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module


def facade(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package whose names live in its modules.

    A module of the package, too, is found as its attribute, as if it had been imported with the package.
    Type checkers do not look here: the package says the same once more under TYPE_CHECKING.

    Args:
        package: its `__name__`.
        homes: module, seen from the package, to the names that it has for the package, with spaces between.
    """
    home_of = {name: home for home, names in homes.items() for name in names.split()}

    def get(name: str) -> object:
        missing = AttributeError(f"module {package!r} has no attribute {name!r}", name=name)
        if name in home_of:
            value = getattr(import_module(f"{package}.{home_of[name]}"), name)
        elif name.startswith("_"):
            raise missing
        else:
            try:
                value = import_module(f"{package}.{name}")
            except ModuleNotFoundError as error:
                if error.name != f"{package}.{name}":
                    raise
                raise missing from None
        setattr(sys.modules[package], name, value)  # next time it is simply there
        return value

    def names() -> list[str]:
        return sorted(vars(sys.modules[package])["__all__"])  # no helpers, no modules that happen to be loaded

    return get, names
