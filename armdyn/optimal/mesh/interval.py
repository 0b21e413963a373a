"""One interval of direct collocation: equations, cost and derivatives."""

from dataclasses import dataclass

import casadi as ca

from armdyn.dynamics.motion import LOBATTO_3
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.optimal.constraints.rows import IntervalFunctions, Stages, differentiated
from armdyn.optimal.mesh.layout import Layout, Parameters
from armdyn.optimal.problem.options import Scheme


@dataclass(frozen=True)
class _ScaledStages:
    """One interval: unknowns y = (knot, inner, next knot), parameters p, states and torques at its stages."""

    y: ca.SX
    p: ca.SX
    states: list[ca.SX]
    torques: list[ca.SX]
    velocities: list[ca.SX]
    accelerations: list[ca.SX]


def _scaled_stages(dynamics: Dynamics, scheme: Scheme) -> _ScaledStages:
    """Scaled states and torques, velocities, accelerations [rad/s²]."""
    n, layout = dynamics.nv, Layout(dynamics.nv, scheme)
    y, p = ca.SX.sym("y", layout.width), ca.SX.sym("p", Parameters.size(n))
    by, body = Parameters.of(p, n), present_body(dynamics, p)
    left, inner, right = layout.parts(y)

    states = [left[layout.knot.state], inner[layout.inner.states], right[layout.knot.state]]
    if layout.linear:
        u = [(1 - c) * left[layout.knot.torque] + c * right[layout.knot.torque] for c in LOBATTO_3.c]
    else:
        u = [inner[layout.inner.torques]] * LOBATTO_3.c.size

    velocities, accelerations = [], []
    for x, torque in zip(states, u, strict=True):
        q, v = by.length * x[layout.knot.q], by.speed * x[layout.knot.v]
        velocities.append(v)
        accelerations.append(dynamics.aba(q, v, by.effort * torque, body))
    return _ScaledStages(y, p, states, u, velocities, accelerations)


def present_body(dynamics: Dynamics, p: ca.SX) -> ca.SX:
    """Last body among an interval's parameters, see `only_present`."""
    return only_present(dynamics, Parameters.of(p, dynamics.nv).last_body)


def only_present(dynamics: Dynamics, numbers: ca.SX) -> ca.SX:
    """Dynamic parameters of a last body, shape (10,).

    Parameters that are zero for the arm, such as most products of inertia of a planar arm, are left out of the
    expressions.
    """
    if dynamics.last_body.size == 0:
        raise ValueError("a transcription takes Dynamics(robot, free_last_body=True)")
    body: ca.SX = ca.vertcat(*(numbers[i] if there else 0 for i, there in enumerate(dynamics.last_body != 0)))
    return body


def _equations(dynamics: Dynamics, scheme: Scheme) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Unknowns, parameters, defects and cost of one interval, all scaled."""
    n, layout, one = dynamics.nv, Layout(dynamics.nv, scheme), _scaled_stages(dynamics, scheme)
    by, (left, _, right) = Parameters.of(one.p, n), layout.parts(one.y)
    start, duration = left[layout.knot.state], left[layout.knot.time]
    scale = ca.vertcat(ca.repmat(by.length, n, 1), ca.repmat(by.speed, n, 1))
    h = by.fraction * by.time * duration
    rates = [ca.vertcat(v, a) / scale for v, a in zip(one.velocities, one.accelerations, strict=True)]
    defects = []
    for state, weights in zip(one.states[1:], LOBATTO_3.A[1:], strict=True):
        defects.append(state - start - h * sum(a * rate for a, rate in zip(weights, rates, strict=True)))
    defects.append(right[layout.knot.time] - duration)

    square = sum(b * ca.dot(by.weights, torque**2) for b, torque in zip(LOBATTO_3.b, one.torques, strict=True))
    cost = by.fraction * duration * (1 + square / 2)
    return one.y, one.p, ca.vertcat(*defects), cost


@dataclass(frozen=True)
class CollocationInterval:
    """Symbolic equations of one collocation interval.

    Attributes:
        dynamics: dynamics with a symbolic last body.
        scheme: transcription scheme.
    """

    dynamics: Dynamics
    scheme: Scheme

    @property
    def compile(self) -> bool | None:
        """Whether the scheme compiles."""
        return self.scheme.compile

    def stages(self) -> Stages:
        """Stages of the interval in symbols."""
        layout, one = Layout(self.dynamics.nv, self.scheme), _scaled_stages(self.dynamics, self.scheme)
        by, (left, _, _) = Parameters.of(one.p, self.dynamics.nv), layout.parts(one.y)
        return Stages(
            y=one.y,
            p=one.p,
            h=by.fraction * by.time * left[layout.knot.time],
            c=LOBATTO_3.c,
            q=ca.horzcat(*(by.length * x[layout.knot.q] for x in one.states)),
            v=ca.horzcat(*one.velocities),
            a=ca.horzcat(*one.accelerations),
            tau=ca.horzcat(*(by.effort * torque for torque in one.torques)),
            acceleration=by.speed / by.time,
            effort=by.effort,
            dynamics=self.dynamics,
        )


@built_once(maxsize=16)
def interval_functions(dynamics: Dynamics, scheme: Scheme) -> IntervalFunctions:
    """Functions of one interval; cached by model and scheme."""
    return differentiated("interval", *_equations(dynamics, scheme), scheme.compile)
