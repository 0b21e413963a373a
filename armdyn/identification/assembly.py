"""From a fit to the estimate: the robot, its numbers with their confidence, and what the log tells."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from armdyn.identification.equations import Equations
from armdyn.identification.estimate import Estimate, Estimated, Judged
from armdyn.identification.fitting import Fit
from armdyn.identification.unknowns import parameters_of
from armdyn.models.robots.robot import Robot
from armdyn.models.values.spec import Payload

Array = NDArray[np.float64]

BODY = (
    *(("mass", "kg"), ("com x", "m"), ("com y", "m"), ("com z", "m")),
    *((f"I{axes}", "kg m²") for axes in ("xx", "yy", "zz", "xy", "xz", "yz")),
)
"""Numbers of a body, its inertia about its centre of mass."""

_DIFFERENCE = 1e-5
"""Step of the derivatives of a body's numbers by its relative unknowns."""


def assembled(
    robot: Robot, equations: Equations, fit: Fit, judged: Judged | None, unmoved: tuple[str, ...]
) -> Estimate:
    """The estimate of a fit.

    Args:
        robot: the prior, with its payload.
        equations: that were fitted.
        fit: of them.
        judged: torque errors on data held out.
        unmoved: joints that hardly move.
    """
    *_, offset = equations.unknowns.numbers(fit.x)
    combinations = equations.structural_rank
    values = np.linalg.eigvalsh(fit.normal.matrix)[::-1][:combinations]
    return Estimate(
        robot=_identified(robot, equations, fit.x),
        offset=offset,
        parameters=tuple(_parameters(equations, fit)),
        judged=judged,
        noise=fit.noise,
        weight=fit.weight,
        combinations=combinations,
        measured_combinations=int(np.sum(values > fit.weight)),
        condition=float(np.sqrt(values[0] / max(values[-1], 1e-300))),
        unmoved=unmoved,
        equations=equations,
        fit=fit,
    )


def _identified(robot: Robot, equations: Equations, x: Array) -> Robot:
    armature, damping, coulomb, _ = equations.unknowns.numbers(x)
    bodies = parameters_of(equations.unknowns.bodies(x))
    if equations.what == "payload":
        mass, centre, tensor = _in_tip(robot, bodies[0])
        moments = (tensor + tensor.T) / 2
        robot = robot.with_payload(Payload(mass=mass, com=centre, inertia=moments))
    elif equations.what == "all":
        own = {joint: body.tolist() for joint, body in zip(robot.joint_names, bodies, strict=True)}
        robot = robot.with_inertias(own).with_armature(armature)
    return robot.with_friction(damping, coulomb, equations.width)


def _in_tip(robot: Robot, parameters: Array) -> tuple[float, Array, Array]:
    """Mass, centre and inertia about it in the tip's frame, of a body's parameters in the frame of its joint."""
    body = robot.frame_of(Payload(mass=0)).placement.inverse().act(pin.Inertia.FromDynamicParameters(parameters))
    return float(body.mass), np.array(body.lever), np.array(body.inertia)


def _numbers(robot: Robot, equations: Equations, x: Array) -> Array:
    """Numbers of all bodies, shape (bodies, 10), in the order of `BODY`."""
    rows = []
    for own in parameters_of(equations.unknowns.bodies(x)):
        if equations.what == "payload":
            mass, centre, tensor = _in_tip(robot, own)
        else:
            body = pin.Inertia.FromDynamicParameters(own)
            mass, centre, tensor = float(body.mass), np.array(body.lever), np.array(body.inertia)
        rows.append(np.concatenate([[mass], centre, np.diag(tensor), tensor[np.triu_indices(3, 1)]]))
    return np.array(rows).reshape(-1, 10)


def _parameters(equations: Equations, fit: Fit) -> Iterator[Estimated]:
    unknowns, robot, zero = equations.unknowns, equations.robot, np.zeros(fit.x.size)
    _, hessian = unknowns.derivatives(fit.x)
    spread = np.linalg.inv(hessian) / fit.weight

    def estimated(name: str, unit: str, prior: float, value: float, gradient: Array) -> Estimated:
        variance, before = (np.maximum(gradient @ one @ gradient, 1e-300) for one in (fit.covariance, spread))
        deviation, seen = np.sqrt(variance), max(0.0, 1 - float(variance / before))
        return Estimated(
            name=name, unit=unit, prior=float(prior), value=float(value), deviation=float(deviation), seen=float(seen)
        )

    def row(at: int, size: float) -> Array:
        return np.asarray(np.eye(fit.x.size)[at] * size)

    prior, values = (_numbers(robot, equations, x) for x in (zero, fit.x))
    slopes = _slopes(lambda x: _numbers(robot, equations, x), fit.x, 10 * len(unknowns.joints))
    names = ["payload"] if equations.what == "payload" else robot.joint_names
    for b in range(len(unknowns.joints)):
        for k, (what, unit) in enumerate(BODY):
            yield estimated(f"{what} of {names[b]}", unit, prior[b, k], values[b, k], slopes[b, k])
    at, priors, found = 10 * len(unknowns.joints), unknowns.numbers(zero), unknowns.numbers(fit.x)
    scales = (unknowns.armature, unknowns.damping, unknowns.coulomb, unknowns.offset)
    for kind, before, after, sizes in zip(
        ("armature", "damping", "coulomb", "offset"), priors, found, scales, strict=True
    ):
        for j in range(sizes.size):
            unit = _unit(kind, bool(robot.slides[j]))
            yield estimated(f"{kind} of {robot.joint_names[j]}", unit, before[j], after[j], row(at + j, sizes[j]))
        at += sizes.size


def _unit(kind: str, slides: bool) -> str:
    units = {"armature": ("kg m²", "kg"), "damping": ("N m s/rad", "N s/m")}
    return units.get(kind, ("N m", "N"))[slides]


def _slopes(function: Callable[[Array], Array], x: Array, count: int) -> Array:
    """Derivatives by the first unknowns, the others' zero, shape (bodies, 10, p)."""
    slopes = np.zeros((*function(x).shape, x.size))
    for i in range(count):
        step = np.zeros(x.size)
        step[i] = _DIFFERENCE
        slopes[..., i] = (function(x + step) - function(x - step)) / (2 * _DIFFERENCE)
    return slopes
