"""The command that is running: its name, and the values of its options."""

import ast
import math
import re
import shlex
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from enum import Enum
from inspect import Parameter
from pathlib import Path
from typing import Any, NamedTuple, get_args


class _Invocation(NamedTuple):
    command: str = ""
    parameters: Mapping[str, Parameter] = {}
    values: Mapping[str, Any] = {}


_NONE = _Invocation()
_RUNNING: ContextVar[_Invocation] = ContextVar("running", default=_NONE)


_OTHER_NAMES = {
    "allowed_contacts": "allow_contact",
    "duration": "exciting",
    "end_contacts": "end_contact",
    "file": "out",
    "obstacles": "obstacle",
    "path_constraints": "limit",
}
"""Options of arguments in Python that have another name on the command line."""

_PHRASES = {
    "ad.lower_bound(problem)": "armdyn bound",
    "np.deg2rad(…)": "--degrees",
    "{'JOINT': NUMBER}": "JOINT=NUMBER",
    "MinimumTimeProblem(…, kinematic=True)": "armdyn mintime --kinematic",
    "FrameSpeedLimit": "--limit tip-speed",
    "RmsTorque": "--limit rms-torque",
    "TorqueRateLimit": "--limit torque-rate",
    "`geometry` False": "--no-geometry",
    "a payload near the true one, with its centre of mass": (
        "a payload near the true one, with its centre of mass: --payload and --payload-com"
    ),
    "what='all' instead of 'payload'": "leave out --payload-only",
    "what='all' instead of 'friction'": "leave out --friction-only",
}
"""Options of other expressions of Python in messages."""

_REPAIR = re.compile(r"ad\.repair_urdf\((?:('[^']*'|\"[^\"]*\")|file)((?:, \w+='?[\w.-]+'?)*)\)")
_MENDING = re.compile(
    r"(?<=: )(?=ad\.Robot|effort_limit=\{)(?:ad\.Robot\.from_urdf_string\((armdyn doctor .*?)\.text(?:, )?)?"
    r"(?:effort_limit=\{(.*?)\})?\)?$"
)
"""Calls of `repair_urdf`, and the Python of `faults.mending` at the end of a message."""


@contextmanager
def running(command: str, parameters: Mapping[str, Parameter], values: Mapping[str, Any]) -> Iterator[None]:
    """Context in which a command is running.

    Args:
        command: its name, as it is typed.
        parameters: as typer takes them, annotated with options and arguments.
        values: of the parameters.
    """
    token = _RUNNING.set(_Invocation(command, parameters, values))
    try:
        yield
    finally:
        _RUNNING.reset(token)


def command_name() -> str:
    """Name of the running command; empty: no command is running."""
    return _RUNNING.get().command


def option_value(name: str) -> Any:
    """Value of an option of the running command; None: the command has no such option."""
    return _RUNNING.get().values.get(name)


def is_given(name: str) -> bool:
    """Whether the running command has an option of this name with another value than the default."""
    now = _RUNNING.get()
    return name in now.values and now.values[name] != now.parameters[name].default


def flag_of(name: str) -> str:
    """An option of the running command as it is typed; where it has none of this name, with dashes."""
    one = _RUNNING.get().parameters.get(name)
    return (_flag(one.annotation) if one else "") or f"--{name.replace('_', '-')}"


def in_options(text: str) -> str:
    """A message in the words of the command line: an argument in backticks, or at its beginning, is its option.

    Names that are no option of the command that is running stay as words; where none is running all are options.
    """
    now = _RUNNING.get()
    flags = {
        flag.lstrip("-").replace("-", "_"): (flag, name)
        for name, one in now.parameters.items()
        if (flag := _flag(one.annotation))
    }

    def option_of(name: str) -> str:
        return name if name in flags else _OTHER_NAMES.get(name, name)

    def quoted(match: re.Match[str]) -> str:
        name = option_of(match[1])
        return flags[name][0] if name in flags else f"--{name.replace('_', '-')}" if now is _NONE else match[1]

    def first(match: re.Match[str]) -> str:
        flag, name = flags.get(option_of(match[1]), ("", ""))
        return flag if flag and is_given(name) else match[1]

    text = _MENDING.sub(_mended, _REPAIR.sub(_repair, text))
    for phrase, option in _PHRASES.items():
        text = text.replace(phrase, option)
    text = re.sub(r"\block=\{'([^']+)': '?([^'}]+)'?\}", r"--lock \1=\2", text)
    text = re.sub(r"\barm=\('([^']+)', '([^']+)'\)", r"--arm \1,\2", text)
    return re.sub(r"`([a-z_]+)`", quoted, re.sub(r"^([a-z_]+)(?=\[|:| is | of | has )", first, text))


def invocation() -> dict[str, object]:
    """The running command as JSON; empty: no command is running.

    Returns:
        "request": {"command": a line for a shell with all that is not by default, "options": all by name}.
    """
    now = _RUNNING.get()
    if now is _NONE:
        return {}
    return {
        "request": {"command": _line(now.values), "options": {name: plain(now.values[name]) for name in now.parameters}}
    }


def _line(values: Mapping[str, Any]) -> str:
    """The running command with values of its options, as a line for a shell with all that is not by default."""
    now = _RUNNING.get()
    given = [
        (_flag(one.annotation), values[name]) for name, one in now.parameters.items() if values[name] != one.default
    ]
    first = sorted(given, key=lambda one: one[0] != "")  # arguments; the order stays otherwise
    return shlex.join(["armdyn", now.command, *(word for flag, value in first for word in _typed(flag, value))])


def _repair(match: re.Match[str]) -> str:
    """The command of a call of `repair_urdf`."""
    file = shlex.quote(ast.literal_eval(match[1])) if match[1] else "FILE"
    return f"armdyn doctor {file} --repair" + re.sub(r", (\w+)='?([\w.-]+)'?", r" --\1 \2", match[2])


def _mended(match: re.Match[str]) -> str:
    """The line of `faults.mending` for a shell: the repair, and the running command with its file and the limits."""
    repair, values = match[1], dict(_RUNNING.get().values)
    robot, given = str(values.get("robot", ".toml")), ",".join(values.get("effort_limit") or ())
    joints = [one for one in re.findall("'([^']*)': …", match[2] or "") if f"{one}=" not in given]
    again, lines = not robot.endswith(".toml") and command_name() != "doctor", []
    if not repair and not again:  # keys of a file
        return f"effort_limit = {{ {', '.join(f'{one} = …' for one in joints)} }}"
    if repair:
        values["robot"] = f"{Path(shlex.split(repair)[2]).stem}-repaired.urdf"
        lines = [f"{repair} --out {shlex.quote(values['robot'])}"]
    if "effort_limit" not in values or values.get("kinematic") or (given and "=" not in given):
        joints = []
    if again:
        lines.append(_line(values) + (f" --effort-limit {','.join(f'{one}=…' for one in joints)}" if joints else ""))
    return "\n" + " && ".join(lines)


def _typed(flag: str, value: object) -> list[str]:
    """Command-line words that set an option, or the argument if the flag is empty."""
    values = list(value) if isinstance(value, (list, tuple)) else [value]
    if not flag:
        return [_word(one) for one in values]
    on, _, off = flag.partition("/")
    if isinstance(value, bool):
        return [word for word in (on if value else off,) if word]
    return [word for one in values for word in (on, _word(one))]


def _flag(hint: Any) -> str:
    """Declaration of an option, such as "--arm" or "--motors/--no-motors"; empty for an argument."""
    declared = get_args(hint)[1].param_decls  # as `options.groups` annotates parameters
    return str(declared[0]) if declared else ""


def _word(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(plain(value))


def plain(value: object) -> object:
    """Convert a value to JSON types."""
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    if isinstance(value, Enum):
        return plain(value.value)
    if value is None or isinstance(value, (bool, int)) or (isinstance(value, float) and math.isfinite(value)):
        return value
    text = str(value) if isinstance(value, (str, Path, float)) else repr(value)
    return text.encode(errors="replace").decode()  # a path that is no text cannot be written as JSON
