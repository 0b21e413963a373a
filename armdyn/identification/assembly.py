"""Assemble the estimate from a fit: the robot, its parameters with confidence, and the measured combinations."""

from collections.abc import Callable, Iterator

import numpy as np
import pinocchio as pin

from armdyn.arrays import Array
from armdyn.identification.equations import Equations, in_tip
from armdyn.identification.estimate import Estimate, Estimated, Judged
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


def assembled(
    robot: Robot,
    equations: Equations,
    fit: Fit,
    covariance: Array,
    judged: Judged | None,
    unmoved: tuple[str, ...],
    patterns: tuple[str, ...],
) -> Estimate:
    """The estimate of a fit.

    Args:
        robot: the prior, with its payload.
        equations: the fitted equations.
        fit: their fit.
        covariance: of the unknowns, by the prior's own width and the patterns, shape (p, p).
        judged: torque errors on data held out.
        unmoved: joints that hardly move.
        patterns: sentences on those that the residuals show.
    """
    *_, offset = equations.unknowns.numbers(fit.x)
    combinations = equations.structural_rank
    values = np.linalg.eigvalsh(fit.normal.matrix)[::-1][:combinations]
    return Estimate(
        robot=equations.robot_at(fit.x),
        offset=offset,
        parameters=tuple(_parameters(robot, equations, fit, covariance)),
        judged=judged,
        noise=fit.noise,
        weight=fit.weight,
        combinations=combinations,
        measured_combinations=int(np.sum(values > fit.weight)),
        condition=float(np.sqrt(values[0] / max(values[-1], 1e-300))),
        unmoved=unmoved,
        warnings=patterns,
        equations=equations,
        fit=fit,
    )


def _numbers(robot: Robot, equations: Equations, parameters: Array) -> Array:
    """Numbers of all bodies, shape (bodies, 10), in the order of `BODY`, of their dynamic parameters."""
    rows = []
    for own in parameters:
        if own[0] == 0:
            mass, centre, tensor = 0.0, np.zeros(3), np.zeros((3, 3))
        elif equations.what == "payload":
            mass, centre, tensor = in_tip(robot, own)
        else:
            body = pin.Inertia.FromDynamicParameters(own)
            mass, centre, tensor = float(body.mass), np.array(body.lever), np.array(body.inertia)
        rows.append(np.concatenate([[mass], centre, np.diag(tensor), tensor[np.triu_indices(3, 1)]]))
    return np.array(rows).reshape(-1, 10)


def _given(robot: Robot, equations: Equations) -> Array:
    """Dynamic parameters of the unknown bodies as the robot has them, shape (bodies, 10)."""
    if equations.what == "payload" and robot.payload is not None:
        frame = robot.frame_of(robot.payload)
        return np.array([frame.placement.act(payload_inertia(robot.payload)).toDynamicParameters()])
    return equations.replaced


def _parameters(robot: Robot, equations: Equations, fit: Fit, covariance: Array) -> Iterator[Estimated]:
    unknowns = equations.unknowns
    hessian = unknowns.divergence_near(fit.x).hessian
    spread = np.linalg.inv(hessian) / max(1.0, fit.weight)

    def estimated(name: str, unit: str, prior: float, value: float, gradient: Array) -> Estimated:
        variance, before = (np.maximum(gradient @ one @ gradient, 1e-300) for one in (covariance, spread))
        deviation, seen = np.sqrt(variance), max(0.0, 1 - float(variance / before))
        return Estimated(
            name=name, unit=unit, prior=float(prior), value=float(value), deviation=float(deviation), seen=float(seen)
        )

    def row(at: int, size: float) -> Array:
        return np.asarray(np.eye(fit.x.size)[at] * size)

    def at(x: Array) -> Array:
        return _numbers(robot, equations, parameters_of(unknowns.bodies(x)))

    prior, values = _numbers(robot, equations, _given(robot, equations)), at(fit.x)
    jacobian = _jacobian(at, fit.x, 10 * len(unknowns.joints))
    names = ["payload"] if equations.what == "payload" else robot.joint_names
    for b in range(len(unknowns.joints)):
        for k, (what, unit) in enumerate(BODY):
            yield estimated(f"{what} of {names[b]}", unit, prior[b, k], values[b, k], jacobian[b, k])
    start, found = 10 * len(unknowns.joints), unknowns.numbers(fit.x)
    priors = (robot.model.armature, *robot.friction.per_joint(robot.nv), np.zeros(robot.nv))
    scales = (unknowns.armature, unknowns.damping, unknowns.coulomb, unknowns.offset)
    for kind, before, after, sizes in zip(_UNITS, priors, found, scales, strict=True):
        for j in range(sizes.size):
            unit = _UNITS[kind][bool(robot.slides[j])]
            yield estimated(f"{kind} of {robot.joint_names[j]}", unit, before[j], after[j], row(start + j, sizes[j]))
        start += sizes.size


def _jacobian(function: Callable[[Array], Array], x: Array, count: int) -> Array:
    """Derivatives by the first unknowns, the others' zero, shape (bodies, 10, p)."""
    jacobian = np.zeros((*function(x).shape, x.size))
    for i in range(count):
        step = np.zeros(x.size)
        step[i] = _DIFFERENCE
        jacobian[..., i] = (function(x + step) - function(x - step)) / (2 * _DIFFERENCE)
    return jacobian
