"""Options in groups: each is written once, and a command takes as many groups as it needs."""

from collections.abc import Callable, Iterator, Mapping
from copy import copy
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, cleandoc, signature
from itertools import chain
from typing import Annotated, Any, TypeAlias, dataclass_transform, get_args, get_origin, get_type_hints

import typer
from typer.models import OptionInfo

from armdyn.cli.console import Answer
from armdyn.cli.execution import carry_out
from armdyn.cli.invocation import flag_of, is_given, running
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import numbers, one_or_more, part

TASK, ROBOT, LIMITS, SCENE, SOLVER, OUTPUT = "Task", "Robot", "Limits", "Scene", "Solver", "Output"
"""Panels of help that commands share, in their order."""

PerJoint: TypeAlias = Annotated[float | list[float] | dict[str, float] | None, one_or_more]
"""An option of one number for all joints, one for each, or JOINT=NUMBER; may be given again."""
Numbers: TypeAlias = Annotated[list[float] | None, numbers]
"""An option of numbers."""
Part: TypeAlias = Annotated[float | None, part]
"""An option of a part of a whole, as a number or in percent."""

_ANGLES = ("q_start", "q_goal", "via", "lock")
"""Options of joint positions, to which --degrees applies."""


@dataclass_transform(kw_only_default=True, frozen_default=True)
def group(panel: str = "") -> Callable[[type[Any]], Any]:
    """Class decorator: a frozen dataclass of options.

    Args:
        panel: of the help, for the options that name no other; empty: the base class's, if it has one.
    """

    def made(cls: type[Any]) -> Any:
        if panel:
            cls.panel = panel
        return dataclass(frozen=True, kw_only=True)(cls)

    return made


def with_options(command: Callable[..., Answer]) -> Callable[..., None]:
    """A command as typer takes it, with one parameter per option, of a command that takes groups.

    A group is a class of `group`. Its fields, and the parameters of a command, are an `option`, a `flag` or an
    `argument`, or are groups themselves; they become the command's options in their order. A type that is `Annotated`
    has the function that makes the value of the typed text and the option's name. All options of a group stand in its
    panel of the help. After them come the options that every command has: --json, --quiet, and --degrees where there
    are angles.

    Raises:
        TypeError: two groups of a command have an option of the same name.
    """
    hints = get_type_hints(command, include_extras=True)
    hints.pop("return", None)
    flat: dict[str, Parameter] = {}
    own = (
        option
        for name, parameter in signature(command).parameters.items()
        for option in _expanded(name, hints[name], parameter.default, None)
    )
    for option in chain(own, _common(flat)):
        if option.name in flat:
            raise TypeError(f"{command.__name__} has two options {option.name!r}")
        flat[option.name] = option

    @wraps(command)
    def flattened(**values: Any) -> None:
        with running(command.__name__.replace("_", "-"), flat, values):
            carry_out(lambda: command(**{name: _gathered(name, hint, values) for name, hint in hints.items()}))

    flattened.__doc__ = _flowing(command.__doc__ or "")
    flattened.__annotations__ = {name: option.annotation for name, option in flat.items()}
    flattened.__signature__ = Signature(list(flat.values()))  # type: ignore[attr-defined]  # inspect reads it
    return flattened


def option(metavar: str, about: str, *, default: Any = None, name: str = "", **more: Any) -> Any:
    """A field of a group, or a default of a command's parameter: an option with a value.

    Args:
        metavar: its value, as help shows it.
        about: help.
        default: its value where it is not given; MISSING: it must be given.
        name: with its dashes; by default the field's.
        more: further arguments of `typer.Option`.
    """
    names = (name,) if name else ()
    return field(default=default, metadata={"option": typer.Option(..., *names, metavar=metavar, help=about, **more)})


def flag(about: str, **more: Any) -> Any:
    """A field of a group: an option without a value; arguments as of `option`."""
    return option("", about, default=False, **more)


def argument(metavar: str, about: str, *, default: Any = MISSING, **more: Any) -> Any:
    """A field of a group: an argument, required unless it has a default."""
    return field(default=default, metadata={"option": typer.Argument(metavar=metavar, help=about, **more)})


def given(*groups: Any) -> dict[str, Any]:
    """Options of the running command in groups, and in groups within them, that differ from their defaults, by name."""
    found: dict[str, Any] = {}
    for group in groups:
        for one in fields(group):
            value = getattr(group, one.name)
            if "option" not in one.metadata:
                found |= given(value)
            elif one.default is not MISSING and is_given(one.name):
                found[one.name] = value
    return found


def _common(names: Mapping[str, object]) -> Iterator[Parameter]:
    """Options that a command has besides its own: --json, --quiet, and --degrees if the command takes angles.

    Args:
        names: the command's own options by their names, complete when the first common one is read.
    """
    angles = [flag_of(name) for name in _ANGLES if name in names]
    flags = [
        ("json", "One JSON object on standard output, nothing else.", OUTPUT),
        ("quiet", "Print errors and warnings only; files are written, and the exit code is the result.", OUTPUT),
    ]
    if angles:
        note = f"Numbers of {', '.join(angles)} are degrees, but for joints that slide and numbers with a unit or pi."
        flags.insert(0, ("degrees", f"{note} All other options stay as they are.", TASK))
    for name, about, panel in flags:
        yield from _expanded(name, bool, flag(about, rich_help_panel=panel), None)


def _expanded(name: str, hint: Any, one: Any, panel: str | None) -> Iterator[Parameter]:
    """Typer's parameters of one parameter, or of a group of options; flags have no --no-… form."""
    if is_dataclass(hint):
        hints = get_type_hints(hint, include_extras=True)
        for each in fields(hint):
            yield from _expanded(each.name, hints[each.name], each, getattr(hint, "panel", panel))
        return
    declared = copy(one.metadata["option"])
    if isinstance(declared, OptionInfo):
        declared.rich_help_panel = declared.rich_help_panel or panel
        declared.param_decls = declared.param_decls or (flag_of(name),)
    default = Parameter.empty if one.default is MISSING else one.default
    typed = hint if _reader(hint) is None else str | None
    if _reader(hint) is not None and dict[str, float] in get_args(hint.__origin__):  # numbers by name, given again
        typed, default = list[str] | None, None if default is None else [default]
    yield Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[typed, declared])


def _reader(hint: Any) -> Callable[[str, str], Any] | None:
    """Function that makes an option's value of the typed text; None: the value is taken as typed."""
    return hint.__metadata__[0] if get_origin(hint) is Annotated else None


def _flowing(help_text: str) -> str:
    """A docstring with its paragraphs unwrapped, for all terminals; examples, which begin with [dim], stay."""
    paragraphs = cleandoc(help_text).split("\n\n")
    return "\n\n".join(text if text.startswith("[dim]") else " ".join(text.split("\n")) for text in paragraphs)


def _gathered(name: str, hint: Any, values: Mapping[str, Any]) -> Any:
    """The value of a parameter, read from its text, or the group of its options' values."""
    if isinstance(hint, type) and is_dataclass(hint):
        hints = get_type_hints(hint, include_extras=True)
        return hint(**{one.name: _gathered(one.name, hints[one.name], values) for one in fields(hint)})
    value, read = values[name], _reader(hint)
    if isinstance(value, list) and read is not None:
        if len(value) > 1 and not all("=" in one for one in value):
            raise ProblemError(f"{flag_of(name)} is given {len(value)} times: once, or each as JOINT=NUMBER")
        value = ",".join(value) or None
    return value if read is None or value is None else read(value, flag_of(name))
