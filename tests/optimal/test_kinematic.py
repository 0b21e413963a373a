"""Minimum time without torques: of arms whose inertias are unknown, against closed forms and finite differences."""

import re

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError, UrdfError
from armdyn.optimal.gap import check_motion
from oracles import robot_named

BARE = re.sub(r"<inertial>.*?</inertial>", "", ad.Robot.from_spec(ad.ArmSpec.paper("rrr")).urdf, flags=re.DOTALL)
BARE = BARE.replace('velocity="1000.0"', 'velocity="2.0"')
ENDS = {"q_start": [0.0, 0.0, 0.0], "q_goal": [1.0, 0.5, -0.6]}


@pytest.fixture(scope="module")
def bare():
    return ad.Robot.from_urdf_string(BARE)


def solved(robot, **more):
    return ad.solve_minimum_time(ad.MinimumTimeProblem(robot, **ENDS, kinematic=True, **more))


@pytest.mark.parametrize(
    ("limits", "duration"),
    [
        ({"acceleration_limit": 3.0}, 2 * np.sqrt(1 / 3)),  # two parabolas
        ({"acceleration_limit": 8.0}, 1 / 2 + 2 / 8),  # a cruise at 2 rad/s
        ({"jerk_limit": 20.0}, 4 * np.cbrt(1 / (2 * 20))),  # four ramps of the acceleration
        ({"acceleration_limit": 3.0, "velocity_reserve": 0.5}, 1 / 1 + 1 / 3),
    ],
)
def test_the_slowest_joint_decides(bare, limits, duration):
    """Closed forms of 1 rad at 2 rad/s at most; profiles keep 1e-5 of the velocity limits free."""
    solution = solved(bare, **limits)
    assert solution.usable and solution.certified and solution.duration == pytest.approx(duration, rel=1.1e-5)
    assert solution.lower_bound == pytest.approx(duration, rel=1e-3) and solution.lower_bound <= duration * (1 + 1e-9)
    motion = solution.trajectory
    assert not np.any(motion.tau) and motion.model_hash == bare.model_hash
    assert solution.problem.robot is bare and solution.problem.kinematic
    assert "without torques: the arm's inertias are unknown" in str(solution)
    assert "torque limit" not in str(solution) and "without torques" in repr(solution)
    steps = np.diff(motion.t) > 1e-6
    rates = np.diff(motion.v, axis=0)[steps] / np.diff(motion.t)[steps, None]
    # Differences of a replay to 1e-10 rad/s, over steps of a millisecond.
    assert np.max(np.abs(rates)) <= limits.get("acceleration_limit", np.inf) * (1 + 1e-5)


@pytest.mark.slow
def test_among_obstacles():
    """An arm with inertias, whose torques are left out; the straight line is not clear."""
    robot = robot_named("panda")
    problem = ad.MinimumTimeProblem(
        robot, q_start="ready", q_goal=[1, 0.2, 0.5, -1.5, 0.3, 2, -0.5], kinematic=True, acceleration_limit=5.0,
        jerk_limit=500.0, obstacles=[ad.Box(size=(0.1, 0.1, 0.5), placement=(0.4, 0.25, 0.4))], self_collision=True,
    )  # fmt: skip
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(search="quick"))
    free = ad.solve_minimum_time(problem.without_obstacles())
    model = problem.collision_model()
    assert free.problem.kinematic and any(model.nearer(q, 0.0) for q in free.trajectory.q[::20])
    assert solution.usable and solution.clearance.distance >= problem.clearance - 1e-6
    assert not np.any(solution.trajectory.tau) and "without torques: as requested" in str(solution)


def test_torques_are_refused_in_a_kinematic_problem(bare):
    rates = {"acceleration_limit": 3.0}
    for more in ({"effort_limit": 3.0}, {"reserve": 0.1}, {"passive": ["joint1"]}, {"effort_weight": 1.0}):
        with pytest.raises(ProblemError, match=f"`{next(iter(more))}` is about torques"):
            ad.MinimumTimeProblem(bare, **ENDS, kinematic=True, **rates, **more)
    with pytest.raises(ProblemError, match="torque-rate limits are about torques"):
        ad.MinimumTimeProblem(bare, **ENDS, kinematic=True, **rates, path_constraints=[ad.TorqueRateLimit(5.0)])
    with pytest.raises(ProblemError, match="'joint1' has no limit of its acceleration"):
        ad.MinimumTimeProblem(bare, **ENDS, kinematic=True)
    panda = ad.ControllerPreset.named("franka-panda", "torque")
    ends = {"q_start": "ready", "q_goal": [1, 0.2, 0.5, -1.5, 0.3, 2, -0.5]}
    with pytest.raises(ProblemError, match="torque interface"):
        ad.MinimumTimeProblem(robot_named("panda"), **ends, kinematic=True, preset=panda)


def test_without_the_word_unknown_torques_are_refused(bare):
    with pytest.raises(UrdfError, match=r"links without mass: link1, link2, link3.*kinematic=True"):
        ad.MinimumTimeProblem(bare, **ENDS)
    for door in (ad.Dynamics, lambda robot: robot.holding_torque([0.0] * 3), ad.mujoco_model):
        with pytest.raises(UrdfError, match="links without mass"):
            door(bare)
    with pytest.raises(UrdfError, match="links without mass"):
        ad.simulate_pid(bare, **ENDS, gains=ad.PidGains(kp=30.0, ki=50.0, kd=10.0))
    assert ad.MinimumTimeProblem(bare.with_armature(0.1), **ENDS).robot.has_dynamics


def test_a_problem_file_keeps_it(bare, tmp_path):
    problem = ad.MinimumTimeProblem(bare, **ENDS, kinematic=True, acceleration_limit=3.0)
    (tmp_path / "problem.toml").write_text(problem.to_toml())
    again = ad.read_problem(tmp_path / "problem.toml")
    assert again.kinematic and ad.lower_bound(again).duration == pytest.approx(2 * np.sqrt(1 / 3), rel=1e-3)


def test_motions_of_other_planners_are_read_without_torques(bare):
    t = np.linspace(0, 1, 11)
    motion = ad.trajectory_from_path(bare, t, np.outer(t**2, [0.5, 0.2, 0.1]))
    assert not np.any(motion.tau)
    check = check_motion(bare, motion)
    assert check.feasible and np.isnan(check.replay_error) and "replay_error" not in check.facts()
    fast = check_motion(bare, ad.trajectory_from_path(bare, t, np.outer(10 * t**2, [0.5, 0.2, 0.1])))
    assert not fast.feasible and "velocity" in str(fast.worst_violation)
