"""Assemble the estimate from a fit: the robot, its parameters with confidence, and the measured combinations."""

from collections.abc import Iterator

import numpy as np

from armdyn.arrays import Array
from armdyn.identification.equations import Equations
from armdyn.identification.estimate import Estimate, Estimated
from armdyn.identification.fitting import Fit
from armdyn.identification.unknowns import parameters_of
from armdyn.models.robots.arm import payload_inertia
from armdyn.models.robots.robot import Robot

BODY = (
    *(("mass", "kg"), ("com x", "m"), ("com y", "m"), ("com z", "m")),
    *((f"I{axes}", "kg m²") for axes in ("xx", "yy", "zz", "xy", "xz", "yz")),
)
"""Parameters of a body, its inertia about its centre of mass."""

_TORQUE = ("N m", "N")
_UNITS = {"armature": ("kg m²", "kg"), "damping": ("N m s/rad", "N s/m"), "coulomb": _TORQUE, "offset": _TORQUE}
"""Units of a joint that turns, and of one that slides."""
_DIFFERENCE = 1e-5
"""Step of the derivatives of a body's numbers by its relative unknowns."""


def assembled(robot: Robot, equations: Equations, fit: Fit, covariance: Array) -> Estimate:
    """The estimate of a fit.

    Args:
        robot: the prior, with its payload.
        equations: the fitted equations.
        fit: their fit.
        covariance: of the unknowns, by the prior's own width and the patterns, shape (p, p).
    """
    *_, offset = equations.unknowns.numbers(fit.x)
    combinations = equations.structural_rank
    values = np.linalg.eigvalsh(fit.normal.matrix)[::-1][:combinations]
    return Estimate(
        robot=equations.robot_at(fit.x),
        offset=offset,
        parameters=tuple(_parameters(robot, equations, fit, covariance)),
        noise=fit.noise,
        weight=fit.weight,
        combinations=combinations,
        measured_combinations=int(np.sum(values > fit.weight)),
        condition=float(np.sqrt(values[0] / max(values[-1], 1e-300))),
        covariance=covariance,
        equations=equations,
        fit=fit,
    )


def _numbers(equations: Equations, parameters: Array) -> Array:
    """Numbers of all bodies in the order of `BODY`, shape (10 bodies,), of their dynamic parameters."""
    rows = np.zeros((len(parameters), len(BODY)))
    for row, own in zip(rows, parameters, strict=True):
        if own[0]:
            mass, centre, tensor = equations.inertia(own)
            row[:] = [mass, *centre, *np.diag(tensor), *tensor[np.triu_indices(3, 1)]]
    return rows.ravel()


def _given(robot: Robot, equations: Equations) -> Array:
    """Dynamic parameters of the unknown bodies as the robot has them, shape (bodies, 10)."""
    if equations.what == "payload" and robot.payload is not None:
        frame = robot.frame_of(robot.payload)
        return np.array([frame.placement.act(payload_inertia(robot.payload)).toDynamicParameters()])
    return equations.replaced


def _parameters(robot: Robot, equations: Equations, fit: Fit, covariance: Array) -> Iterator[Estimated]:
    unknowns = equations.unknowns
    spread = np.linalg.inv(unknowns.divergence_near(fit.x).hessian) / max(1.0, fit.weight)
    joints = list(zip(robot.joint_names, robot.slides, strict=True))
    bodies = ["payload"] if equations.what == "payload" else [robot.joint_names[j] for j in unknowns.joints]
    labels = [(f"{what} of {body}", unit) for body in bodies for what, unit in BODY]
    prior = [_numbers(equations, _given(robot, equations))]
    before = (robot.model.armature, *robot.friction.per_joint(robot.nv), np.zeros(robot.nv))
    for kind, own, found in zip(_UNITS, before, unknowns.numbers(fit.x), strict=True):
        if found.size:
            prior.append(own)
            labels += [(f"{kind} of {joint}", _UNITS[kind][bool(slides)]) for joint, slides in joints]

    def at(x: Array) -> Array:
        return np.concatenate([_numbers(equations, parameters_of(unknowns.bodies(x))), *unknowns.numbers(x)])

    steps = _DIFFERENCE * np.eye(fit.x.size)
    gradients = np.array([at(fit.x + step) - at(fit.x - step) for step in steps]).T / (2 * _DIFFERENCE)
    variance, width = (
        np.maximum(np.einsum("kp,pq,kq->k", gradients, one, gradients), 1e-300) for one in (covariance, spread)
    )
    columns = np.concatenate(prior), at(fit.x), np.sqrt(variance), np.maximum(0.0, 1 - variance / width)
    for (name, unit), row in zip(labels, np.column_stack(columns).tolist(), strict=True):
        yield Estimated(name, unit, *row)
