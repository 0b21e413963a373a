"""Pinocchio's dynamics as CasADi Functions, from plain pip: no conda, no build of Pinocchio.

    pip install .  (armdyn's own folder)  and  python examples/pinocchio_in_casadi.py

The `pin` wheel has no `pinocchio.casadi` (Pinocchio's issues 2759 and 2578 ask for it). armdyn instantiates Pinocchio's
templated algorithms on `casadi::SX` when it is installed; here they are compared with `pin` itself, and used for an
optimal control problem of one's own.
"""

import casadi as ca
import numpy as np
import pinocchio as pin

import armdyn as ad

robot = ad.Robot.from_library("ur5")  # or ad.Robot.from_urdf(path), or ad.Robot.from_model(a pin.Model, limits=...)
dynamics, n = ad.Dynamics(robot), robot.nv

# 1. The same numbers as pin, derivatives included.
q, v, tau = (ca.SX.sym(name, n) for name in ("q", "v", "tau"))
acceleration = dynamics.aba(q, v, tau)
slopes = ca.Function("slopes", [q, v, tau], [ca.jacobian(acceleration, ca.vertcat(q, v))])

random, data = np.random.default_rng(0), robot.model.createData()
at = random.uniform(-1, 1, n), random.uniform(-1, 1, n), random.uniform(-10, 10, n)
off = np.abs(dynamics.aba(*at) - pin.aba(robot.model, data, *at)).max()
pin.computeABADerivatives(robot.model, data, *at)
slope_off = np.abs(slopes(*at).full() - np.hstack([data.ddq_dq, data.ddq_dv])).max()
print(f"aba: {off:.1e} rad/s² from pin's; its derivatives: {slope_off:.1e}")

# 2. A motion of least torque, in CasADi's own Opti: half a second, 20 intervals, the midpoint rule.
intervals, step = 20, 0.5 / 20
start, goal = np.array([0, -1.57, 1.57, -1.57, -1.57, 0]), np.array([0.5, -1.2, 1.2, -1.4, -1.4, 0.3])
rnea = dynamics.functions["rnea"]  # the casadi.Function: to be mapped, expanded, serialized, written as C

opti = ca.Opti()
Q, V, T = opti.variable(n, intervals + 1), opti.variable(n, intervals + 1), opti.variable(n, intervals)
middle_q, middle_v = (Q[:, 1:] + Q[:, :-1]) / 2, (V[:, 1:] + V[:, :-1]) / 2
opti.subject_to(Q[:, 1:] == Q[:, :-1] + step * middle_v)
opti.subject_to(ca.vec(T) == ca.vec(rnea.map(intervals)(middle_q, middle_v, (V[:, 1:] - V[:, :-1]) / step)))
for column, pose in ((0, start), (intervals, goal)):
    opti.subject_to(Q[:, column] == pose)
    opti.subject_to(V[:, column] == 0)
limit = robot.limits.effort_upper
opti.subject_to(opti.bounded(ca.repmat(-limit, 1, intervals), T, ca.repmat(limit, 1, intervals)))
opti.minimize(step * ca.sumsqr(T / limit))
opti.set_initial(Q, np.linspace(start, goal, intervals + 1).T)
opti.solver("ipopt", {"expand": True, "print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"})
solved = opti.solve()
print(f"least torque: cost {solved.value(opti.f):.4f}, {solved.stats()['iter_count']} iterations")

# 3. How the torque answers to a payload: ten more arguments, a body's dynamic parameters.
loaded = ad.Dynamics(robot, payload_frame="tool0")
mass = ca.SX.sym("mass")
torque = loaded.rnea(q, v, 0 * v, ca.vertcat(mass, ca.SX.zeros(9)))
per_kilogram = ca.Function("per_kilogram", [q, v, mass], [ca.jacobian(torque, mass)])
print("1 kg at the tool takes", np.round(per_kilogram(start, np.zeros(n), 0).full().ravel(), 2), "N m to hold")
