"""Goals modulo 2π, against exact quadrature of both ways round."""

import numpy as np
import pytest
from scipy.integrate import quad

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.problem.turns import MOST_GOALS, endless, goals_with_turns
from oracles import joint, link, two_links, urdf

EFFORT = 1.2
WEIGHT = 9.81 * 0.1
"""Of the link of `oracles.INERTIAL`: m g l [N m]; it turns with 0.02 + 0.1² = 0.03 kg m²."""


def endless_joint(name, ends, axis, velocity=1000.0):
    inside = f'<axis xyz="{axis}"/><limit effort="{EFFORT}" velocity="{velocity}"/>'
    return joint(name, *ends, "continuous", inside)


def pendulum(folder, axis="0 -1 0"):
    path = folder / "pendulum.urdf"
    path.write_text(two_links(joint=endless_joint("shoulder", ("base", "arm"), axis)))
    return ad.Robot.from_urdf(path)


def exact(start, goal):
    """Minimum time [s] of the pendulum without turning back: full torque, then full brake; energy gives both."""
    way, sign = abs(goal - start), np.sign(goal - start)
    rise = WEIGHT * (np.sin(goal) - np.sin(start))
    switch = way / 2 + rise / (2 * EFFORT)

    def energy(x):
        if x < switch:
            return EFFORT * x - WEIGHT * (np.sin(start + sign * x) - np.sin(start))
        return EFFORT * (way - x) + WEIGHT * (np.sin(goal) - np.sin(start + sign * x))

    def dt(phi):  # x = way sin² phi takes away the ends' singularities
        return way * np.sin(2 * phi) / np.sqrt(2 * energy(way * np.sin(phi) ** 2) / 0.03)

    at = np.arcsin(np.sqrt(switch / way))
    return sum(quad(dt, *part, epsabs=1e-13, epsrel=1e-13)[0] for part in ((0, at), (at, np.pi / 2)))


def test_the_faster_way_is_not_the_shorter(tmp_path):
    """Over the top it is 3.04 rad, below it is 3.24 rad, downhill first."""
    robot, goal = pendulum(tmp_path), np.pi - 0.1
    problem = ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[goal], wrap=True)
    solution = ad.solve_minimum_time(problem)
    assert solution.certificate.ok, solution.certificate.reasons
    assert solution.trajectory.q[-1, 0] == pytest.approx(goal - 2 * np.pi, abs=1e-6)
    assert solution.duration == pytest.approx(exact(0.0, goal - 2 * np.pi), rel=1e-8)
    other = next(tried for tried in solution.goals if tried.q[0] > 0)
    assert other.duration == pytest.approx(exact(0.0, goal), rel=1e-8)
    found = ad.solve_minimum_time(ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[goal]))
    assert found.trajectory.q[-1, 0] == pytest.approx(goal, abs=1e-6)
    assert found.duration == pytest.approx(other.duration, rel=1e-8)


@pytest.mark.parametrize(("start", "goal", "short"), [(3.0, -3.0, 2 * np.pi - 6), (0.0, 20.0, 20 - 6 * np.pi)])
def test_without_gravity_it_is_the_shorter(start, goal, short, tmp_path):
    problem = ad.MinimumTimeProblem(pendulum(tmp_path, "0 0 1"), q_start=[start], q_goal=[goal], wrap=True)
    solution = ad.solve_minimum_time(problem)
    assert solution.trajectory.q[-1, 0] == pytest.approx(start + short, abs=1e-6)
    # About the vertical axis every link of the oracle has 0.02 + 0.1² kg m².
    assert solution.duration == pytest.approx(2 * np.sqrt(abs(short) * 0.03 / EFFORT), rel=1e-8)


@pytest.mark.slow
def test_one_endless_joint_of_two(read):
    """A joint with limits goes to its given goal; its neighbour takes the nearer turn."""
    limited = joint("elbow", "a", "b")
    first = endless_joint("shoulder", ("base", "a"), "0 -1 0")
    robot = read(urdf('<link name="base"/>', link("a"), link("b"), first, limited), effort_limit=[5.0, 5.0])
    problem = ad.MinimumTimeProblem(robot, q_start=[-3.0, 0.0], q_goal=[3.0, 0.5], wrap=True)
    assert endless(robot, problem.limits).tolist() == [True, False]
    assert np.allclose(problem.goals, [[3.0 - 2 * np.pi, 0.5], [3.0, 0.5]])
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(starts=4))
    assert solution.success
    assert solution.trajectory.q[-1] == pytest.approx([3.0 - 2 * np.pi, 0.5], abs=1e-6)


def test_ways_of_many_joints_are_few_and_nearest_first():
    robot = ad.Robot.from_library("kinova")
    turning = endless(robot, robot.limits)
    assert turning.sum() == 4 - int(not turning[4])
    start, goal = np.zeros(6), np.full(6, 3.0)
    ways = goals_with_turns(start, [goal, goal + 2 * np.pi * turning], robot.limits, turning)
    assert len(ways) == min(MOST_GOALS, 2 ** (1 + int(turning.sum())))
    bounds = [np.max(np.abs(way) / robot.limits.velocity) for way in ways]
    assert np.all(np.diff(bounds) >= -1e-12)
    assert np.array_equal(ways[0], goal)
    assert all(np.allclose(np.cos(way - goal), 1) for way in ways)
    assert all(np.array_equal(way[~turning], goal[~turning]) for way in ways)


def test_a_whole_turn_is_no_motion(tmp_path):
    with pytest.raises(ProblemError, match="the same state"):
        ad.MinimumTimeProblem(pendulum(tmp_path), q_start=[0.3], q_goal=[0.3 + 2 * np.pi], wrap=True)


def test_prismatic_and_limited_joints_do_not_turn():
    assert not np.any(endless(ad.Robot.from_library("ur5"), ad.Robot.from_library("ur5").limits))
