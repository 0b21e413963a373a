"""Exceptions: one root, children that carry the facts.

Bad input raises. A solve that does not converge is no bad input: it returns a `Solution` that says so.
"""

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

_ALIKE = 0.7
"""Least similarity of two names for a guess, difflib's ratio: "ur5e" and "ur5" have 0.86, "rr" and "r" 0.67."""
_PART = 3
"""Least letters of a part of a name for a guess."""
_MANY = 12
"""Most names in a message with a guess."""
_MESSAGE = 1500
"""Characters of a message: some twenty lines of a terminal, and more than a list of all arms of the library takes."""
_LONGEST = 200
"""Most letters of a name that are compared and shown."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """End of a message about an unknown name: "; did you mean 'ur5'?", empty if no known name is similar.

    Args:
        name: the unknown one.
        known: the names that would have been right.
    """
    import difflib  # only who mistypes waits for it

    names, name = list(known), name[:_LONGEST]
    near = difflib.get_close_matches(name, names, n=1, cutoff=_ALIKE)
    if not near and len(name) >= _PART:  # other capitals, or a part of a name
        near = [one for one in names if name.lower() in one.lower()]
    return f"; did you mean {near[0][:_LONGEST]!r}?" if near else ""


def nearest_names(name: str, known: Iterable[str]) -> str:
    """Names that would have been right, the most similar ones first, for the end of a message; at most `_MANY`."""
    from difflib import get_close_matches

    return ", ".join(get_close_matches(name[:_LONGEST], (one[:_LONGEST] for one in sorted(known)), n=_MANY, cutoff=0.0))


class ArmdynError(Exception):
    """Root of all errors that armdyn raises on purpose. Its message is bounded, and can be written anywhere."""

    def __reduce__(self) -> tuple[object, ...]:
        """Support pickling: the arguments that rebuild the error in another process."""
        return _rebuilt, (type(self), self.args), vars(self)

    def __str__(self) -> str:
        """The message; of a long one, as with a path of 100,000 characters in it, both ends."""
        message = str(self.args[0]) if self.args else ""  # no more than that: KeyError would print its repr
        message = message.encode("utf-8", "backslashreplace").decode()  # half a surrogate pair cannot be written
        return message if len(message) <= _MESSAGE else f"{message[: _MESSAGE // 2]} … {message[3 - _MESSAGE // 2 :]}"


def _rebuilt(kind: type[ArmdynError], args: tuple[object, ...]) -> ArmdynError:
    error = kind.__new__(kind)
    error.args = args
    return error


class SpecError(ArmdynError, ValueError):
    """A length, mass, inertia or limit of an `ArmSpec` or `Payload` is not physical."""


class UrdfError(ArmdynError, ValueError):
    """A URDF cannot be read or is not physical.

    Attributes:
        source: the file, or the name of the text.
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
        name: the unknown one.
        known: the names that would have been right.
        hint: where else there may be one of that name; empty: nowhere.
    """

    def __init__(self, name: str, known: Sequence[str], hint: str = ""):
        self.name = name
        self.known = tuple(known)
        self.hint = hint
        meant = did_you_mean(name, known)
        names = f"{' Known' if meant else '; known'}: {', '.join(known)}" if known else ""
        if meant and len(known) > _MANY:  # the guess would not be seen before them
            names = " `armdyn robots` lists all"
        super().__init__(f"no robot named {name!r}{f'; {hint}' if hint else ''}{meant}{names}")


class ProblemError(ArmdynError, ValueError):
    """A motion problem is ill-posed: wrong length, not finite, outside the limits, start = goal."""


class ContactError(ProblemError):
    """Bodies collide, or are nearer than the clearance, at a given pose.

    Attributes:
        robot: the arm.
        obstacles: in the world.
        q: joint positions at the pose [rad or m], shape (nv,).
        contacts: the pairs that are too near, a `Clearance` each, the nearest first.
    """

    def __init__(self, message: str, robot: Any, obstacles: tuple[Any, ...], q: Any, contacts: tuple[Any, ...]):
        self.robot, self.obstacles, self.q, self.contacts = robot, obstacles, q, contacts
        super().__init__(message)


class CycleError(ProblemError):
    """A step of a cycle is wrong, or cannot be done.

    Attributes:
        step: its number, from 1 on; 0: the start.
        name: of the step.
    """

    def __init__(self, step: int, name: str, why: str):
        self.step, self.name = step, name
        super().__init__(f"step {step} ({name}): {why}" if step else f"start of the cycle: {why}")


class TrajectoryError(ArmdynError, ValueError):
    """The arrays of a trajectory do not fit each other, or its file cannot be read."""


class LogError(ArmdynError, ValueError):
    """A log cannot be read, or does not fit the arm: units, order of the joints, currents, gaps, dead channels.

    Attributes:
        joint: at fault; None: not one alone.
    """

    def __init__(self, message: str, joint: str | None = None):
        self.joint = joint
        super().__init__(message)


class ResultError(ArmdynError, ValueError):
    """A result file cannot be read, or is of a version or in units that are not known."""


@contextmanager
def reraised(error: type[ArmdynError], where: str = "", *caught: type[Exception]) -> Iterator[None]:
    """Context that raises errors of its block as errors of one class, which say where they occurred.

    Args:
        error: the class.
        where: beginning of the message, before a colon; empty: the message stays.
        caught: classes of errors; none: all of armdyn's.

    Raises:
        ArmdynError: as `error`.
    """
    kinds = caught or (ArmdynError,)
    try:
        yield
    except kinds as why:
        raise error(f"{where}: {why}" if where else str(why)) from None


_MOST_OF_A_PATH = 300
"""Characters of a path that a message shows: longer names are hardly a file's."""


class FileError(ArmdynError, OSError):
    """A file cannot be read, or a folder not be written to.

    Attributes:
        path: which one.
        why: the fault.
    """

    def __init__(self, path: str | os.PathLike[str], why: str):
        self.path = path
        self.why = why
        shown, half = str(path), _MOST_OF_A_PATH // 2
        if len(shown) > _MOST_OF_A_PATH:
            shown = f"{shown[:half]}…{shown[-half:]}"
        super().__init__(f"{shown}: {why}")


class DiskFullError(ArmdynError, OSError):
    """There is no room for a file. Files written before it are whole.

    Attributes:
        path: the file, or the folder for it.
    """

    def __init__(self, path: str | os.PathLike[str]):
        self.path = path
        super().__init__(f"disk full while writing {path}; what was written before is whole")


class BridgeError(ArmdynError, RuntimeError):
    """The compiled bridge does not fit the installed casadi."""


class MissingPackageError(ArmdynError, ImportError):
    """An optional package is needed for the request, and not installed.

    Attributes:
        package: its name on PyPI.
        what: the request.
        instead: a way without it; empty: none.
    """

    def __init__(self, package: str, what: str, instead: str = ""):
        self.package = package
        self.what = what
        self.instead = instead
        super().__init__(f"{what} needs {package}: pip install {package}{f'; {instead}' if instead else ''}")


class ClusterError(ArmdynError, ConnectionError):
    """A Dask cluster cannot be reached, has no workers or other ones, or has gone. Rows that were written are there."""


class SettingError(ArmdynError, ValueError):
    """An environment variable has a wrong value.

    Attributes:
        variable: its name.
        value: its value.
    """

    def __init__(self, variable: str, value: str, right: str):
        self.variable = variable
        self.value = value
        super().__init__(f"{variable}={value!r}: must be {right}")


class ArmdynWarning(UserWarning):
    """A problem that can be solved, but may not be the intended one."""
