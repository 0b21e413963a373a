"""Boxes nested in time, against motions with random torques: none leaves them while it keeps its speed limits."""

import numpy as np
import pytest

from armdyn.dynamics.numeric import forward_dynamics
from armdyn.optimal.bound import cells as cells_module
from armdyn.optimal.bound.cells import Cells, reached
from armdyn.optimal.bound.leg import bound_legs
from armdyn.optimal.problem.policy.bound import BoundPolicy
from optimal.bound.arms import ARMS, random_problem

_INTEGRATED = 1e-6
"""Share of the speed limit by which Runge's and Kutta's steps may err: of fourth order, a thousandth of a ramp each."""


def nested(problem, passes=3, ahead=1.5):
    """A leg and its boxes, for motions that take a multiple of the shortest."""
    leg = bound_legs(problem, BoundPolicy())[0]
    known = leg.shortest
    cells = Cells.of(leg, known / 2, ahead * known)
    for _ in range(passes):
        cells = cells.narrowed(leg, reached(leg, cells, cells.forces(leg), lambda: False))
    return leg, cells


def stepped(acceleration, q, v, tau, dt):
    """One step of the classical Runge-Kutta method."""
    slopes = [(v, acceleration(q, v, tau))]
    for share in (0.5, 0.5, 1.0):
        at = v + share * dt * slopes[-1][1]
        slopes.append((at, acceleration(q + share * dt * slopes[-1][0], at, tau)))
    weights = np.array([1, 2, 2, 1]) / 6
    dq, dv = (sum(w * slope[i] for w, slope in zip(weights, slopes, strict=True)) for i in (0, 1))
    return q + dt * dq, v + dt * dv


@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize("moving", [False, True])
def test_no_admissible_motion_leaves_the_boxes(arm, moving):
    robot, rng = ARMS[arm](), np.random.default_rng(2)
    n, limits = robot.nv, robot.limits
    v_start = 0.3 * limits.velocity * rng.uniform(-1, 1, n) * moving
    problem = random_problem(robot, 3, share=0.5, v_start=v_start)
    leg, cells = nested(problem, ahead=1e3)  # these motions do not end at the goal
    acceleration, ends = forward_dynamics(robot), np.cumsum(cells.side)
    seen = 0
    for trial in range(12):
        q, v = problem.x_start[:n], problem.x_start[n:]
        bang = rng.uniform(-1, 1, n)
        for k, length in enumerate(cells.side):
            if rng.uniform() < 0.2:
                bang = rng.uniform(-1, 1, n)
            tau = np.where(bang > 0, limits.effort_upper, limits.effort_lower)
            tau = tau if trial % 2 else tau * rng.uniform(0, 1, n)
            for _ in range(4):
                q, v = stepped(acceleration, q, v, tau, length / 4)
                room = _INTEGRATED * leg.velocity
                if np.any(np.abs(v) > leg.velocity) or np.any((q < leg.position.lower) | (q > leg.position.upper)):
                    break
                assert np.all((cells.v.lower[k] - room <= v) & (v <= cells.v.upper[k] + room)), (k, ends[k])
                assert np.all((cells.q.lower[k] - room <= q) & (q <= cells.q.upper[k] + room)), (k, ends[k])
                seen += 1
            else:
                continue
            break
    assert seen > 100


def test_early_boxes_are_as_small_as_torque_allows():
    """The cart of 1 kg and 1 N: |v| ≤ t, to within a cell."""
    _, cells = nested(random_problem(ARMS["cart"](), 0))
    ends = np.cumsum(cells.side)
    own = np.minimum(ends, 0.5)
    assert cells.v.upper[: cells.middle, 0] == pytest.approx(own, rel=1e-9)
    assert cells.v.lower[: -cells.middle - 1 : -1, 0] == pytest.approx(-own, rel=1e-9)


def test_acceleration_limits_narrow_the_boxes():
    _, cells = nested(random_problem(ARMS["ur5"](), 0, acceleration_limit=np.full(6, 2.0)), ahead=3.0)
    ends = np.cumsum(cells.side)[:, None]
    assert np.all(cells.v.upper[: cells.middle] <= 2.0 * ends * (1 + 1e-12))


def test_shorter_sides_keep_known_bounds():
    leg, cells = nested(random_problem(ARMS["ur5"](), 0))
    half = float(np.sum(cells.side))
    cut = cells.cut(leg, half / 3)
    old, new = np.append(0, np.cumsum(cells.side)), np.append(0, np.cumsum(cut.side))
    for i in range(cut.middle):
        at = (new[i] + new[i + 1]) / 2
        k = np.searchsorted(old, at) - 1
        assert np.all(cut.v.upper[i] >= cells.v.upper[k])
        assert np.all(cut.v.lower[-1 - i] <= cells.v.lower[-1 - k])
    assert np.all(cut.v.upper[0] < leg.velocity)


def test_many_multipliers_are_tried_in_groups_and_a_stop_leaves_wider_boxes(monkeypatch):
    """Groups change a bound by rounding alone: of matrix products, 1e-12 of the speed limits."""
    leg, cells = nested(random_problem(ARMS["ur5"](), 0), passes=1)
    forces = cells.forces(leg)
    whole = reached(leg, cells, forces, lambda: True)  # one group is not interrupted
    monkeypatch.setattr(cells_module, "_AT_ONCE", 4 * forces.terms.inertia_derivatives.lower.size)
    grouped, stopped = reached(leg, cells, forces, lambda: False), reached(leg, cells, forces, lambda: True)
    room = 1e-12 * leg.velocity
    assert np.all(np.abs(grouped.lower - whole.lower) <= room) and np.all(np.abs(grouped.upper - whole.upper) <= room)
    assert np.all(stopped.lower <= whole.lower + room) and np.all(stopped.upper >= whole.upper - room)
    assert np.any(stopped.upper > whole.upper + 1e-3 * leg.velocity)
