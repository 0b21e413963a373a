"""PID control along a reference."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import expect, flag, one_of
from armdyn.control.laws.readings import Readings, law_function, table
from armdyn.control.laws.reference import Reference, reference_of
from armdyn.control.loop.law import Law
from armdyn.control.loop.loop import Loop
from armdyn.control.loop.ticks import Ticks
from armdyn.control.pid.equations import expect_motors
from armdyn.control.pid.gains import DEFAULT_GAINS, FORMS, Form, PidGains
from armdyn.dynamics import Dynamics
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot, expect_robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pid:
    """u = kp e + ki ∫e dt + kd (v_ref - v), eq. (27), with e = q_ref - q, and the torque that is made of it.

    `form` says what u is, as for `simulate_pid`: "torque", tau = u; "acceleration", tau = D(q) u;
    "computed_torque", tau = D(q) u + C(q, v) v + g(q) + tau_f(v). With a reference at rest at the goal, without
    feedforward and gravity, in `Loop.ideal()`, "acceleration" is the paper's loop, eq. (24).

    Attributes:
        gains: see `PidGains`; what they multiply is an acceleration with the forms "acceleration" and
            "computed_torque", a torque with "torque".
        form: see `Form`.
        feedforward: add the reference's torque, the mean over the tick on which it acts. What the form or `gravity`
            compensates at the readings is taken out of it as it is at the reference, so that nothing counts twice.
        gravity: add g(q) at the readings. The form "computed_torque" does already.

    Raises:
        ProblemError: no gains, unknown form, a switch neither True nor False; gravity with "computed_torque".
    """

    gains: PidGains = DEFAULT_GAINS
    form: Form = "torque"
    feedforward: bool = True
    gravity: bool = False

    def __post_init__(self) -> None:
        expect(self.gains, PidGains, "gains", "PidGains(kp=…, ki=…, kd=…)")
        one_of(self.form, FORMS, "form")
        flag(self.feedforward, "feedforward")
        if flag(self.gravity, "gravity") and self.form == "computed_torque":
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

    def _compensated(self, dynamics: Dynamics, reference: Reference) -> Array:
        """What the law compensates at the readings, at the reference [N m or N], shape (n, nv)."""
        if self.form == "computed_torque":
            return dynamics.along("nle", reference.q, reference.v)
        if self.gravity:
            return dynamics.along("gravity", reference.q)
        return np.zeros_like(reference.tau)
