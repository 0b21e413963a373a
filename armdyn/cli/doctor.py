"""The command `armdyn doctor`: checks the installation, or a robot."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Iterable
from pathlib import Path
from types import NoneType
from typing import Literal

import armdyn as ad
from armdyn.cli.console import Answer, Shown, escape, facts_table, judged, table, working
from armdyn.cli.options.groups import argument, flag, option
from armdyn.cli.options.robot import PartOptions
from armdyn.cli.repair import repaired
from armdyn.cli.robots import Facts, which
from armdyn.errors import ProblemError
from armdyn.files import as_json
from armdyn.reprs import joint_unit

_PACKAGES = ("armdyn", "pin", "casadi", "numpy", "scipy", "yourdfpy", "meshcat", "matplotlib")
_AGREE = 1e-10
"""Relative difference of two computations of an acceleration, some hundred operations of 1e-16 apart."""


def doctor(
    *,
    robot: str | None = argument(
        "ROBOT", "r, rr, rrr, a URDF file or a library name; none: the installation.", default=None
    ),
    part: PartOptions,
    policy: bool = flag("Show every tuned number of a minimum-time solve of ROBOT, and its reason."),
    build: bool = flag(
        "Build the machine code that minimum times of ROBOT use, up to 20 s once; else the first solve has it built in "
        "the background."
    ),
    repair: bool = flag(
        "Repair a URDF: the least change that makes each inertia physical, package folders, joints to lock, the "
        "tip, missing limits. Nothing is written without --out."
    ),
    density: float | None = option(
        "KG/M3", "With --repair: estimate the inertias of links without mass from their shapes, such as 2700."
    ),
    large: Literal["no", "nearest", "power-of-ten"] = option(
        "HOW",
        "With --repair: write repairs that change a moment by a factor of ten or more, too: nearest, or power-of-ten "
        "(one entry, as of a lost decimal point).",
        default="no",
    ),
    out: Path | None = option("FILE", "With --repair: write the URDF with physical inertias, marked as repaired."),
) -> Answer:
    """Check the installation, or a robot as armdyn reads it.

    [dim]armdyn doctor
    armdyn doctor panda
    armdyn doctor panda --build
    armdyn doctor panda --policy
    armdyn doctor my_arm.urdf
    armdyn doctor my_arm.urdf --repair --out mended.urdf
    armdyn doctor my_arm.urdf --repair --density 2700 --out guessed.urdf[/]
    """
    if not repair and (out is not None or density is not None or large != "no"):
        given = "--out" if out is not None else "--density" if density is not None else "--large"
        raise ProblemError(f"{given} belongs to --repair, which is not given")
    if repair:
        return repaired(robot, part, out, density, large)
    shown: list[Shown]
    if robot is None:
        arm, status = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), ad.Payload(mass=0.1)), "healthy"
        facts = _installation()
        shown = [facts_table("armdyn's installation", {k: str(v) for k, v in facts.items()})]
    else:
        arm, status = part.read(robot), "read"
        joints = _joints(arm)
        remarks = _remarks(arm, joints)
        facts = {"robot": arm.name, "tip": arm.tip, "joints": joints, "remarks": remarks}
        shown = [_table(arm, joints), *(f"[yellow]note:[/] {escape(remark)}" for remark in remarks)]
    if policy:
        rows = _policy(arm)
        facts["policy"] = policy_facts(rows)
        shown.append(policy_table(arm.name, rows))
    if build:
        from armdyn.optimal.curves.program import torque_equations

        started = time.perf_counter()
        with working(f"machine code of {arm.name}"):
            torque_equations(ad.Dynamics(arm, free_last_body=True), True)
        facts["built"] = seconds = round(time.perf_counter() - started, 1)
        shown.append(f"machine code of {escape(arm.name)} is there, after {seconds:.1f} s")
    if not arm.has_dynamics:
        return judged(facts | {"success": True, "status": "no_dynamics"}, *shown, usable=True)
    facts["dynamics_error"] = error = _disagreement(arm)
    verdict = "[green]agree[/]" if error <= _AGREE else "[bold red]DISAGREE[/]"
    shown.append(f"CasADi and Pinocchio dynamics {verdict} (largest relative difference {error:.1e})")
    facts |= {"success": error <= _AGREE, "status": status if error <= _AGREE else "dynamics_disagree"}
    return judged(facts, *shown, usable=error <= _AGREE)


def _installation() -> Facts:
    from importlib.metadata import version

    from armdyn.dynamics.symbolic import bridge_versions

    return {
        "python": platform.python_version(),
        "cores": os.cpu_count() or 1,
        **{name: version(name) for name in _PACKAGES},
        "bridge built with": bridge_versions(),
    }


def _disagreement(robot: ad.Robot) -> float:
    """Largest relative difference of forward dynamics, CasADi against Pinocchio, at ten seeded states."""
    import numpy as np
    import pinocchio as pin

    dynamics, random = ad.Dynamics(robot), np.random.default_rng(0)
    data, worst = robot.model.createData(), 0.0
    for q, v, tau in random.uniform(-1, 1, (10, 3, robot.nv)):
        reference = pin.aba(robot.model, data, robot.configuration(q), v, tau - robot.friction.torque(v))
        difference = np.abs(dynamics.aba(q, v, tau) - reference)
        worst = max(worst, float(np.max(difference / np.maximum(1, np.abs(reference)))))
    return worst


PolicyRow = tuple[str, object, str, str, str]
"""Name, value, unit, reason and cases that it was chosen on."""


def _policy(robot: ad.Robot) -> list[PolicyRow]:
    """The policy of a robot's minimum-time problems without path constraints, for all poses."""
    import numpy as np

    from armdyn.optimal.problem.policy.policy import Policy

    lower, upper = robot.limits.position_lower, robot.limits.position_upper
    start = np.clip(np.zeros(robot.nv), lower, upper)
    goal = np.where(start + 0.1 <= upper, np.minimum(start + 0.1, upper), np.maximum(start - 0.1, lower))
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal)
    return list(Policy.of(problem).rows())


def policy_facts(rows: Iterable[PolicyRow]) -> list[Facts]:
    """A policy as JSON; values without a JSON type become text."""
    names = ("name", "value", "unit", "reason", "cases")
    plain = (bool, int, float, str, NoneType)
    return [
        dict(zip(names, (name, value if isinstance(value, plain) else str(value), *others), strict=True))
        for name, value, *others in rows
    ]


def policy_table(name: str, rows: Iterable[PolicyRow]) -> Shown:
    """A policy as a table.

    Args:
        name: the robot's.
        rows: of every number.
    """
    lines = []
    for what, value, unit, reason, cases in rows:
        shown = "none" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
        shown = shown if unit == "-" or value is None else f"{shown} {unit}"
        lines.append((what, shown, f"{reason}\nchosen on: {cases}"))
    return table(f"{name}: policy of minimum time", ("number", "value", "meaning and reason"), lines)


def _joints(robot: ad.Robot) -> list[Facts]:
    limits, model = robot.limits, robot.model
    applied = robot.friction.per_joint(robot.nv)
    return [
        {
            "name": name,
            **{limit: as_json(row[i]) for limit, row in limits.rows.items()},
            "passive": name in robot.passive,
            "armature": float(model.armature[i]),
            "damping": float(model.damping[i]),
            "friction": float(model.upperDryFrictionLimit[i]),
            "damping_applied": float(applied[0][i]),
            "friction_applied": float(applied[1][i]),
        }
        for i, name in enumerate(robot.joint_names)
    ]


def _remarks(robot: ad.Robot, joints: list[Facts]) -> list[str]:
    from armdyn.models.robots.plausibility import doubts

    findings = {
        "no torque limit: minimum time needs --effort-limit, or --passive for a joint without a motor": [
            j for j in joints if j["effort_upper"] is None
        ],
        "no motor: other joints swing it": [j for j in joints if j["passive"]],
        "friction is applied": [j for j in joints if j["damping_applied"] or j["friction_applied"]],
        "friction that the URDF has is not applied: --damping urdf --friction urdf of mintime and pid take it": [
            j
            for j in joints
            if (j["damping"] and not j["damping_applied"]) or (j["friction"] and not j["friction_applied"])
        ],
    }
    places: dict[str, list[str]] = {}
    for name, value in robot.locked.items():
        places.setdefault(f"{value:g}", []).append(name)
    remarks = [f"locked at {place}: {', '.join(names)}" for place, names in places.items()]
    if robot.repaired:
        remarks.insert(0, f"repaired model: the inertia of {robot.repaired} is not as published")
    for finding, found in findings.items():
        if found:
            remarks.append(f"{finding} ({which([j['name'] for j in found], robot.joint_names)})")
    return [*remarks, *doubts(robot)]


_UNITS = {
    "position": ("rad", "m"),
    "velocity": ("rad/s", "m/s"),
    "torque": ("N m", "N"),
    "armature": ("kg m²", "kg"),
    "damping": ("N m s/rad", "N s/m"),
    "friction": ("N m", "N"),
}
"""Of joints that turn, and of those that slide."""


def _table(robot: ad.Robot, joints: list[Facts]) -> Shown:
    more = [what for what in ("armature", "damping", "friction") if any(joint[what] for joint in joints)]
    names = ("position", "velocity", "torque", *more)
    heads = ["joint", *(f">{name}\n[{joint_unit(robot.slides, *_UNITS[name])}]" for name in names)]

    rows = [
        (joint["name"], *limits, *(f"{joint[what]:.4g}" for what in more))
        for joint, limits in zip(joints, robot.limits.words(), strict=True)
    ]
    return table(f"{robot.name}: {robot.nv} joints, tip {robot.tip!r}", heads, rows)
