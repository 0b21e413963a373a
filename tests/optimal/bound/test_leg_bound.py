"""The bound of a motion that passes regions and follows lines, against sampled positions and solved motions."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.cycle.posing import problem_of
from armdyn.models.scene.reaching import deviations_of, slid
from armdyn.optimal.bound.cells import Cells, Phase
from armdyn.optimal.bound.chain import chain_bound
from armdyn.optimal.bound.enclosure import Interval
from armdyn.optimal.bound.frame_sets import BoundRegion
from armdyn.optimal.bound.lattice import Effort
from armdyn.optimal.bound.leg import bound_legs
from armdyn.optimal.bound.leg_bound import Passage, _phases, leg_bound, passing_bound, phased_bound, tube
from armdyn.optimal.bound.proof import proven, relaxed
from armdyn.optimal.problem.policy.bound import BoundPolicy

UP, ACROSS = 0.025, 0.3
HERE = np.array([-0.67, -1.44, 2.03, -0.58, 0.9, 0.0])
"""Joint positions of a UR5 whose tool points down, nearly."""
ONCE = ad.MinimumTimeOptions(search="quick", workers=1, bound=False, compile=False)
"""Of one solve, which takes less time than to build its machine code; bounds are computed by the tests themselves."""


@pytest.fixture(scope="module")
def straight():
    """Up by 25 mm, across and down by 25 mm, both on a line within half a millimetre and half a degree."""
    robot = ad.Robot.from_library("ur5", payload=ad.Payload(mass=1.0))
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, HERE)
    origin = data.oMf[robot.model.getFrameId(robot.tip)].translation
    poses = []
    for across in (0.0, ACROSS):
        pose = np.diag([1.0, -1.0, -1.0, 1.0])
        pose[:3, 3] = origin + np.array([0.0, across, 0.0])
        poses.append(ad.GoalPose(robot.tip, pose))
    start = slid(robot, poses[0], HERE, np.zeros(6), robot.limits)
    goal = slid(robot, poses[1], start + np.array([0.75, 0, 0, 0, 0.75, 0]), np.zeros(6), robot.limits)
    cycle = ad.Cycle(robot, start=start, steps=[ad.Move(goal, retreat=ad.Straight(UP), approach=ad.Straight(UP))])
    problem = problem_of(cycle, cycle.moves[0], start, goal)
    leg = bound_legs(problem, BoundPolicy())[0]
    dynamics = leg.dynamics
    lines = {one.leg: BoundRegion(dynamics, one.region) for one in problem.path_constraints}
    return problem, leg, Passage(tuple(BoundRegion(dynamics, one) for one in problem.via), lines)


def members(robot, region, near, along, count, seed):
    """Joint positions with the frame in a region, drawn from all of it: Newton's method on Pinocchio's Jacobian."""
    rng, data, frame = np.random.default_rng(seed), robot.model.createData(), robot.model.getFrameId(region.goal.frame)
    most = np.where(np.isfinite(region.goal.deviations), region.goal.deviations, 0.0)
    found = []
    while len(found) < count:
        off = rng.uniform(-most, most)
        if region.free is not None:
            off[region.free] = rng.uniform(*sorted(along))
        turn = off[3:] * rng.choice([1.0, 0.999])
        target, q = region.goal.pose * pin.SE3(pin.exp3(turn), off[:3]), near.copy()
        for _ in range(50):
            pin.framesForwardKinematics(robot.model, data, q)
            error = pin.log6(data.oMf[frame].actInv(target)).vector
            q = q + np.linalg.pinv(pin.computeFrameJacobian(robot.model, data, q, frame)) @ error
        if np.linalg.norm(error) < 1e-12:
            found.append(q)
    return np.array(found)


def test_forms_hold_zero_in_the_region_and_not_far_outside_it(straight):
    problem, _, passage = straight
    line, near = passage.lines[0], np.asarray(problem.q_start)
    inside = members(problem.robot, line, near, (-UP, 0.0), 60, seed=3)
    deviations = np.abs(deviations_of(problem.robot, line.goal, inside))
    limited = np.isfinite(line.goal.deviations)
    assert np.all(deviations[:, limited] <= line.goal.deviations[limited] + 1e-9)
    assert np.max(deviations[:, limited] / line.goal.deviations[limited]) > 0.9
    box = Interval(np.min(inside, axis=0), np.max(inside, axis=0))
    forms = line.forms(box[None])
    share = (inside - box.centre) / box.radius
    left = forms.centre[:, 0] + share @ forms.gradient[..., 0].T
    assert np.all(np.abs(left) <= forms.rest[:, 0])
    beside = line.forms(Interval.at(near + np.array([0.01, 0, 0, 0, 0, 0]))[None])  # 4 mm off the line
    assert np.any(np.abs(beside.centre) > beside.rest)


def test_a_tube_holds_all_of_its_line(straight):
    problem, leg, passage = straight
    line, near = passage.lines[0], np.asarray(problem.q_start)
    box, plane = tube(leg, line, -UP, (leg.start, leg.goal), 0.31)
    on_line = members(problem.robot, line, near, (-UP, 0.0), 60, seed=4)
    at_plane = members(problem.robot, passage.regions[0], near, (0.0, 0.0), 60, seed=5)
    for own, q in ((box, on_line), (plane, at_plane)):
        assert np.all((own.lower <= q) & (q <= own.upper))
    assert np.max(plane.radius) < 0.02  # 5 mrad at the tool
    longer, _ = tube(leg, line, -UP, (leg.start, leg.goal), 0.33)  # may go further down before it goes up
    assert np.all(longer.lower <= box.lower) and np.all(box.upper <= longer.upper)
    assert (
        tube(
            leg,
            replace(line, goal=replace(line.goal, tolerance=(0.2, 0.2, 0, 1, 1, 1))),
            -UP,
            (leg.start, leg.goal),
            0.36,
        )
        is None
    )


@pytest.fixture(scope="module")
def solved(straight):
    """The motion found, and its bound."""
    problem, leg, passage = straight
    solution = ad.solve_minimum_time(problem, ONCE)
    assert solution.usable
    plain = leg_bound(leg, lambda: False)[0]
    return solution, plain, passing_bound(leg, passage, plain, 0.33, lambda: False)[0]


@pytest.mark.slow
def test_no_motion_found_is_faster(straight, solved):
    """The bound without lines is some 20 % below the motion, that with them at most 4 %."""
    solution, plain, bound = solved
    assert plain < 0.85 * solution.duration
    assert 0.96 * solution.duration < bound < solution.duration


@pytest.mark.slow
def test_a_bound_for_short_motions_says_no_more_than_that(straight, solved):
    _, leg, passage = straight
    _, plain, bound = solved
    assert passing_bound(leg, passage, plain, 0.95 * bound, lambda: False) == (0.95 * bound, False)
    assert passing_bound(leg, passage, plain, np.inf, lambda: True)[0] <= bound


@pytest.mark.slow
def test_phases_and_positions_of_a_motion_are_in_the_boxes(straight, solved):
    """The motion is one of those that the cells speak of."""
    problem, leg, passage = straight
    solution, _, _ = solved
    motion, first = solution.trajectory, passage.regions[0]
    height = deviations_of(problem.robot, first.goal, motion.q)[:, 2]
    passed = int(np.argmax(height <= 0)) if height[0] > 0 else int(np.argmax(height >= 0))
    box, plane = tube(leg, passage.lines[0], -UP, (leg.start, leg.goal), solution.duration)
    assert np.all((box.lower <= motion.q[:passed]) & (motion.q[:passed] <= box.upper))
    phase = Phase(0.0, box, passage.lines[0])
    alone = replace(leg, goal=first.end(plane))
    least = phased_bound(alone, [replace(phase, least=0.02)], 0.02, 0.03, lambda: False)
    assert 0.02 < least <= motion.t[passed]


@pytest.mark.slow
def test_multipliers_need_not_be_the_best(straight, solved):
    """Any give a bound: those of the program, disturbed, give a lower one."""
    _, leg, passage = straight
    solution, _, _ = solved
    tubes = [
        tube(leg, passage.lines[k], -UP, ends, 0.33)
        for k, ends in ((0, (leg.start, leg.goal)), (2, (leg.goal, leg.start)))
    ]
    phases = [
        Phase(0.03, tubes[0][0], passage.lines[0], (passage.regions[0], tubes[0][1])),
        Phase(0.24, leg.position, None, (passage.regions[1], tubes[1][1])),
        Phase(0.03, tubes[1][0], passage.lines[2]),
    ]
    cells = Cells.in_phases(leg, phases, 1.05 * solution.duration)
    forces, ends = cells.forces(leg), cells.ends(leg)
    by = relaxed(leg, cells, forces, ends, 0.3)
    best = proven(leg, cells, forces, ends, by)
    rng = np.random.default_rng(1)
    assert 0.3 < best < solution.duration
    known = [k for k, end in enumerate(ends) if end is not None]
    segment = np.searchsorted(known, np.arange(len(by.way)), side="right")
    for size in (1e-3, 1e-2, 0.1, 1.0):
        way = by.way * (1 + size * rng.uniform(-1, 1, (segment[-1] + 1, 6)))[segment]
        momentum = by.momentum * (1 + size * rng.uniform(-1, 1, by.momentum.shape))
        combinations = [None if one is None else one * (1 + size * rng.uniform(-1, 1)) for one in by.combinations]
        disturbed = replace(by, way=way, momentum=momentum, combinations=combinations)
        other = proven(leg, cells, forces, ends, disturbed)
        assert other < solution.duration


@pytest.mark.slow
def test_a_chain_knows_lines(straight, solved):
    problem, _, _ = straight
    solution, _, bound = solved
    stops = [problem.q_start, problem.q_goal]
    found = chain_bound([problem], stops, solution.duration, Effort(600))
    assert found == pytest.approx(bound, rel=5e-3)
    assert found < solution.duration


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["acceleration", "curve"])
def test_accelerations_and_curves_count_along_lines_and_never_above_a_motion(straight, kind):
    given, _, _ = straight
    robot, limits = given.robot, given.robot.limits
    limited = given.variant(acceleration_limit=np.full(6, 25.0))
    if kind == "curve":
        pairs = zip(robot.joint_names, limits.effort_upper, limits.velocity, strict=True)
        curves = {joint: [[0, most], [0.3 * v, most], [v, 0.2 * most]] for joint, most, v in pairs}
        limited = given.variant(robot=robot.with_torque_speed(curves))
    leg, lines = bound_legs(limited, BoundPolicy())[0], straight[2].lines
    passage = Passage(tuple(BoundRegion(leg.dynamics, one) for one in limited.via), lines)
    solution = ad.solve_minimum_time(limited, ONCE)
    plain, _ = leg_bound(leg, lambda: False)
    found, _ = passing_bound(leg, passage, plain, solution.duration, lambda: False)
    assert solution.usable
    # In the boxes alone the same phases have 0.373 and 0.3183 s.
    assert {"acceleration": 0.43, "curve": 0.319}[kind] < found < solution.duration


@pytest.mark.slow
def test_phases_to_blends_are_no_longer_than_a_motion_s(straight):
    """Blends of 20 mm and 5 degrees: the boxes hold where the motion passes them, and phases take their least times."""
    given, leg, _ = straight
    wide = (*[0.02 / 3**0.5] * 3, *[np.radians(5) / 3**0.5] * 3)
    via = [ad.GoalPose(one.frame, one.placement, (), wide) for one in given.via]
    problem = ad.MinimumTimeProblem(given.robot, q_start=given.q_start, q_goal=given.q_goal, via=via)
    solution = ad.solve_minimum_time(problem, ONCE)
    assert solution.usable
    passage = Passage(tuple(BoundRegion(leg.dynamics, one) for one in via), {})
    first, _, last = phases = _phases(leg, passage, 1.001 * solution.duration, lambda: False)
    begin, end = solution.via_times
    assert first.least <= begin
    assert last.least <= solution.duration - end
    for phase, t in zip(phases, (begin, end), strict=False):
        q = solution.trajectory(t).q
        assert np.all((phase.goal[1].lower <= q) & (q <= phase.goal[1].upper))
        assert np.max(phase.goal[1].radius) < 0.3
    assert passing_bound(leg, passage, 0.2, solution.duration, lambda: False)[0] <= solution.duration
