"""Options of the robot's controller."""

from __future__ import annotations

import armdyn as ad
from armdyn.cli.options.groups import LIMITS, group, option
from armdyn.errors import ProblemError


def preset_named(name: str, interface: str | None = None) -> ad.ControllerPreset:
    """A built-in preset, or that of a file NAME.toml.

    Raises:
        ArmdynError: the preset is unknown, the file describes none, or the interface is unknown.
    """
    if name.lower().endswith(".toml"):
        return ad.ControllerPreset.read(name).on(interface or "")
    return ad.ControllerPreset.named(name, interface or "")


def known_presets(incomplete: str) -> list[str]:
    """Names of presets with a beginning, for shell completion."""
    return [name for name in ad.ControllerPreset.names() if name.startswith(incomplete)]


@group(LIMITS)
class PresetOptions:
    """A controller preset, and its interface."""

    preset: str | None = option(
        "NAME|FILE.toml",
        "Conditions of the robot's controller, such as franka-panda (armdyn presets), or of your own file "
        "(docs/presets.md).",
        autocompletion=known_presets,
    )
    interface: str | None = option(
        "NAME", "Command interface of the controller: position, velocity or torque; by default the preset's first."
    )

    def read(self) -> ad.ControllerPreset | None:
        """The preset; None: no --preset.

        Raises:
            ArmdynError: see `preset_named`; or an interface is given without a preset.
        """
        if self.preset is not None:
            return preset_named(self.preset, self.interface)
        if self.interface is not None:
            raise ProblemError(f"--interface {self.interface} needs --preset NAME (armdyn presets lists them)")
        return None
