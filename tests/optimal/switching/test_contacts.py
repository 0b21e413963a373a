"""Contacts that cannot be held, or should not be: their removal."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.arcs.arc import POSITION, Mode
from armdyn.optimal.switching.contacts import with_contacts
from armdyn.optimal.switching.extremal.descent import fastest
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.refinement import shooting_problem
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.task import Task
from problems import paper_problem, random_problem


@pytest.mark.slow
def test_a_contact_that_takes_more_torque_than_there_is_becomes_a_touch():
    # The second joint meets its lower limit so hard that holding it there would take 7.5 of 3 N m.
    solution = ad.solve_minimum_time(random_problem(68))
    assert solution.certified
    assert not any(mode in POSITION for arc in solution.arcs for mode in arc.modes)
    assert any(joint == 1 and mode is Mode.POSITION_LOWER for arc in solution.arcs for joint, mode in arc.touches)


@pytest.mark.slow
def test_a_contact_that_the_limit_would_have_to_pull_at_is_a_bounce():
    solution = ad.solve_minimum_time(paper_problem("rrr", 0.1505))
    assert solution.certified
    assert not any(mode in POSITION for arc in solution.arcs for mode in arc.modes)
    touches = [(joint, mode) for arc in solution.arcs for joint, mode in arc.touches]
    assert len(touches) > len(set(touches))  # the same limit twice


@pytest.mark.slow
def test_another_joint_holds_a_contact_while_the_joints_own_torque_is_full():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rrr"), ad.Payload(mass=0.2685543656666321))
    start = [1.3538952218800082, -2.962781719364377, 0.5902218077250847]
    goal = [0.2689775131611496, -2.8568124099531347, 1.4650162520040144]
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal)
    solution = ad.solve_minimum_time(problem)
    assert solution.certified
    held = [k for k, arc in enumerate(solution.arcs) if arc.modes[1] is Mode.POSITION_LOWER]
    assert held
    assert all(solution.arcs[k].modes[2] is Mode.FREE for k in held)
    own = np.isin(solution.phases.arc_of, held)
    limits = problem.limits
    assert np.allclose(solution.phases.tau[own, :, 1], limits.effort_upper[1])
    assert np.all(np.abs(solution.phases.tau[own, :, 2]) < limits.effort_upper[2])


@pytest.mark.slow
def test_a_contact_that_is_pushed_all_along_stays():
    problem = random_problem(53)
    solution = ad.solve_minimum_time(problem)
    shooting = shooting_problem(Task.of(problem, MinimumTimeOptions(compile=False)), solution.trajectory)
    found, why = fastest(shooting, SwitchingStructure.of(solution.phases.arcs, solution.phases.torques))
    assert not why
    assert any(mode in POSITION for modes in found.structure.modes() for mode in modes)
    assert not with_contacts(found)
    assert found.structure.duration == pytest.approx(solution.duration, rel=1e-8)


def test_arcs_without_contacts_have_none_to_mend():
    problem = paper_problem("rr", 0.1006)
    solution = ad.solve_minimum_time(problem)
    shooting = shooting_problem(Task.of(problem, MinimumTimeOptions(compile=False)), solution.trajectory)
    found, why = fastest(shooting, SwitchingStructure.of(solution.phases.arcs, solution.phases.torques))
    assert not why
    assert not with_contacts(found)


@pytest.mark.slow
def test_a_joint_that_its_torque_cannot_hold_on_its_velocity_limit_is_kept_there_by_another():
    # When the first joint is to brake, the second would take 1.27 times its torque to stay on its limit of 21.4 rad/s.
    links = (
        ad.LinkSpec(length=0.16, com=0.127, mass=0.42, inertia=0.00103),
        ad.LinkSpec(length=0.157, com=0.0959, mass=0.0437, inertia=8.53e-5),
    )
    robot = ad.Robot.from_spec(ad.ArmSpec(name="rr", links=links), ad.Payload(mass=0.239))
    problem = ad.MinimumTimeProblem(
        robot,
        q_start=[-1.986, -1.035],
        q_goal=[-0.868, 0.0106],
        effort_limit=[7.615, 5.144],
        velocity_limit=[17.52, 21.45],
    )
    solution = ad.solve_minimum_time(problem)
    assert solution.certified
    (kept,) = [arc for arc in solution.arcs if arc.modes == (Mode.FREE, Mode.VELOCITY_UPPER)]
    begin = sum(arc.duration for arc in solution.arcs[: solution.arcs.index(kept)])
    inside = solution.trajectory(begin + np.linspace(0.1, 0.9, 9) * kept.duration)
    np.testing.assert_allclose(inside.v[:, 1], 21.45, rtol=1e-6)
    np.testing.assert_allclose(inside.tau[:, 1], -5.144, rtol=1e-5)
    assert np.all(np.abs(inside.tau[:, 0]) < 7.6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("links", "payload", "limits", "way", "jumps"),
    [
        pytest.param(
            ((0.1054, 0.08345, 0.09045, 9.574e-5), (0.268, 0.1638, 0.2499, 0.001422)),
            0.05174,
            ([7.987, 1.982], [25.42, 36.51]),
            ([-1.32, 1.298], [1.39, 0.3614]),
            (True, True),
            id="other torque jumps at both ends",
        ),
        pytest.param(
            ((0.3359, 0.266, 0.3919, 0.004215), (0.4166, 0.2546, 0.1302, 0.001791)),
            0.2046,
            ([8.136, 2.215], [20.79, 12.99]),
            ([-1.138, 1.249], [-2.846, -2.991]),
            (False, True),
            id="velocity limit is met without acceleration",
        ),
    ],
)
def test_a_velocity_limit_held_by_another_torque_is_read_from_the_mesh(links, payload, limits, way, jumps):
    # The other torque looked like a singular arc for 14 and 52 % of the time, which no short polynomial follows.
    spec = ad.ArmSpec(
        name="rr", links=tuple(ad.LinkSpec(length=a, com=c, mass=m, inertia=inertia) for a, c, m, inertia in links)
    )
    (effort, speed), (start, goal) = limits, way
    robot = ad.Robot.from_spec(spec, ad.Payload(mass=payload))
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, effort_limit=effort, velocity_limit=speed)
    solution = ad.solve_minimum_time(problem)
    assert solution.certified
    assert solution.certificate.adjoint_error < 1e-6  # an integration of its own; it comes to 2e-8
    (kept,) = [arc for arc in solution.arcs if arc.modes[0] is Mode.FREE]
    begin = sum(arc.duration for arc in solution.arcs[: solution.arcs.index(kept)])
    inside = solution.trajectory(begin + np.linspace(1e-6, 1 - 1e-6, 9) * kept.duration)
    np.testing.assert_allclose(np.abs(inside.v[:, 1]), speed[1], rtol=1e-6)
    np.testing.assert_allclose(np.abs(inside.tau[:, 1]), effort[1], rtol=1e-5)
    assert np.all(np.abs(inside.tau[1:-1, 0]) < effort[0])
    assert [bool(abs(tau) < 0.999 * effort[0]) for tau in inside.tau[[0, -1], 0]] == list(jumps)
