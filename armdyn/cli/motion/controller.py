"""The controller's verdict on a solution, and what its conditions cost."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

import armdyn as ad
from armdyn.arguments import shown
from armdyn.cli.options.preset import PresetOptions

if TYPE_CHECKING:
    from armdyn.studies.preset_costs import ConditionCost
    from armdyn.trajectory import Samples


def preset_of(file: Path, given: PresetOptions) -> ad.ControllerPreset | None:
    """The preset of the options, or else the built-in one under which the motion of a file was planned."""
    chosen, result = given.read(), file.parent / "result.json"
    if chosen is not None or file.name != "trajectory.npz" or not result.is_file():
        return chosen
    from armdyn.show.results import load_result

    planned = load_result(result).get("controller")
    name, interface = (planned.get(key) for key in ("preset", "interface")) if isinstance(planned, dict) else ("", "")
    if name and name not in ad.ControllerPreset.names():
        note = f"the motion was planned under a preset of your own, {shown(name)}: not checked; give --preset its file"
        warnings.warn(note, ad.ArmdynWarning, stacklevel=2)
    return ad.ControllerPreset.named(name, str(interface)) if name in ad.ControllerPreset.names() else None


def check_samples(preset: ad.ControllerPreset, samples: Samples, accelerations: bool) -> ad.ControllerCheck:
    """Check samples that are exported.

    Args:
        preset: preset of the controller.
        samples: the exported rows.
        accelerations: whether the controller receives accelerations, too, and interpolates by quintics.

    Raises:
        ArmdynError: see `ControllerPreset.check`.
    """
    from armdyn.trajectory.planned import Planned

    if accelerations:
        return preset.check(Planned(samples.t, samples.q, samples.v, samples.a, samples.tau), samples.joint_names)
    return preset.check(
        ad.Trajectory(samples.t, samples.q, samples.v, samples.tau, samples.joint_names, hold="zero-order")
    )


@dataclass(frozen=True)
class ControllerVerdict:
    """Check of a solution by its preset, and cost of the preset's conditions.

    Attributes:
        found: check of the motion; None: the problem has no preset, or there is no motion.
        costs: costs of the necessary conditions.
    """

    found: ad.ControllerCheck | None = None
    costs: tuple[ConditionCost, ...] = ()

    @classmethod
    def of(cls, solution: ad.Solution, progress: Callable[[str], None], costs: bool) -> Self:
        """Check a solution; with `costs` solve it without each necessary condition, too."""
        preset = solution.problem.preset
        if preset is None or not solution.moves:
            return cls()
        from armdyn.studies.preset_costs import condition_costs

        solved = solution.usable and solution.status is not ad.Status.INTERRUPTED
        return cls(
            preset.check(solution.trajectory), condition_costs(solution, None, progress) if costs and solved else ()
        )

    @property
    def refused(self) -> bool:
        """Whether the controller would stop the motion."""
        return self.found is not None and not self.found.ok

    @property
    def facts(self) -> dict[str, object]:
        """The verdict for JSON; empty without a preset."""
        if self.found is None:
            return {}
        return {"controller": self.found.facts() | {"costs": [asdict(cost) for cost in self.costs]}}

    @property
    def words(self) -> dict[str, str]:
        """The verdict as `facts_table` shows it; empty without a preset."""
        if self.found is None:
            return {}
        ignored = [row for row in self.found.offences if not row.necessary]
        lines = [str(self.found), *(f"recommended, not kept: {row}" for row in ignored[:3])]
        words = {"controller": "\n".join(lines)}
        return words | ({"its conditions cost": "\n".join(map(str, self.costs))} if self.costs else {})
