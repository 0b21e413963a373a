"""rockit's DirectCollocation as it comes (Radau, degree 4) with IPOPT: the same dynamics, limits and straight start.

`pip install rockit-meco`. The torque is constant between the knots, as rockit's controls are; nlpsol expands the graph.
"""

import casadi as ca
import numpy as np
from protocol import INTERVALS, Answer, main, straight_line
from rockit import DirectCollocation, FreeTime, Ocp

import armdyn as ad


def build(problem, method):
    """The problem as rockit writes it, transcribed and ready to solve."""
    n, limits, aba = problem.robot.nv, problem.limits, ad.Dynamics(problem.robot).aba
    guess_t, guess_q, guess_v = straight_line(problem)
    ocp = Ocp(T=FreeTime(guess_t[-1]))
    q, v, u = ocp.state(n), ocp.state(n), ocp.control(n)
    ocp.set_der(q, v)
    ocp.set_der(v, aba(q, v, u))
    for i in range(n):
        ocp.subject_to(limits.effort_lower[i] <= (u[i] <= limits.effort_upper[i]))
        if np.isfinite(limits.velocity[i]):
            ocp.subject_to(-limits.velocity[i] <= (v[i] <= limits.velocity[i]))
        if np.isfinite(limits.position_upper[i]):
            ocp.subject_to(limits.position_lower[i] <= (q[i] <= limits.position_upper[i]))
    ocp.subject_to(ocp.at_t0(ca.vertcat(q, v)) == problem.x_start)
    ocp.subject_to(ocp.at_tf(ca.vertcat(q, v)) == problem.x_goal)
    ocp.add_objective(ocp.T)
    ocp.set_initial(q, guess_q[0] + ocp.t * guess_v[0])  # the straight line: a table of values is an error in 0.6.7
    ocp.set_initial(v, guess_v[0])
    ocp.solver("ipopt", {"print_time": False, "expand": True, "ipopt.print_level": 0, "ipopt.sb": "yes"})
    ocp.method(DirectCollocation(N=INTERVALS))
    samples = [ocp.sample(part, grid="control") for part in (q, v, u)]
    # to_function builds the solver here, and not in the first solve; without an argument it would solve here, too.
    solver = ocp.to_function("solve", [ocp.T], [samples[0][0], *(sampled for _, sampled in samples)])

    def solve():
        try:
            t, found_q, found_v, found_u = (np.array(part) for part in solver(guess_t[-1]))
            status = "solved"
        except RuntimeError as error:  # IPOPT did not converge
            t, found_q, found_v, found_u = guess_t, guess_q.T, guess_v.T, 0 * guess_q.T
            status = str(error).strip().splitlines()[-1][:60]
        return Answer(stairs(t.ravel(), found_q.T, found_v.T, found_u.T), status)

    return solve


def stairs(t, q, v, u):
    """The motion with a torque that jumps at the knots: two samples, one ulp of time apart."""
    knots = np.repeat(np.arange(t.size), 2)[1:-1]
    held = np.repeat(u[: t.size - 1], 2, axis=0)
    times = t[knots]
    times[1:-1:2] = np.nextafter(times[1:-1:2], 0)
    return ad.Trajectory(times, q[knots], v[knots], held)


if __name__ == "__main__":
    main(build, ("IPOPT",))
