"""Closed-loop simulation tick by tick, by the bridge's C++ loop."""

import ctypes
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.codegen.compiled import compiled_library
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.models.robots.robot import Robot
from armdyn.models.values.actuator_limits import ActuatorLimits

_library = cache(compiled_library)
"""Libraries, never unloaded: addresses of their functions are in use. Functions of the same source share one."""


class Plant(NamedTuple):
    """Forward dynamics with payload and friction as parameters, so that all payloads share one function."""

    function: ca.Function
    """a(q, v, tau, p)."""
    parameters: Array
    """p: ten dynamic parameters of the last joint's body; with friction also damping and Coulomb friction of every
    joint, and the width of its jump in every joint."""


def limited(plant: Plant, actuators: Sequence[ActuatorLimits]) -> Plant:
    """The plant with torques clipped to the motors' ranges in its state."""
    function = plant.function
    for own in actuators:
        q, v, tau, p = (ca.SX.sym(name, function.size1_in(i)) for i, name in enumerate(("q", "v", "tau", "p")))
        lower, upper = own.range(q, v)
        given = ca.fmin(ca.fmax(tau, lower), upper)
        function = ca.Function("limited", [q, v, tau, p], [function(q, v, given, p)])
    return plant._replace(function=function)


def plant_of(robot: Robot) -> Plant:
    """Plant of a robot."""
    friction = robot.friction
    smooth = Dynamics(robot.with_friction(0.0, 0.0) if friction.present else robot, free_last_body=True)
    if not friction.present:
        return Plant(smooth.functions["aba"], smooth.last_body)
    numbers = (smooth.last_body, *friction.per_joint(robot.nv), np.broadcast_to(friction.width, robot.nv))
    return Plant(_aba_with_friction(smooth), np.concatenate(numbers))


@built_once(maxsize=64)
def _aba_with_friction(dynamics: Dynamics) -> ca.Function:
    """Forward dynamics (q, v, tau, p) -> a, whose parameters p also hold damping, Coulomb friction and its width."""
    nv = dynamics.nv
    q, v, tau, p = (ca.SX.sym(name, size) for name, size in (("q", nv), ("v", nv), ("tau", nv), ("p", 10 + 3 * nv)))
    body, damping, coulomb, width = ca.vertsplit(p, [0, 10, 10 + nv, 10 + 2 * nv, 10 + 3 * nv])
    sign = 1 - 2 / (ca.exp(2 * v / width) + 1)  # tanh, in a third of its time
    friction = damping * v + coulomb * sign
    return ca.Function("aba_with_friction", [q, v, tau, p], [dynamics.functions["aba"](q, v, tau - friction, body)])


class Tables(NamedTuple):
    """Input arrays of the C++ loop but for its arms' parameters; see `_bridge/loop.hpp`."""

    rows: Array
    q_reference: Array
    start: Array
    first: Array
    lower: Array
    upper: Array
    integral_gain: Array
    noise: Array


class Driven(NamedTuple):
    """Simulated loop, tick by tick."""

    q: Array
    """Positions [rad or m], shape (ticks + 1, nv)."""
    v: Array
    """Velocities [rad/s or m/s], likewise."""
    tau: Array
    """Torques that act from there on [N m or N], likewise; the last row is the one before."""
    estimate: Array
    """Velocities as the controller sees them, likewise."""
    clipped: Flags
    """Whether the torque computed at a tick was clipped, shape (ticks, nv)."""
    shortest: float
    """Step of Runge and Kutta's method, as a part of a tick."""
    ended: str
    """One of "whole"; "diverged": a bound of the state was exceeded; "failed": no step was short enough."""


def drive(plant: Plant, law: ca.Function, model: Plant | None, tables: Tables, scalars: Mapping[str, object]) -> Driven:
    """Run a loop; it releases the interpreter's lock.

    Args:
        plant: the arm that moves.
        law: the controller's, tau(q, v, integral, pending, row).
        model: the observer's arm; None: there is no observer.
        tables: of the loop.
        scalars: the single numbers of `_bridge/loop.hpp`, by name, without row_size.
    """
    import _armdyn_bridge as bridge

    parameters = {"plant_parameters": plant.parameters, "model_parameters": model.parameters if model else np.empty(0)}
    found = bridge.simulate(
        _callable(plant.function),
        _callable(law),
        None if model is None else _callable(model.function),
        {name: np.ascontiguousarray(one, dtype=float) for name, one in (tables._asdict() | parameters).items()},
        {**scalars, "row_size": tables.rows.shape[1]},
    )
    nv, ticks = tables.lower.size, found["ticks"]
    q, v, tau, estimate = (
        np.frombuffer(found[name]).reshape(-1, nv)[: ticks + 1] for name in ("q", "v", "tau", "estimate")
    )
    clipped = np.frombuffer(found["clipped"], dtype=bool).reshape(-1, nv)[:ticks]
    return Driven(q, v, tau, estimate, clipped, found["shortest"], found["ended"])


@built_once(maxsize=256)
def _callable(function: ca.Function) -> Any:
    """CasADi Function for the bridge, compiled if a compiler is available."""
    import _armdyn_bridge as bridge

    generator = ca.CodeGenerator("armdyn.c", {"with_header": False})
    generator.add(function)
    library = _library(generator.dump(), function.n_instructions())
    if library is None:
        return bridge.Callable(0, [0, 0, 0, 0], function.serialize())
    address = ctypes.cast(getattr(library, function.name()), ctypes.c_void_p).value
    return bridge.Callable(address, [function.sz_arg(), function.sz_res(), function.sz_iw(), function.sz_w()], "")
