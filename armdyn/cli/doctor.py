"""The command that looks at the installation, or at a robot, and says what is wrong."""

import os
import platform
from importlib.metadata import version
from typing import Annotated

import numpy as np
import typer
from rich.markup import escape
from rich.table import Table

from armdyn.cli.arguments import Json, Lock, Part, load_robot
from armdyn.cli.console import NOT_CERTIFIED, answering, console, facts_table
from armdyn.models import Payload, Robot

_PACKAGES = ("armdyn", "pin", "casadi", "numpy", "scipy", "yourdfpy", "meshcat", "matplotlib")


def doctor(
    robot: Annotated[
        str | None,
        typer.Argument(metavar="[ROBOT]", help="r, rr, rrr, a URDF file or a library name; none: the installation."),
    ] = None,
    lock: Lock = None,
    part: Part = None,
    json: Json = False,
) -> None:
    """Check the installation, or what armdyn reads from a robot's URDF.

    [dim]armdyn doctor
    armdyn doctor panda
    armdyn doctor my_arm.urdf[/]
    """
    with answering(json) as answer:
        if robot is None:
            facts = _installation()
            answer.facts |= {"success": True, "status": "healthy", "files": [], **facts}
            if not json:
                console.print(facts_table("armdyn's installation", {k: str(v) for k, v in facts.items()}))
        else:
            arm = load_robot(robot, lock=lock, part=part)
            joints, remarks = _joints(arm), _remarks(arm)
            answer.facts |= {
                "success": True, "status": "read", "files": [], "robot": arm.name, "tip": arm.tip,
                "joints": joints, "remarks": remarks,
            }  # fmt: skip
            if not json:
                _show(arm, joints, remarks)
        error = _disagreement(load_robot("rr", Payload(mass=0.1)) if robot is None else arm)
        answer.facts["dynamics_error"] = error
        if error > 1e-10:
            answer.facts |= {"success": False, "status": "dynamics_disagree"}
            answer.code = NOT_CERTIFIED
        if not json:
            verdict = "[green]agree[/]" if error <= 1e-10 else "[bold red]DISAGREE[/]"
            console.print(f"CasADi and Pinocchio dynamics {verdict} (largest relative difference {error:.1e})")


def _installation() -> dict[str, object]:
    from armdyn.dynamics.symbolic import bridge_versions

    return {
        "python": platform.python_version(),
        "cores": os.cpu_count() or 1,
        **{name: version(name) for name in _PACKAGES},
        "bridge built with": bridge_versions(),
    }


def _disagreement(robot: Robot) -> float:
    """Largest relative difference of forward dynamics, CasADi against Pinocchio, at ten seeded states."""
    from armdyn.dynamics import Dynamics, forward_dynamics

    dynamics, random = Dynamics(robot), np.random.default_rng(0)
    numeric, worst = forward_dynamics(robot), 0.0
    for q, v, tau in random.uniform(-1, 1, (10, 3, robot.nv)):
        reference = numeric(q, v, tau)
        difference = np.abs(dynamics.aba(q, v, tau) - reference)
        worst = max(worst, float(np.max(difference / np.maximum(1, np.abs(reference)))))
    return worst


def _number(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None


def _joints(robot: Robot) -> list[dict[str, object]]:
    limits, model = robot.limits, robot.model
    applied = [np.broadcast_to(np.asarray(x), robot.nv) for x in (robot.friction.damping, robot.friction.coulomb)]
    return [
        {
            "name": name,
            "position_lower": _number(limits.position_lower[i]),
            "position_upper": _number(limits.position_upper[i]),
            "velocity": _number(limits.velocity[i]),
            "effort_lower": _number(limits.effort_lower[i]),
            "effort_upper": _number(limits.effort_upper[i]),
            "armature": float(model.armature[i]),
            "damping": float(model.damping[i]),
            "friction": float(model.upperDryFrictionLimit[i]),
            "damping_applied": float(applied[0][i]),
            "friction_applied": float(applied[1][i]),
        }
        for i, name in enumerate(robot.joint_names)
    ]


def _remarks(robot: Robot) -> list[str]:
    joints = _joints(robot)
    findings = {
        "no torque limit: minimum time needs --effort-limit": [j for j in joints if j["effort_upper"] is None],
        "torque limit 0: minimum time needs --effort-limit": [j for j in joints if j["effort_upper"] == 0],
        "friction that the URDF has is applied": [j for j in joints if j["damping_applied"] or j["friction_applied"]],
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
    for finding, found in findings.items():
        if found:
            names = "all joints" if len(found) == len(joints) else ", ".join(str(j["name"]) for j in found)
            remarks.append(f"{finding} ({names})")
    return remarks


def _show(robot: Robot, joints: list[dict[str, object]], remarks: list[str]) -> None:
    title = escape(f"{robot.name}: {robot.nv} joints, tip {robot.tip!r}")
    table = Table(title=title, title_justify="left", box=None, header_style="bold", pad_edge=False)
    table.add_column("joint", overflow="fold")
    more = {"armature": "kg m²", "damping": "N m s/rad", "friction": "N m"}
    more = {what: unit for what, unit in more.items() if any(joint[what] for joint in joints)}
    columns = ["position\n[rad or m]", "velocity\n[rad/s]", "torque\n[N m]"]
    for column in [*columns, *(f"{what}\n[{unit}]" for what, unit in more.items())]:
        table.add_column(escape(column), justify="right")

    def show(x: object) -> str:
        return "-" if x is None else f"{x:.4g}"

    def between(joint: dict[str, object], what: str) -> str:
        lower, upper = joint[f"{what}_lower"], joint[f"{what}_upper"]
        if lower is None or upper is None:
            return "-" if lower is upper else f"{show(lower)} … {show(upper)}"
        return f"±{show(upper)}" if -lower == upper else f"{show(lower)} … {show(upper)}"  # type: ignore[operator]

    for joint in joints:
        table.add_row(
            escape(str(joint["name"])),
            between(joint, "position"),
            show(joint["velocity"]),
            between(joint, "effort"),
            *(show(joint[what]) for what in more),
        )
    console.print(table)
    for remark in remarks:
        console.print(f"[yellow]note:[/] {escape(remark)}")
