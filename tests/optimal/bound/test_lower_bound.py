"""The bound against exact minimum times, and against the best motions known."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.bound.lower_bound import _other_turns
from armdyn.optimal.problem.policy.bound import BoundPolicy
from optimal.bound.arms import ARMS, random_problem
from problems import cart, paper_arm, paper_problem

PANDA = ((0, -0.785, 0, -2.356, 0, 1.571, 0.785), (1, 0.2, 0.5, -1.5, 0.3, 2, -0.5))

KNOWN = {
    "panda": (0.555913, 1.805235, 1.619286, 0.556305, 1.271243, 1.641291, 1.751767, 1.310348, 0.665505, 1.421522),
    "ur5": (1.452456, 0.909181, 0.994371, 0.934485, 1.196305, 1.095492, 1.113053, 0.689756, 1.254783, 0.656778),
}
"""Durations of the fastest motions known [s] between the first ten of `random_pairs`; found by splines, no bounds."""


def rail(v_start=0.0, v_goal=0.0, **limits):
    """The double integrator, 1 kg and 1 N, over 1 m."""
    return ad.MinimumTimeProblem(cart(), q_start=[0], q_goal=[1], v_start=[v_start], v_goal=[v_goal], **limits)


@pytest.mark.parametrize(
    ("problem", "exact"),
    [
        (rail(velocity_limit=0.5), 1 / 0.5 + 0.5),  # bang, cruise, bang
        (rail(velocity_limit=1.0), 2.0),  # bang, bang: the limit is just reached
        (rail(velocity_limit=3.0), 2.0),
        (rail(velocity_limit=0.5, v_start=0.5, v_goal=0.5), 2.0),  # no ramps at all
        (rail(velocity_limit=0.5, v_start=0.25), 0.25 + 0.5 + (1 - (0.5**2 - 0.25**2) / 2 - 0.5**2 / 2) / 0.5),
        (rail(velocity_limit=0.5, acceleration_limit=[0.25]), 1 / 0.5 + 2.0),
        (rail(velocity_limit=0.5, effort_limit=([-2.0], [0.5])), 1 / 0.5 + 0.5 + 0.125),
    ],
)
def test_a_rail(problem, exact):
    found = ad.lower_bound(problem)
    assert found.duration <= exact
    assert found.duration == pytest.approx(exact, rel=2e-4)  # cells of a twentieth of a ramp


def seven_phases(way, velocity, acceleration, jerk):
    """Least time of a joint from rest to rest, by the peak velocity whose phases add up to the way."""

    def ramp(peak):
        rise = min(np.sqrt(peak / jerk), acceleration / jerk)  # [s] in which the acceleration grows
        return rise + peak / (jerk * rise)  # the way of two ramps is that at the peak for as long as one takes

    if velocity * ramp(velocity) <= way:
        return way / velocity + ramp(velocity)
    peak = brentq(lambda peak: peak * ramp(peak) - way, 1e-9, velocity)
    return 2 * ramp(peak)


@pytest.mark.parametrize(
    "limits", [(0.5, 0.8, 2.0), (0.5, 5.0, 2.0), (2.0, 0.8, 0.5), (2.0, 0.8, 20.0), (9.0, 9.0, 1.0)]
)
def test_a_rail_with_limited_jerk(limits):
    velocity, acceleration, jerk = limits
    strong = {"effort_limit": 1.5 * acceleration}
    found = ad.lower_bound(
        rail(velocity_limit=velocity, acceleration_limit=[acceleration], jerk_limit=[jerk], **strong)
    )
    exact = seven_phases(1.0, *limits)
    assert found.duration <= exact
    assert found.duration == pytest.approx(exact, rel=1e-9)  # a closed form


@pytest.mark.parametrize("rate", [2.0, 10.0])
def test_a_rail_whose_force_changes_slowly(rate):
    """A mass of 1 kg: limits of force and of its rate are those of acceleration and jerk."""
    limits = {"velocity_limit": 3.0, "path_constraints": [ad.TorqueRateLimit([rate])]}
    found, exact = ad.lower_bound(rail(**limits)), seven_phases(1.0, 3.0, 1.0, rate)
    assert found.duration <= exact
    # The force turns round in the middle as fast as one likes, as far as this bound knows.
    assert found.duration > 2.0 + 0.6 * (exact - 2.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("limit", "known"),
    [
        ({"jerk_limit": 200.0}, (1.696125, 1.700099, 1.161731)),
        ({"path_constraints": [ad.TorqueRateLimit(1000.0)]}, (1.497278, 1.501263, 0.947476)),
    ],
)
def test_limits_of_rates_raise_the_bound_and_never_above_a_motion(limit, known):
    """Of the durations known [s], found by `solve_minimum_time`, the last is found again."""
    for k, duration in enumerate(known):
        problem = random_problem(ARMS["ur5"](), k)
        plain, found = ad.lower_bound(problem), ad.lower_bound(problem.variant(**limit))
        assert plain.duration < found.duration <= duration
    solution = ad.solve_minimum_time(problem.variant(**limit), ad.MinimumTimeOptions(calm=0, bound=False))
    assert solution.usable
    assert found.duration <= solution.duration < duration * (1 + 1e-4)


def quadrature(problem, limit):
    """The exact minimum time of one revolute joint that reaches its speed limit: bang, cruise, bang."""
    robot = problem.robot
    dynamics = ad.Dynamics(robot)
    (q0,), (q1,) = problem.q_start, problem.q_goal
    tau = robot.limits.effort_upper

    def ramp(q, sign):
        """Time and way of a ramp: forward in time from the start, back in time from the goal."""

        def slope(_, x):
            return [sign * x[1], sign * dynamics.aba(x[:1], x[1:], sign * tau)[0]]

        def full(_, x):
            return x[1] - limit

        full.terminal = True
        found = solve_ivp(slope, (0, 10), [q, 0.0], events=full, rtol=1e-11, atol=1e-13)
        return found.t_events[0][0], abs(found.y_events[0][0][0] - q)

    (t_up, way_up), (t_down, way_down) = ramp(q0, 1.0), ramp(q1, -1.0)
    assert way_up + way_down < q1 - q0
    return t_up + t_down + (q1 - q0 - way_up - way_down) / limit


@pytest.mark.parametrize(
    ("limit", "mass", "damping", "coulomb", "armature", "worst"),
    [
        (5.0, 0.1006, 0.0, 0.0, 0.0, 5e-4),
        (5.0, 0.3, 0.0, 0.0, 0.0, 2e-3),  # gravity, which is bounded over boxes of positions
        (5.0, 0.1006, 0.02, 0.0, 0.0, 2e-3),
        (5.0, 0.1006, 0.0, 0.1, 0.0, 2e-2),  # dry friction helps who goes back: an interval
        (5.0, 0.1006, 0.0, 0.0, 0.01, 2e-3),
    ],
)
def test_one_revolute_joint(limit, mass, damping, coulomb, armature, worst):
    robot = paper_arm("r", mass).with_friction(damping, coulomb, None).with_armature(armature)
    problem = paper_problem("r").variant(robot=robot, velocity_limit=[limit])
    exact, found = quadrature(problem, limit), ad.lower_bound(problem)
    assert found.joint == "joint1"
    assert found.duration <= exact
    assert found.duration == pytest.approx(exact, rel=worst)


def test_the_usual_pair_of_the_panda():
    found = ad.lower_bound(ad.MinimumTimeProblem(ARMS["panda"](), q_start=PANDA[0], q_goal=PANDA[1]))
    assert 0.49335 < found.duration < 0.493396  # the fastest motion known; the bound was found 0.493373
    assert found.joint == "panda_joint7"
    assert found.kinematic == pytest.approx(1.285 / 2.61, rel=1e-12)
    assert found.ramps == found.duration - found.kinematic


def random_pairs(name):
    """Ten problems with poses across 80 % of the range."""
    robot, rng = ad.Robot.from_library(name), np.random.default_rng(1)
    lower = np.maximum(robot.limits.position_lower, -np.pi)
    upper = np.minimum(robot.limits.position_upper, np.pi)
    middle, half = (lower + upper) / 2, 0.8 * (upper - lower) / 2
    for _ in range(10):
        start, goal = (rng.uniform(middle - half, middle + half) for _ in range(2))
        yield ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal)


@pytest.mark.slow
@pytest.mark.parametrize("name", KNOWN)
def test_random_pairs_are_bounded_closely_and_never_above_a_motion(name):
    found = [ad.lower_bound(problem) for problem in random_pairs(name)]
    gaps = np.array(KNOWN[name]) / [bound.duration for bound in found] - 1
    assert np.all(gaps >= 0)
    assert all(bound.duration >= bound.kinematic for bound in found)
    assert np.median(gaps) < 0.0025  # found: 0.0004 and 0.0018
    assert np.max(gaps) < 0.033  # found: 0.0317 and 0.0091; the first pair of the Panda: see the next test


def test_most_of_the_widest_gap_is_the_cost_of_turning_back():
    """The first pair of the Panda, of which joint 2 decides the time, but for joint 1's way, which it does not see.

    M does not depend on joint 1, so that the ramps are the same for any goal of it. Where it may go on as it starts
    (1.33 rad further) a motion of 0.544847 s is known, 2 % faster than the fastest known of the pair itself.
    """
    pair = next(random_pairs("panda"))
    goal = np.array(pair.q_goal)
    goal[0] += 1.33
    forward = pair.variant(q_goal=goal)
    found, other = ad.lower_bound(pair), ad.lower_bound(forward)
    assert found.duration == pytest.approx(other.duration, rel=1e-3)  # the boxes in the middle are not the same
    assert 0.985 * 0.544847 < other.duration < 0.544847


@pytest.mark.parametrize(("arm", "known"), [("r", 0.368482508), ("rr", 0.375660574)])
def test_known_optima_of_the_papers_arms(arm, known):
    """Found by `solve_minimum_time`, which certified them."""
    found = ad.lower_bound(paper_problem(arm, velocity_limit=[5.0] * len(arm)))
    assert known * 0.99 < found.duration <= known


@pytest.mark.parametrize(
    ("changes", "slower"),
    [
        ({"effort_limit": 0.5}, 1.0),
        ({"velocity_limit": 0.5}, 1.9),
        ({"acceleration_limit": np.full(6, 3.0)}, 1.0),
    ],
)
def test_stricter_limits_are_never_faster(changes, slower):
    problem = random_problem(ARMS["ur5"](), 0)
    own = {"effort_limit": problem.limits.effort_upper, "velocity_limit": problem.limits.velocity}
    changes = {name: own.get(name, 1.0) * value for name, value in changes.items()}
    assert ad.lower_bound(problem.variant(**changes)).duration > slower * ad.lower_bound(problem).duration


def test_a_payload_costs_time():
    loaded = random_problem(ARMS["ur5"](), 0)
    empty = loaded.variant(robot=ad.Robot.from_library("ur5"))
    assert ad.lower_bound(empty).duration < ad.lower_bound(loaded).duration


def test_via_points_add_up():
    robot = ARMS["ur5"]()
    problem = random_problem(robot, 0)
    way = np.asarray(problem.q_goal) - np.asarray(problem.q_start)
    middle = problem.q_start + way / 2
    free, through = ad.lower_bound(problem), ad.lower_bound(problem.variant(via=[middle]))
    assert through.kinematic == pytest.approx(free.kinematic, rel=1e-12)
    assert through.ramps == pytest.approx(free.ramps, rel=0.05)  # one ramp at each end; at the point none


def test_without_velocity_limits_there_is_none():
    free = paper_problem("rr", velocity_limit=[np.inf, np.inf])
    assert ad.lower_bound(free) is None


def test_one_joint_without_limit_leaves_the_kinematic_bound():
    found = ad.lower_bound(paper_problem("rr", velocity_limit=[5.0, np.inf]))
    assert found.duration == found.kinematic == pytest.approx(0.55 * np.pi / 5, rel=1e-12)


def test_the_momentum_of_too_many_joints_is_left_out():
    """Its work grows with the fifth power of their number: one pass of a chain of 30 took 20 s."""
    problem = random_problem(ARMS["ur5"](), 0)
    policy = BoundPolicy(momentum_joints=5)
    alone = ad.lower_bound(problem, policy=policy)
    assert alone.duration == alone.kinematic < ad.lower_bound(problem).duration


def test_stopped_at_once_the_kinematic_bound_is_left():
    found = ad.lower_bound(random_problem(ARMS["ur5"](), 0), stop=lambda: True)
    assert found.duration == found.kinematic


def test_a_wrong_problem_is_refused():
    with pytest.raises(ProblemError, match="pose it"):
        ad.lower_bound(ARMS["ur5"]())


@pytest.mark.parametrize("limit", [100.0, 1e9, 1e-6])
def test_limits_out_of_all_proportion_do_no_harm(limit):
    problem = random_problem(ARMS["ur5"](), 0, velocity_limit=np.full(6, limit))
    found = ad.lower_bound(problem)
    assert found.kinematic <= found.duration < np.inf


def test_all_ways_round_are_covered_those_that_are_not_tried_too():
    problem = ad.MinimumTimeProblem(
        paper_arm("rr").with_limits(None, 6.0), q_start=[0.0, 0.0], q_goal=[3.0, 0.5], wrap=True,
        position_limit=([-np.inf, -3.0], [np.inf, 3.0]),
    )  # fmt: skip
    found, ways = ad.lower_bound(problem), [problem.variant(q_goal=q, wrap=False) for q in problem.goals]
    assert len(ways) == 2
    assert found.duration == min(ad.lower_bound(way).duration for way in ways)
    # Tried are 3 and 3 - 2 pi rad; the next ones are 3 + 2 pi and 3 - 4 pi, at 6 rad/s.
    assert _other_turns(problem) == pytest.approx((3.0 + 2 * np.pi) / 6.0)
    object.__setattr__(problem, "goals", problem.goals[1:])
    assert _other_turns(problem) == pytest.approx(3.0 / 6.0)
