"""An afternoon's script of a CasADi user: Opti, Hermite-Simpson, linear torque, IPOPT as it comes.

The dynamics are armdyn's, `Dynamics(robot).aba`. "MX" leaves the graph as Opti makes it; "SX" has nlpsol expand.
"""

import casadi as ca
import numpy as np
from protocol import INTERVALS, Answer, main, straight_line

import armdyn as ad


def build(problem, method):
    """Opti's problem, ready to solve."""
    n, N, limits = problem.robot.nv, INTERVALS, problem.limits
    aba = ad.Dynamics(problem.robot).aba
    opti = ca.Opti()
    q, v, u, T = opti.variable(n, N + 1), opti.variable(n, N + 1), opti.variable(n, N + 1), opti.variable()
    h = T / N
    x = ca.vertcat(q, v)

    def rate(state, torque):
        return ca.vertcat(state[n:], aba(state[:n], state[n:], torque))

    f = [rate(x[:, k], u[:, k]) for k in range(N + 1)]
    for k in range(N):
        middle = (x[:, k] + x[:, k + 1]) / 2 + h / 8 * (f[k] - f[k + 1])
        slope = rate(middle, (u[:, k] + u[:, k + 1]) / 2)
        opti.subject_to(x[:, k + 1] == x[:, k] + h / 6 * (f[k] + 4 * slope + f[k + 1]))
    for i in range(n):
        opti.subject_to(opti.bounded(limits.effort_lower[i], u[i, :], limits.effort_upper[i]))
        if np.isfinite(limits.velocity[i]):
            opti.subject_to(opti.bounded(-limits.velocity[i], v[i, :], limits.velocity[i]))
        if np.isfinite(limits.position_upper[i]):
            opti.subject_to(opti.bounded(limits.position_lower[i], q[i, :], limits.position_upper[i]))
    opti.subject_to(x[:, 0] == problem.x_start)
    opti.subject_to(x[:, N] == problem.x_goal)
    opti.subject_to(T >= 1e-3)
    opti.minimize(T)

    guess_t, guess_q, guess_v = straight_line(problem)
    opti.set_initial(T, guess_t[-1])
    opti.set_initial(q, guess_q.T)
    opti.set_initial(v, guess_v.T)
    opti.solver("ipopt", {"print_time": False, "expand": method == "SX"}, {"print_level": 0, "sb": "yes"})
    # Opti builds its solver in the first solve; to_function takes that out of the timing.
    solver = opti.to_function("solve", [opti.x], [q, v, u, T])
    start = opti.debug.value(opti.x, opti.initial())

    def solve():
        try:
            found_q, found_v, found_u, duration = (np.array(part) for part in solver(start))
            status = "solved"
        except RuntimeError as error:  # Opti's way to say that IPOPT did not converge
            found_q, found_v, found_u, duration = guess_q.T, guess_v.T, 0 * guess_q.T, guess_t[-1:]
            status = str(error).strip().splitlines()[-1][:60]
        t = np.linspace(0, float(duration.item()), N + 1)
        return Answer(ad.Trajectory(t, found_q.T, found_v.T, found_u.T), status)

    return solve


if __name__ == "__main__":
    main(build, ("MX", "SX"))
