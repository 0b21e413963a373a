"""PID control along a reference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca
import numpy as np

from armdyn.arguments import MOST_MEMBERS, Checked, checked, expect, flag, one_of, whole
from armdyn.arrays import Array
from armdyn.control.laws.readings import Readings, law_function, reference_of, table
from armdyn.control.loop.loop import Law, Loop, expect_motors
from armdyn.control.loop.references import Ticks
from armdyn.dynamics import Dynamics
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.values.per_joint import PerJoint, expect_one_count, one_or_each

Form = Literal["acceleration", "torque", "computed_torque"]
"""Meaning of the output u of eq. (27):

- "acceleration", eqs (22), (24): tau = D(q) u; Coriolis, gravity and friction torques are not compensated.
- "torque": tau = u, as motor controllers do.
- "computed_torque": tau = D(q) u + C(q, v) v + g(q), and the joints' friction; every joint becomes a triple
  integrator of its own.
"""
FORMS: tuple[Form, ...] = ("acceleration", "torque", "computed_torque")


@dataclass(frozen=True)
class PidGains(Checked):
    """Gains of u = kp e + ki ∫e dt + kd ė, eq. (27), with e = goal - position, eq. (26).

    Each is one number, or one per joint. Units below are of forms whose output is an acceleration of a
    revolute joint; with form "torque" read N m for 1/s².

    Attributes:
        kp: proportional [1/s²].
        ki: integral [1/s³].
        kd: derivative [1/s].
    """

    kp: PerJoint = checked(one_or_each, sign="not negative")
    ki: PerJoint = checked(one_or_each, sign="not negative")
    kd: PerJoint = checked(one_or_each, sign="not negative")

    def __post_init__(self) -> None:
        super().__post_init__()
        expect_one_count("gains", self.kp, self.ki, self.kd)

    def per_joint(self, nv: int) -> tuple[Array, Array, Array]:
        """kp, ki and kd, each of shape (nv,).

        Raises:
            ProblemError: the gains are for another number of joints.
        """
        nv = whole(nv, "nv", least=1, most=MOST_MEMBERS)
        for name, value in vars(self).items():
            if isinstance(value, tuple) and len(value) != nv:
                raise ProblemError(f"{name} has {len(value)} numbers; expected one, or {nv}, one per joint")
        kp, ki, kd = (np.broadcast_to(np.array(g, dtype=float), (nv,)) for g in (self.kp, self.ki, self.kd))
        return kp, ki, kd


DEFAULT_GAINS = PidGains(kp=30.0, ki=50.0, kd=10.0)
"""With form "computed_torque" they put each joint's poles at -6.6 and -1.7 ± 2.2i 1/s on every arm. With other forms
whether they suit depends on the arm: `closed_loop_eigenvalues`."""


@dataclass(frozen=True)
class Pid(Checked):
    """u = kp e + ki ∫e dt + kd (v_ref - v), eq. (27), with e = q_ref - q, and the torque computed from u.

    The torque depends on `form`: "torque", tau = u; "acceleration", tau = D(q) u;
    "computed_torque", tau = D(q) u + C(q, v) v + g(q) + tau_f(v). With a reference at rest at the goal, without
    feedforward and gravity, in `Loop.ideal()`, "acceleration" is the loop of eq. (24); `simulate_pid` runs it.
    `Pid(60, 100, 12)` is `Pid(PidGains(60, 100, 12))`.

    Attributes:
        gains: see `PidGains`; u is an acceleration with the forms "acceleration" and "computed_torque", a torque with
            "torque".
        form: see `Form`.
        feedforward: add the reference's torque, its mean over the tick on which the output acts, less the torque that
            the form or `gravity` would compensate at the reference, so that nothing counts twice.
        gravity: add g(q) at the readings. The form "computed_torque" does already.

    Raises:
        ProblemError: no gains, unknown form, a switch neither True nor False; gravity with "computed_torque".
    """

    gains: PidGains = checked(
        expect, DEFAULT_GAINS, kind=PidGains, hint="PidGains(kp=…, ki=…, kd=…); or Pid(kp, ki, kd)"
    )
    form: Form = checked(one_of, "torque", known=FORMS)
    feedforward: bool = checked(flag, True)
    gravity: bool = checked(flag, False)

    def __post_init__(self) -> None:
        three: tuple[Any, Any, Any] = (self.gains, self.form, self.feedforward)
        if not isinstance(three[0], PidGains) and not isinstance(three[1], str) and three[2] is not True:
            for name, value in (("gains", PidGains(*three)), ("form", "torque"), ("feedforward", True)):
                object.__setattr__(self, name, value)
        super().__post_init__()
        if self.gravity and self.form == "computed_torque":
            raise ProblemError('gravity=True is for the other forms: form="computed_torque" compensates gravity itself')

    def law(self, robot: Robot, ticks: Ticks, loop: Loop) -> Law:
        """The law along a reference; see `Controller`.

        Raises:
            ProblemError: the gains or the reference are for another number of joints; a joint has no motor.
        """
        expect_motors(expect_robot(robot), "a PID controller")
        nv, dynamics, reference = robot.nv, Dynamics(robot), reference_of(robot, ticks, loop)
        kp, ki, kd = self.gains.per_joint(nv)
        columns = {"q": reference.q, "v": reference.v, "kp": kp, "ki": ki, "kd": kd}
        if self.feedforward:
            columns["tau"] = reference.tau - self._compensated(dynamics, reference)

        def torque(given: Readings) -> ca.SX:
            row = given.row
            u = row["kp"] * (row["q"] - given.q) + row["ki"] * given.integral + row["kd"] * (row["v"] - given.v)
            tau = u if self.form == "torque" else dynamics.crba(given.q) @ u
            if self.form == "computed_torque":
                tau += dynamics.nle(given.q, given.v)
            if self.gravity:
                tau += dynamics.gravity(given.q)
            return tau + row["tau"] if self.feedforward else tau

        inertia = np.ones(nv) if self.form == "torque" else np.diag(dynamics.crba(ticks.goal))
        return Law(law_function(nv, loop.delay, columns, torque), table(columns), ki * inertia)

    def _compensated(self, dynamics: Dynamics, reference: Ticks) -> Array:
        """Torque that the law compensates, at the reference's states [N m or N], shape (n, nv)."""
        if self.form == "computed_torque":
            return dynamics.along("nle", reference.q, reference.v)
        if self.gravity:
            return dynamics.along("gravity", reference.q)
        return np.zeros_like(reference.tau)
