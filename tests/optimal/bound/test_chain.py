"""The bound of a chain against sums of bounds, brute force over branches, and members of the stops' sets."""

from functools import partial
from itertools import pairwise, product

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.models.scene.reaching import poses_reaching
from armdyn.optimal.bound.chain import chain_bound, covers
from armdyn.optimal.bound.lattice import Effort
from armdyn.optimal.bound.leg import bound_legs
from armdyn.optimal.problem.policy.bound import BoundPolicy
from problems import paper_arm

UR5 = np.array(
    [[-0.1, -1.0, 1.7, -2.0, -1.3, 0.3], [0.3, -1.2, 1.4, -1.7, -1.5, 0.2], [1.0, -0.9, 1.2, -1.6, -1.6, 0.7]]
)
"""Home, and two joint positions that reach bins."""


def placement(robot, q):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, np.asarray(q, dtype=float))
    return data.oMf[robot.model.getFrameId(robot.tip)].copy()


def motions(robots, poses, **given):
    """Problems from each pose to the next."""
    ends = zip(robots, pairwise(poses), strict=True)
    return [ad.MinimumTimeProblem(robot, q_start=a, q_goal=b, **given) for robot, (a, b) in ends]


def boxes(problems, stops, upper):
    """Number of boxes that enclose each stop's joint positions that are reached in time."""
    legs = [bound_legs(problem, BoundPolicy())[0] for problem in problems]
    return [len(layer) for layer in covers(legs, stops, upper, lambda: False)]


def test_points_have_the_sum_of_their_bounds():
    """Of arms with different payloads."""
    arms = [ad.Robot.from_library("ur5", payload=ad.Payload(mass=mass)) for mass in (0.0, 2.0)]
    poses = [UR5[1], UR5[2], UR5[1]]
    problems = motions(arms, poses)
    alone = [ad.lower_bound(problem).duration for problem in problems]
    assert chain_bound(problems, poses, np.inf, Effort(600)) == pytest.approx(sum(alone), rel=1e-12)
    assert boxes(problems, poses, np.inf) == [1, 1, 1]


@pytest.fixture(scope="module")
def two_branches():
    """An elbow arm, two stops with two branches each, and the chains through them."""
    robot = paper_arm("rr").with_limits(None, 2.0)
    home, stops = np.array([0.1, 0.4]), []
    for q in ([0.9, 0.5], [1.5, -0.7]):
        goal = ad.GoalPose(robot.tip, placement(robot, q).translation)
        stops.append((goal, poses_reaching(robot, goal, home, robot.limits)))
    return robot, home, stops


def brute_force(robot, home, stops, duration):
    """The least sum of durations over all branches."""
    first, second = (branches for _, branches in stops)
    assert len(first) == len(second) == 2

    def between(starts, ends):
        return np.array([[duration(motions([robot], [a, b])[0]) for b in ends] for a in starts])

    sums = between([home], first).T + between(first, second) + between(second, [home]).T
    return np.min(sums)


@pytest.mark.slow
def test_two_branches_at_two_stops(two_branches):
    robot, home, stops = two_branches
    least = brute_force(*two_branches, lambda problem: ad.lower_bound(problem).duration)
    stops = [home, *(goal for goal, _ in stops), home]
    problems = motions([robot] * 3, [home, *np.array([[0.9, 0.5], [1.5, -0.7]]), home])
    for upper in (1.1 * least, least * (1 + 1e-9)):
        found = chain_bound(problems, stops, upper, Effort(600))
        assert found <= least * (1 + 1e-6)  # a bound of the same motions, from other first grids
        assert found == pytest.approx(least, rel=1.1e-3)  # within the share of the policy
        assert 0 < chain_bound(problems, stops, upper, Effort(0)) < found


@pytest.mark.slow
def test_two_branches_at_two_stops_against_least_times(two_branches):
    robot, home, stops = two_branches
    options = ad.MinimumTimeOptions(bound=False, calm=0.0)
    solved = brute_force(robot, home, stops, lambda problem: ad.solve_minimum_time(problem, options).duration)
    problems = motions([robot] * 3, [home, *np.array([[0.9, 0.5], [1.5, -0.7]]), home])
    found = chain_bound(problems, [home, *(goal for goal, _ in stops), home], solved, Effort(600))
    assert 0.995 * solved < found <= solved


def test_no_chain_is_slower_than_all_that_are_known(two_branches):
    robot, home, stops = two_branches
    stops = [home, *(goal for goal, _ in stops), home]
    problems = motions([robot] * 3, [home, [0.9, 0.5], [1.5, -0.7], home])
    whole = chain_bound(problems, stops, 1.0, Effort(600))
    assert chain_bound(problems, stops, 0.5 * whole, Effort(600)) == 0.5 * whole
    assert chain_bound(problems, stops, 1.0, Effort(1000, lambda: True)) <= whole


@pytest.mark.slow
def test_branches_of_a_ur5_are_those_that_inverse_kinematics_find():
    robot = ad.Robot.from_library("ur5")
    home, limits = UR5[0], robot.limits
    goals = [ad.GoalPose(robot.tip, placement(robot, q)) for q in UR5[1:]]
    problems = motions([robot] * 3, [*UR5, home])
    upper = 1.6
    stops = [home, *goals, home]
    alone = sum(ad.lower_bound(problem).duration for problem in problems)
    assert chain_bound(problems, stops, upper, Effort(600)) == pytest.approx(alone, rel=1.1e-3)
    for goal, count in zip(goals, boxes(problems, stops, upper)[1:-1], strict=True):
        branches = [q + 2 * np.pi * np.array(turn) for q in poses_reaching(robot, goal, home, limits, seed=7, most=20)
                    for turn in product((-1, 0, 1), repeat=6)]  # fmt: skip
        near = [q for q in branches if np.all((limits.position_lower <= q) & (q <= limits.position_upper))
                and 2 * np.max(np.abs(q - home) / limits.velocity) < upper]  # fmt: skip
        assert 1 <= count <= len(near)


@pytest.mark.slow
def test_a_motion_between_two_sets():
    """Of all branches and whole turns within the limits of a UR5."""
    robot = ad.Robot.from_library("ur5")
    goals = [ad.GoalPose(robot.tip, placement(robot, q)) for q in UR5[1:]]
    problem = ad.MinimumTimeProblem(robot, q_start=UR5[1], q_goal=UR5[2])
    member = ad.lower_bound(problem).duration
    kinematic, found = (chain_bound([problem], goals, 1.2 * member, Effort(n)) for n in (0, 10))
    assert min(boxes([problem], goals, 1.2 * member)) >= 8
    # One bound by momentum counts for all whole turns of both ends alike: there are 64 of them.
    assert 1.1 * kinematic < found <= member
    starts, ends = (poses_reaching(robot, goal, UR5[0], robot.limits, seed=3) for goal in goals)
    assert kinematic <= min(problem.variant(q_start=a, q_goal=b).duration_bound() for a in starts for b in ends)
    wide = ad.GoalPose(robot.tip, placement(robot, UR5[0]), tolerance=[0.02] * 3 + [0.1] * 3)
    passing = chain_bound([problem.variant(via=[wide])], goals, 1.2 * member, Effort(10))
    through = ad.lower_bound(problem.variant(via=[UR5[0]]))  # a member of the region
    assert found <= passing <= through.duration


@pytest.mark.slow
def test_a_motion_of_an_endless_arm_between_two_sets():
    """Members of the sets, other turns among them, make no faster motion."""
    robot = paper_arm("rr").with_limits(None, 2.0)
    goals = [ad.GoalPose(robot.tip, placement(robot, q).translation) for q in ([2.9, 0.5], [-2.5, -0.7])]
    limits = {kind: {"position_limit": (-most, most)} for kind, most in (("endless", np.inf), ("wide", 4 * np.pi))}
    starts, ends = (poses_reaching(robot, goal, [0.3, 0.2], robot.limits, seed=7) for goal in goals)
    turns = [2 * np.pi * np.array(turn) for turn in product((-1, 0, 1), repeat=2)]
    members = [
        ad.lower_bound(problem)
        for a, b, turn in product(starts, ends, turns)
        for problem in motions([robot], [a, b + turn], **limits["endless"])
    ]
    least = min(members, key=lambda one: one.duration)
    upper = 1.1 * least.duration
    chains = [motions([robot], [[0, 0], [1, 1]], **given) for given in limits.values()]
    endless, wide = (chain_bound(chain, goals, upper, Effort(600)) for chain in chains)
    assert endless == pytest.approx(wide, rel=1e-3)
    assert 0.97 * least.duration < endless <= least.duration
    assert chain_bound(chains[0], goals, upper, Effort(0)) <= least.kinematic


@pytest.mark.slow
def test_via_regions_add_the_ramps_of_a_retreat():
    """Up by 25 mm within half a millimetre, and away: the region is passed at any velocity."""
    robot, (_, q, over) = ad.Robot.from_library("ur5"), UR5
    above = placement(robot, q)
    above.translation[2] += 0.025
    tolerance = (5e-4, 5e-4, 5e-4, 5e-3, 5e-3, 5e-3)
    problem = ad.MinimumTimeProblem(robot, q_start=q, q_goal=over)
    passing = problem.variant(via=[ad.GoalPose(robot.tip, above, tolerance=tolerance)])
    plain, found = (chain_bound([one], [q, over], 0.5, Effort(30)) for one in (problem, passing))
    assert plain == pytest.approx(ad.lower_bound(problem).duration, rel=1e-12)
    assert found > plain
    # A joint position that brings the frame into the region is one of those that the bound holds for.
    member = poses_reaching(robot, passing.via[0], q, robot.limits)[0]
    assert found <= ad.lower_bound(problem.variant(via=[member])).duration
    unbounded = problem.variant(via=[ad.GoalPose(robot.tip, above, free=("z",), tolerance=(5e-4, 5e-4, 0, 0, 0, 0))])
    assert chain_bound([unbounded], [q, over], 0.5, Effort(600)) == plain


@pytest.mark.slow
def test_a_set_of_a_redundant_arm():
    """Members of the set, found by inverse kinematics from another seed, make no faster chain."""
    robot = ad.Robot.from_library("panda")
    home = np.array([-0.3, 0.1, 0.0, -2.0, 0.0, 2.1, 0.5])
    over = placement(robot, home)
    over.translation[1] += 0.2
    goal = ad.GoalPose(robot.tip, over)
    members = poses_reaching(robot, goal, home, robot.limits, seed=5)
    chains = [motions([robot] * 2, [home, q, home]) for q in members[:2]]
    least = min(sum(ad.lower_bound(problem).duration for problem in chain) for chain in chains)
    stops, upper = [home, goal, home], 1.01 * least
    assert 0.95 * least < chain_bound(chains[0], stops, upper, Effort(60)) <= 1.001 * least
    assert boxes(chains[0], stops, upper)[1] > 1


def stopped_after(polls, first):
    """Whether at least this many polls were before this one."""
    return next(polls) >= first


def test_a_stop_while_regions_are_divided_ends_the_proof_at_once(two_branches):
    robot, home, stops = two_branches
    stops = [home, *(goal for goal, _ in stops), home]
    problems = [ad.MinimumTimeProblem(robot, q_start=home, q_goal=home + 0.5)] * 3
    whole = chain_bound(problems, stops, 1.0, Effort(600))
    for first in range(1, 30, 4):
        polls = iter(range(1000))
        found = chain_bound(problems, stops, 1.0, Effort(100, partial(stopped_after, polls, first)))
        assert next(polls) <= first + 5  # and whatever is known then holds
        assert found <= whole
