"""Faults of a URDF, told together, and what mends them."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from armdyn.errors import UrdfError

_T = TypeVar("_T")
_MOST_SAID = 7
"""Largest number of further faults in one message."""


class Faults(list[UrdfError]):
    """Faults of a URDF so far.

    Attributes:
        source: name of the file or text.
        remedy: end of the message.
    """

    def __init__(self, source: str, remedy: str = "") -> None:
        self.source, self.remedy = source, remedy

    def add(self, what: str, where: str | None = None) -> None:
        """Add a fault of an element."""
        self.append(UrdfError(self.source, what, where))

    def of(self, check: Callable[..., _T], *arguments: object) -> _T | None:
        """Run a check; None: it has failed."""
        try:
            return check(*arguments)
        except UrdfError as error:
            if str(error) not in map(str, self):
                self.append(error)
            return None

    def raise_together(self) -> None:
        """Raise the first, which tells the others and the remedy; without faults nothing is done."""
        if not self:
            return
        first, *more = self
        said = "; ".join(str(one).removeprefix(f"{one.source}: ") for one in more[:_MOST_SAID])
        left = f"; and {len(more) - _MOST_SAID} others" if len(more) > _MOST_SAID else ""
        first.args = (f"{first}{f'; {len(more)} more: {said}{left}' if more else ''}{self.remedy}",)
        raise first


def repair_call(source: str, more: str = "") -> str:
    """The call of `repair_urdf` for a file, with further arguments; of a text the file's name is left open."""
    return f"ad.repair_urdf({repr(source) if Path(source).is_file() else 'file'}{more})"


def mending(without_effort: Sequence[str], repair: str = "") -> str:
    """Python that mends a URDF; the command line turns it into a line of its own. Empty: there is none.

    Args:
        without_effort: joints without torque limits.
        repair: `repair_call`, if some inertias are those of no body.
    """
    efforts = f"effort_limit={{{', '.join(f'{name!r}: …' for name in without_effort)}}}" if without_effort else ""
    return f"ad.Robot.from_urdf_string({repair}.text{', ' * bool(efforts)}{efforts})" if repair else efforts
