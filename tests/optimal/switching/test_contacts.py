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
def test_where_another_joint_would_hold_a_contact_the_answer_is_as_fast():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rrr"), ad.Payload(mass=0.2685543656666321))
    start = [1.3538952218800082, -2.962781719364377, 0.5902218077250847]
    goal = [0.2689775131611496, -2.8568124099531347, 1.4650162520040144]
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal)
    solution = ad.solve_minimum_time(problem)
    assert solution.certified
    # Exact arcs in which the third joint's torque held the second on its lower limit took 0.14887097832 s.
    assert solution.duration == pytest.approx(0.14887097832, rel=1e-6)


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
@pytest.mark.parametrize(
    ("links", "payload", "limits", "way", "exact"),
    [
        # When the first joint is to brake, the second would take 1.27 times its torque to stay on its limit.
        pytest.param(
            ((0.16, 0.127, 0.42, 0.00103), (0.157, 0.0959, 0.0437, 8.53e-5)),
            0.239,
            ([7.615, 5.144], [17.52, 21.45]),
            ([-1.986, -1.035], [-0.868, 0.0106]),
            0.1359824936,
            id="own torque is too weak",
        ),
        pytest.param(
            ((0.1054, 0.08345, 0.09045, 9.574e-5), (0.268, 0.1638, 0.2499, 0.001422)),
            0.05174,
            ([7.987, 1.982], [25.42, 36.51]),
            ([-1.32, 1.298], [1.39, 0.3614]),
            0.2083723785,
            id="other torque jumps at both ends",
        ),
        pytest.param(
            ((0.3359, 0.266, 0.3919, 0.004215), (0.4166, 0.2546, 0.1302, 0.001791)),
            0.2046,
            ([8.136, 2.215], [20.79, 12.99]),
            ([-1.138, 1.249], [-2.846, -2.991]),
            0.4706565857,
            id="velocity limit is met without acceleration",
        ),
    ],
)
def test_where_another_torque_holds_a_joint_on_its_velocity_limit_the_mesh_answers(links, payload, limits, way, exact):
    # The other torque looks like a singular arc for up to 52 % of the time, which no short polynomial follows.
    spec = ad.ArmSpec(
        name="rr", links=tuple(ad.LinkSpec(length=a, com=c, mass=m, inertia=inertia) for a, c, m, inertia in links)
    )
    (effort, speed), (start, goal) = limits, way
    robot = ad.Robot.from_spec(spec, ad.Payload(mass=payload))
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, effort_limit=effort, velocity_limit=speed)
    solution = ad.solve_minimum_time(problem)
    assert solution.certified
    # `exact`: arcs with that contact, integrated to 1e-9 and certified by their costates. The resolved mesh is 1.4e-6
    # to 5.2e-6 slower.
    assert solution.duration == pytest.approx(exact, rel=1e-5)
    inside = solution.trajectory(np.linspace(0, solution.duration, 2001))
    kept = np.abs(inside.v[:, 1]) > (1 - 1e-4) * speed[1]  # meshes stray by 2e-5 from velocity limits
    kept &= (np.abs(inside.tau[:, 1]) > 0.999 * effort[1]) & (np.abs(inside.tau[:, 0]) < 0.999 * effort[0])
    assert np.mean(kept) > 0.03  # of the exact arcs 3.7, 14 and 52 %
