"""The command `armdyn tune`: chooses gains on a set of arms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import armdyn as ad
from armdyn.arguments import one_of
from armdyn.cli import interrupts
from armdyn.cli.console import Answer, facts_table, judged, working
from armdyn.cli.invocation import flag_of, is_given
from armdyn.cli.options.groups import SOLVER, flag, group, option
from armdyn.cli.options.results import OutputOptions
from armdyn.cli.options.task import ArmOptions
from armdyn.cli.tracking.controllers import LoopOptions, option_of
from armdyn.cli.tracking.many import ArmsOptions, Range
from armdyn.errors import ProblemError
from armdyn.files import as_json, attributes

ROWS = "tuning.sqlite"
"""Rows, of a name of their own: another search replaces them."""
_CHOSEN_ON = 10
"""Most likely arms for choosing gains, at most half of all: the others are held out."""


@group("Controllers")
class FamilyOptions:
    """Parameters to tune; see `ControllerFamily` and `Ramps`."""

    controller: str = option("NAME", "pid, computed-torque or lqr.", default="pid")
    form: str = option("FORM", "For pid: computed_torque, torque or acceleration.", default="computed_torque")
    per_joint: bool = flag("For pid: tune gains of each joint, which takes a longer search.")
    ramp_range: Range = option("A,B", "Duration of the quintic ramp \\[s].", default="0.1,1.0")

    def family(self, robot: ad.Robot, q_goal: list[float]) -> ad.ControllerFamily:
        """The controllers to choose from.

        Raises:
            ProblemError: unknown, or it does not fit the robot.
        """
        from armdyn.studies.tuning.families import family_named

        one_of(self.controller, ("lqr", "computed-torque", "pid"), "--controller")
        for name in ("form", "per_joint"):
            if self.controller != "pid" and is_given(name):
                raise ProblemError(f"{flag_of(name)} is an option of --controller pid, not of {self.controller}")
        form: Any = self.form
        return family_named(self.controller, robot, q_goal, form=form, shared=not self.per_joint)


@group(SOLVER)
class TuningOptions:
    """Index to minimise, and extent of the search; see `TuneOptions`."""

    index: str = option("NAME", "settled, itae or ise: of the worst arm.", default="settled")
    overshoot: float = option("PART", "Past the goal at most, of the largest travel of a joint.", default=0.05)
    duration: float = option("S", "Simulated time of each arm \\[s].", default=1.5)
    tolerance: float = option(
        "RAD", "Largest error from the goal at which an arm has settled \\[rad or m].", default=0.005
    )
    members: int = option("N", "Controllers per generation and parameter.", default=8)
    generations: int = option("N", "Largest number of generations.", default=60)
    time_limit: float = option("S", "Time limit of the search \\[s].", default=300.0)
    search_seed: int = option("N", "Seed of the search.", default=0)
    held_out: int = option("N", "Random arms, or likely ones of a file, on which only the result is run.", default=100)

    def options(self) -> ad.TuneOptions:
        """The options of `tune`.

        Raises:
            ProblemError: something is out of range or unknown.
        """
        given: dict[str, Any] = {name: x for name, x in vars(self).items() if name not in ("search_seed", "held_out")}
        return ad.TuneOptions(**given, seed=self.search_seed)


def tune(
    task: ArmOptions,
    family: FamilyOptions,
    search: TuningOptions,
    loop: LoopOptions,
    arms: ArmsOptions,
    output: OutputOptions,
) -> Answer:
    """Tune gains, and the ramp, so that the worst of some arms settles soonest, in the simulated sampled loop.

    The gains are chosen on the corners of the ranges, three payloads with the least and the greatest friction, and
    then tested on random arms. ROBOT may be identified.toml of armdyn identify: the gains are chosen on half of its
    likely arms, at most 10, and tested on the others. After Ctrl-C the best gains so far are reported, and the same
    command continues. Exit code 0: all arms of the choice settle; 3: some do not.

    [dim]armdyn tune rr --payload 0.1006 --friction-range 0,0.06 --damping-range 0,0.003
    armdyn tune problem.toml --controller lqr
    armdyn tune results/identify-panda/identified.toml --q-start ready --q-goal 1,0.2,0.5,-1.5,0.3,2,-0.5
    armdyn tune rrr --payload 0.1006 --ramp-range 0.2,0.6 --controller computed-torque[/]
    """
    from armdyn.show.results import save_results

    model, (start, goal) = task.arm, task.ends()
    likely, options = task.likely, search.options()
    plants, half = arms.plants(model, likely), min(_CHOSEN_ON, (len(likely) + 1) // 2)
    first, others = (replace(plants, likely=own) for own in (likely[:half], likely[half:] or likely))
    folder = output.folder("tune", task.robot.robot, [ROWS, "reference.npz", "result.json"])
    folder.mkdir(parents=True, exist_ok=True)
    options = replace(options, file=folder / ROWS)
    interrupts.saved(f"controllers that were run are in {folder}: the same command goes on")
    with working(f"tuning {family.controller} for {model.name}") as progress:
        found = ad.tune(
            model, ad.Ramps(start, goal, family.ramp_range), family.family(model, goal),
            first.corners(model), others.arms(model, search.held_out), loop.joined(), options, progress,
        )  # fmt: skip
    summary = _summary(found)
    motion = replace(found.reference, model_hash=model.model_hash).save(folder / "reference.npz")
    files = save_results(folder, model, summary, [motion])
    words = {
        "status": found.message.partition(":")[0],
        "chosen": ", ".join(f"{name} {value:.5g}" for name, value in found.values.items()),
        "chosen on": str(found.training),
        "held out": "-" if found.held_out is None else str(found.held_out),
        **_ramp_too_fast(model, found),
        "to run it": _track_options(found, family),
        "controllers run": str(found.evaluations),
        "results": str(folder),
    }
    shown = facts_table(f"{model.name}: {family.controller}, tuned", words)
    return judged(summary, shown, usable=bool(summary["success"]), files=files)


def _ramp_too_fast(model: ad.Robot, found: ad.Tuned) -> dict[str, str]:
    """The velocity limit that the chosen ramp exceeds most, and the shortest ramp that exceeds none."""
    import numpy as np

    parts = np.abs(found.reference.v).max(axis=0) / model.limits.velocity
    most = int(np.argmax(parts))
    if parts[most] <= 1:
        return {}
    least = np.ceil(1e4 * parts[most] * found.reference.duration) / 1e4
    name = model.joint_names[most]
    return {
        "velocity limits": f"the ramp takes {name} to {100 * parts[most]:.4g} % of its own; from {least:.4f} s on a "
        f"ramp exceeds none: --ramp-range {least:.4f},{max(1.0, np.ceil(2 * least)):g}"
    }


def _track_options(found: ad.Tuned, family: FamilyOptions) -> str:
    """The chosen numbers as options of `armdyn track`; in Python where it has none for them."""
    from armdyn.control.laws.registry import CONTROLLERS

    numbers = {name: f"{value:.6g}" for name, value in found.values.items()}
    ramp, kind = numbers.pop("ramp"), CONTROLLERS[family.controller]
    if numbers.keys() != kind.settings.keys():
        return repr(found.controller)
    form = f" --form {family.form}" if kind.forms else ""
    given = f"--{option_of(family.controller)} {','.join(numbers[name] for name in kind.settings)}"
    return f"armdyn track … --ramp {ramp} --controller {family.controller}{form} {given}"


def _summary(found: ad.Tuned) -> dict[str, object]:
    """The result as JSON; infinite numbers are None."""
    return {
        "success": found.training.settled == found.training.count,
        **attributes(found, "status", "message", "values", "evaluations"),
        "controller": repr(found.controller),
        "training": as_json(vars(found.training)),
        "held_out": found.held_out and as_json(vars(found.held_out)),
    }
