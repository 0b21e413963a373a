"""From a mesh's solution to exact arcs, or to the motion of a resolved mesh."""

import numpy as np
import pytest

import armdyn as ad
from problems import paper_problem, random_problem

WRONG_SIGN = (
    (
        ad.LinkSpec(length=0.5823, com=0.4612, mass=0.5095, inertia=0.01647),
        ad.LinkSpec(length=0.4924, com=0.3009, mass=0.2761, inertia=0.005306),
        ad.LinkSpec(length=0.54, com=0.27, mass=0.04155, inertia=0.001677),
    ),
    0.01971,
    {
        "q_start": [-1.6994, -2.5563, -2.4354],
        "q_goal": [-1.7385, 0.7317, 2.0545],
        "effort_limit": [2.2874, 1.1361, 1.557],
        "velocity_limit": [12.726, 27.469, 42.489],
    },
)
"""Links, payload [kg] and problem; the arcs end with a switching function of the wrong sign, by 4e-4 of the range."""
STRAYING_COSTATES = (
    (
        ad.LinkSpec(length=0.09103, com=0.0721, mass=0.08092, inertia=6.393e-05),
        ad.LinkSpec(length=0.1883, com=0.1151, mass=0.116, inertia=0.0003259),
        ad.LinkSpec(length=0.3784, com=0.1892, mass=0.05746, inertia=0.001139),
    ),
    0.15,
    {
        "q_start": [-2.448, 3.053, 0.2418],
        "q_goal": [-0.1021, 2.188, -0.3366],
        "effort_limit": [2.114, 1.595, 1.236],
        "velocity_limit": [6.481, 27.03, 8.864],
    },
)
"""The arcs satisfy all conditions, but for the adjoint equations: by 0.0038, and their motion is 3e-5 slower."""

UNREPEATABLE = (
    (
        ad.LinkSpec(length=0.2114, com=0.1675, mass=0.0752, inertia=0.0003205),
        ad.LinkSpec(length=0.5688, com=0.3476, mass=0.2594, inertia=0.006652),
        ad.LinkSpec(length=0.3152, com=0.1576, mass=0.2277, inertia=0.003132),
    ),
    0.2824,
    {
        "q_start": [2.075, -0.7785, -0.1199],
        "q_goal": [-1.807, -2.743, -2.657],
        "effort_limit": [1.09, 2.441, 1.515],
        "velocity_limit": [26.99, 44.98, 32.72],
    },
)
"""The arcs leave feedback no torque to repeat their motion, which is unstable open loop: it was not usable."""


STARTS = 16
"""Guesses that lead to the optima of a default search."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("links", "payload", "given"),
    [WRONG_SIGN, STRAYING_COSTATES, UNREPEATABLE],
    ids=["sign", "costates", "repeat"],
)
def test_arcs_that_are_not_certified_give_way_to_a_resolved_mesh(links, payload, given):
    robot = ad.Robot.from_spec(ad.ArmSpec(name="rrr", links=links), ad.Payload(mass=payload))
    solution = ad.solve_minimum_time(ad.MinimumTimeProblem(robot, **given), ad.MinimumTimeOptions(starts=STARTS))
    assert solution.certified and solution.phases is None
    assert solution.certificate.saving < 1e-5  # of the duration


SINGULAR = random_problem(35, position_limit=(-np.inf, np.inf))
NEAR_A_LIMIT = ad.MinimumTimeProblem(
    ad.Robot.from_spec(ad.ArmSpec.paper("rrr"), ad.Payload(mass=0.16545153616794545)),
    q_start=(-0.5502782980754111, -1.1850936601934012, 3.140660667507336),
    q_goal=(-0.23464747070748926, 0.03015400417049108, 0.5901285518949932),
)
"""Equal intervals show a contact from the start on; it begins after a tenth of the duration."""
HELD_BY_ANOTHER = ad.MinimumTimeProblem(
    ad.Robot.from_spec(ad.ArmSpec.paper("rrr"), ad.Payload(mass=0.2685543656666321)),
    q_start=[1.3538952218800082, -2.962781719364377, 0.5902218077250847],
    q_goal=[0.2689775131611496, -2.8568124099531347, 1.4650162520040144],
)
BESIDE_A_LIMIT = ad.MinimumTimeProblem(
    ad.Robot.from_spec(ad.ArmSpec.paper("rr"), ad.Payload(mass=0.1)),
    q_start=[-0.5136696604371498, 2.8241964993549318],
    q_goal=[1.0571266663392307, 2.8241964993546724],
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "duration"),
    [
        pytest.param(SINGULAR, 0.26497054, id="a singular arc"),
        pytest.param(NEAR_A_LIMIT, 0.193014352, id="a start near a position limit"),
        pytest.param(random_problem(5), None, id="two touches"),
        pytest.param(random_problem(53), None, id="a contact of 22 ms"),
        pytest.param(random_problem(68), None, id="a contact that takes more torque than there is"),
        pytest.param(paper_problem("rrr", 0.1505), None, id="a bounce"),
        pytest.param(HELD_BY_ANOTHER, None, id="a contact that another joint holds"),
        pytest.param(BESIDE_A_LIMIT, None, id="torque that presses beyond a limit"),
    ],
)
def test_limits_of_the_state_and_singular_arcs_are_answered_by_the_resolved_mesh(problem, duration):
    # The durations are the best that any search has found, by exact switching times; the mesh adds up to 1e-6.
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(bound=False))
    assert solution.certified
    assert sum(arc.duration for arc in solution.arcs) == pytest.approx(solution.duration, rel=1e-9)
    if duration is not None:
        assert solution.duration == pytest.approx(duration, rel=2e-6)
