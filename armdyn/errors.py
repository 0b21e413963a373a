"""What can be wrong with an input, as one family of exceptions that carry the facts.

Bad input raises. A solve that does not converge is no bad input: it returns a `Solution` that says so.
"""

import os
from collections.abc import Sequence


class ArmdynError(Exception):
    """Root of all errors that armdyn raises on purpose."""


class SpecError(ArmdynError, ValueError):
    """A length, mass, inertia or limit of an `ArmSpec` or `Payload` is not physical."""


class UrdfError(ArmdynError, ValueError):
    """A URDF cannot be read or is not physical.

    Attributes:
        source: the file, or what the text was called.
        element: the link or joint at fault, if it is one.
    """

    def __init__(self, source: str, what: str, element: str | None = None):
        self.source = source
        self.element = element
        super().__init__(f"{source}: {f'{element}: ' if element else ''}{what}")


class UnsupportedJointError(UrdfError):
    """A joint is neither revolute, continuous, prismatic nor fixed."""


class UnknownRobotError(ArmdynError, KeyError):
    """No robot of that name.

    Attributes:
        name: what was asked for.
        known: the names that would have been right.
    """

    def __init__(self, name: str, known: Sequence[str]):
        self.name = name
        self.known = tuple(known)
        super().__init__(f"no robot named {name!r}; known: {', '.join(known)}")

    def __str__(self) -> str:
        """The message itself: KeyError would print its repr."""
        return str(self.args[0])


class ProblemError(ArmdynError, ValueError):
    """A motion problem is ill-posed: wrong length, not finite, outside the limits, start = goal."""


class TrajectoryError(ArmdynError, ValueError):
    """The arrays of a trajectory do not fit each other, or its file cannot be read."""


class ResultError(ArmdynError, ValueError):
    """A result file cannot be read, or is of a version or in units that are not known."""


class FileError(ArmdynError, OSError):
    """A file cannot be read, or a folder not be written to.

    Attributes:
        path: which one.
        why: what is wrong with it.
    """

    def __init__(self, path: str | os.PathLike[str], why: str):
        self.path = path
        self.why = why
        super().__init__(f"{path}: {why}")

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        """What makes it again in another process."""
        return type(self), (self.path, self.why)


class DiskFullError(ArmdynError, OSError):
    """There is no room for a file. What was written before it is whole.

    Attributes:
        path: the file, or the folder for it.
    """

    def __init__(self, path: str | os.PathLike[str]):
        self.path = path
        super().__init__(f"disk full while writing {path}; what was written before is whole")

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        """What makes it again in another process."""
        return type(self), (self.path,)


class BridgeError(ArmdynError, RuntimeError):
    """The compiled bridge does not fit the installed casadi."""


class SettingError(ArmdynError, ValueError):
    """An environment variable is set to what it cannot be.

    Attributes:
        variable: its name.
        value: what it is set to.
    """

    def __init__(self, variable: str, value: str, right: str):
        self.variable = variable
        self.value = value
        super().__init__(f"{variable}={value!r}: must be {right}")


class ArmdynWarning(UserWarning):
    """A problem that can be solved but may not mean what its author thinks."""
