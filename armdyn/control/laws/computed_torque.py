"""Computed-torque control along a reference."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from armdyn.arguments import Checked, checked, number
from armdyn.control.laws.readings import Readings, law_function, reference_of, table
from armdyn.control.loop.loop import Law, Loop, expect_motors
from armdyn.control.loop.references import Ticks
from armdyn.dynamics import Dynamics
from armdyn.models.robots.robot import Robot, expect_robot


@dataclass(frozen=True)
class ComputedTorque(Checked):
    """tau = rnea(q, v, a_ref + ω² e + 2 ζ ω (v_ref - v) + ki ∫e dt) + feedforward, e = q_ref - q.

    Every joint of the nominal arm is then an independent oscillator about the reference (Siciliano, Sciavicco, Villani,
    Oriolo, Robotics: Modelling, Planning and Control, section 8.5.2). The integral runs from the reference's end on:
    error that it gathers along a fast motion, where torque is short, would have to be unwound at the goal.

    The feedforward tau_ref - rnea(q_ref, v_ref, a_ref) is small. It corrects for the torque's delay and the lag of the
    measured velocity, which would else cause errors along the motion even of an exact arm.

    Attributes:
        bandwidth: ω [rad/s].
        damping: ζ; 1: no overshoot, without the integral.
        integral: ki [1/s³]; 0: none. Without delay the loop is stable below 2 ζ ω³.

    Raises:
        ProblemError: bandwidth or damping not positive, integral negative.
    """

    bandwidth: float = checked(number, 100.0, unit="rad/s", sign="positive")
    damping: float = checked(number, 1.0, sign="positive")
    integral: float = checked(number, 0.0, unit="1/s³", sign="not negative")

    def law(self, robot: Robot, ticks: Ticks, loop: Loop) -> Law:
        """The law along a reference; see `Controller`.

        Raises:
            ProblemError: the reference is for another number of joints; a joint has no motor.
        """
        expect_motors(expect_robot(robot), "computed torque")
        nv, dynamics, reference = robot.nv, Dynamics(robot), reference_of(robot, ticks, loop)
        gains = (self.bandwidth**2, 2 * self.damping * self.bandwidth, self.integral)
        columns = {"q": reference.q, "v": reference.v, "a": reference.a, "gains": np.array(gains)}
        columns["rest"] = reference.tau - dynamics.along("rnea", reference.q, reference.v, reference.a)

        def torque(given: Readings) -> ca.SX:
            row = given.row
            stiff, damped, slow = ca.vertsplit(row["gains"])
            u = stiff * (row["q"] - given.q) + damped * (row["v"] - given.v) + slow * given.integral
            tau: ca.SX = dynamics.rnea(given.q, given.v, row["a"] + u)
            return tau + row["rest"]

        gain = self.integral * np.diag(dynamics.crba(ticks.goal))
        return Law(law_function(nv, loop.delay, columns, torque), table(columns), gain, ticks.duration)
