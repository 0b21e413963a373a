"""Controllers by the names of the command line and of study files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Self

from armdyn.arguments import Sign, one_of
from armdyn.control.laws.computed_torque import ComputedTorque
from armdyn.control.laws.lqr import Lqr
from armdyn.control.laws.pid import FORMS, Pid, PidGains
from armdyn.control.loop.loop import Controller
from armdyn.errors import ProblemError


@dataclass(frozen=True)
class NamedController:
    """Controller that is made from numbers on the command line or in a study file.

    Attributes:
        settings: signs of the numbers by name, in the order of `armdyn track --gains`.
        make: the controller, of the settings as keywords.
        required: whether every setting must be given; the others have defaults.
        forms: meanings that its output may have; `make` takes one as `form`. Empty: it has but one.
    """

    settings: Mapping[str, Sign]
    make: Callable[..., Controller]
    required: bool = False
    forms: Sequence[str] = ()

    def with_form(self, form: str | None, name: str) -> Self:
        """The controller with a form of its output; None: the default.

        Args:
            form: one of `forms`.
            name: the option's, in messages.

        Raises:
            ProblemError: it is not.
        """
        if form is None:
            return self
        if not self.forms:
            raise ProblemError(f"{name} is an option of controller 'pid' alone")
        return replace(self, make=partial(self.make, form=one_of(form, self.forms, name)))

    def of(self, values: Sequence[float], where: str) -> Controller:
        """The controller of numbers in the order of `settings`.

        Args:
            values: the numbers.
            where: they come from, in messages.

        Raises:
            ProblemError: another number of values, or one is out of range.
        """
        if len(values) != len(self.settings):
            count = {1: "one", 2: "two", 3: "three"}.get(len(self.settings), len(self.settings))
            raise ProblemError(f"{where} has {len(values)} numbers; give {count}, {','.join(self.settings).upper()}")
        return self.make(**dict(zip(self.settings, values, strict=True)))


CONTROLLERS: dict[str, NamedController] = {
    "lqr": NamedController({"position": "positive", "velocity": "not negative", "integral": "not negative"}, Lqr),
    "computed-torque": NamedController({"bandwidth": "positive"}, ComputedTorque),
    "pid": NamedController(
        {"kp": "any", "ki": "any", "kd": "any"},
        lambda kp, ki, kd, form="torque": Pid(PidGains(kp, ki, kd), form),
        required=True,
        forms=FORMS,
    ),
}
