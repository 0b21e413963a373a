"""Repairs of a URDF in words and as JSON, for `armdyn doctor --repair`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from armdyn import models
from armdyn.cli.console import NOT_USABLE, Answer, Shown, done, escape, table
from armdyn.cli.invocation import in_options
from armdyn.cli.options.robot import PartOptions
from armdyn.errors import ProblemError
from armdyn.files import attributes, probe_folder, write_whole

if TYPE_CHECKING:
    from armdyn.models.reading.nearest_inertia import Large


def repaired(robot: str | None, part: PartOptions, out: Path | None, density: float | None, large: Large) -> Answer:
    """The faults and gaps of a URDF; with `out` write the URDF with physical inertias.

    Args:
        robot: its file, or a name of the library.
        part: folders of its packages.
        out: the file to write; None: nothing is written.
        density: see `repair_urdf`.
        large: likewise.

    Raises:
        ArmdynError: the robot has no URDF, or the file cannot be written.
    """
    from armdyn.models.robots.plausibility import doubts

    file = _urdf_of(robot)
    target = None
    if out is not None:
        if out.exists() and out.samefile(file):
            raise ProblemError(f"--out is {out}, the URDF itself, which is never overwritten; name another file")
        target = probe_folder(out.parent, out.name) / out.name
    found = models.repair_urdf(file, package_dirs=tuple(part.package_dir or ()), density=density, large=large)
    changes, written = len(found.inertias) > len(found.unwritten) or bool(found.estimates), []
    if target is not None and changes:
        written = [write_whole(target, found.text.encode())]
    shown: list[Shown] = [_table(found.inertias)] if found.inertias else []
    shown += [_estimates(found.estimates)] if found.estimates else []
    if not (shown or found.without_mass or found.refusal):
        shown = ["all inertias are physical"]
    remarks = []
    if not found.refusal:
        remarks = doubts(models.Robot.from_urdf_string(found.text, source=found.source, lock=found.lock, arm=found.arm))
    shown += map(escape, [*_proposals(found), *remarks])
    if written:
        shown.append(f'{escape(str(written[0]))}  (results of it say "repaired model")')
    elif out is not None:
        shown.append("nothing is written" if found.inertias else "nothing to change: nothing is written")
    status = "repairable" if found.inertias or found.estimates else "no_inertias" if found.without_mass else "physical"
    made = done(status, _facts(found) | {"remarks": remarks}, *shown, files=written)
    if not found.refusal:
        return made
    failure = {"success": False, "status": "refused", "message": in_options(found.refusal)}
    return replace(made, facts={**made.facts, **failure}, code=NOT_USABLE)


def _urdf_of(robot: str | None) -> Path:
    """The URDF file of a robot's name.

    Raises:
        ArmdynError: the robot has no URDF.
    """
    from armdyn.models.robots.library import library_arm
    from armdyn.models.robots.source import RobotSource

    if robot is None:
        raise ProblemError("--repair needs a URDF; name the file: armdyn doctor FILE --repair")
    source = RobotSource.named(robot)
    file = library_arm(robot)[0] if source.format == "library" else source.file
    if file is None or source.format == "mjcf":
        raise ProblemError(f"--repair needs a URDF; {robot} has none")
    return file


def _facts(found: models.UrdfRepair) -> dict[str, object]:
    """The repair as JSON."""
    own = ("link", "fault", "mass", "change", "before", "after", "moments_before", "moments_after")
    return {
        "robot": found.source,
        "inertias": [attributes(one, *own) for one in found.inertias],
        "estimates": [attributes(one, "link", "shapes", "mass", "com", "moments") for one in found.estimates],
        **attributes(found, "unwritten", "without_mass", "packages", "lock", "arm", "tip"),
        **attributes(found, "without_effort", "without_velocity"),
    }


def _table(repairs: tuple[models.InertiaRepair, ...]) -> Shown:
    """Principal moments of the changed inertias, before and after."""
    rows = []
    for one in repairs:
        before, after = (" ".join(f"{x:.4g}" for x in each) for each in (one.moments_before, one.moments_after))
        why = one.fault.partition(":")[0] or "thin body, rounded in the file"
        rows.append((one.link, before, after, f"{100 * one.change:.3g} %", why))
    heads = ("link", ">principal moments in the file\n[kg m²]", ">nearest physical\n[kg m²]", ">change", "fault")
    return table("nearest physical inertias (masses and centres of mass stay)", heads, rows)


def _estimates(estimates: tuple[models.InertiaEstimate, ...]) -> Shown:
    """Inertias from shapes and a density."""
    rows = [(one.link, f"{one.mass:.4g}", " ".join(f"{x:.4g}" for x in one.moments), one.shapes) for one in estimates]
    heads = ("link", ">mass\n[kg]", ">principal moments\n[kg m²]", "as a solid of its")
    return table("inertias from shapes and the density: a guess, since links are hollow or full of motors", heads, rows)


def _proposals(found: models.UrdfRepair) -> list[str]:
    """Lines about all faults but inertias, with the options that repair them."""
    from armdyn.models.reading.meshes import mesh_folders

    looked_in = mesh_folders(Path(found.source), ())
    lines = []
    for one in (each for each in found.inertias if each.large):
        other = ""
        if one.power_of_ten is not None:
            key, tensor = one.power_of_ten
            value = tensor["xyz".index(key[1]), "xyz".index(key[2])]
            other = f"; a lost decimal point? {key} = {value:.4g} alone is physical, too: --large power-of-ten"
        large = "changes moments by a factor of ten or more, so that only --large nearest writes it"
        lines.append(f"{one.link}: the nearest inertia {large}{other}")
    for name, folder in found.packages.items():
        there = "is in no folder above; --package-dir DIR" if folder is None else f"is in {folder}"
        option = "" if folder is None or folder in looked_in else f"; --package-dir {folder}"
        lines.append(f"package {name!r} {there}{option}")
    if found.lock:
        locks = " ".join(f"--lock {name}={q:g}" for name, q in found.lock.items())
        lines.append(f"joints of a gripper, or that others mimic: {locks}")
    if found.arm:
        lines.append(f"several chains move; the longest: --arm {','.join(found.arm)}")
    lines += [f"tip: {found.tip}"] if found.tip else []
    if found.without_effort:
        held = ", ".join(f"{name} {torque:.4g}" for name, torque in found.without_effort.items())
        given = ",".join(f"{name}=…" for name in found.without_effort)
        lines.append(f"no torque limit: --effort-limit {given}; holding still takes up to [N m or N]: {held}")
    if found.without_velocity:
        lines.append(f"no velocity limit: --velocity-limit ({', '.join(found.without_velocity)})")
    return lines + (in_options(f"still refused: {found.refusal}").split("\n") if found.refusal else [])
