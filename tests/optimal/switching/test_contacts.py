"""Contacts that cannot be held, or would rather not be: what becomes of them."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.arcs.arc import POSITION, Mode
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.switching.contacts import with_contacts
from armdyn.optimal.switching.extremal.descent import Extremal, fastest
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
    shooting = shooting_problem(Task.of(problem, MinimumTimeOptions(compile=False)), solution.duration)
    found = fastest(shooting, SwitchingStructure.of(solution.phases.arcs, solution.phases.torques), Stop())
    assert isinstance(found, Extremal)
    assert any(mode in POSITION for modes in found.structure.modes() for mode in modes)
    assert not with_contacts(found)
    assert found.structure.duration == pytest.approx(solution.duration, rel=1e-8)


def test_arcs_without_contacts_have_none_to_mend():
    problem = paper_problem("rr", 0.1006)
    solution = ad.solve_minimum_time(problem)
    shooting = shooting_problem(Task.of(problem, MinimumTimeOptions(compile=False)), solution.duration)
    found = fastest(shooting, SwitchingStructure.of(solution.phases.arcs, solution.phases.torques), Stop())
    assert isinstance(found, Extremal)
    assert not with_contacts(found)


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
