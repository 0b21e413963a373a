"""Motion problems that several tests solve."""

import numpy as np

import armdyn as ad
from armdyn.optimal.arcs.arc import Arc, Mode
from armdyn.optimal.indirect.bang_bang import BangBangExtremal, BangBangProblem
from armdyn.optimal.indirect.canonical import canonical_system
from armdyn.optimal.problem.stop import Stop

POSES = {
    "r": ([-np.pi / 2], [np.pi / 20]),
    "rr": ([-np.pi / 2, np.pi / 84], [np.pi / 20, -np.pi / 84]),
    "rrr": ([-np.pi / 2, np.pi / 84, -np.pi / 84], [np.pi / 20, -np.pi / 84, np.pi / 84]),
}
"""Start and goal of the paper's Examples 1 to 3 [rad]."""

CART = """<robot name="cart"><link name="base"/>
<link name="body"><inertial><mass value="1"/>
<inertia ixx=".1" ixy="0" ixz="0" iyy=".1" iyz="0" izz=".1"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="body"/><axis xyz="1 0 0"/>
<limit lower="-1000" upper="1000" effort="1" velocity="1000"/></joint></robot>"""
"""The double integrator: 1 kg on a level rail, at most 1 N."""


def paper_arm(arm, mass=0.1006):
    """An arm of Table 1 with a point mass at its tip."""
    return ad.Robot.from_spec(ad.ArmSpec.paper(arm), payload=ad.Payload(mass=mass))


def paper_problem(arm, mass=0.1006, **limits):
    """Examples 1 to 3."""
    start, goal = POSES[arm]
    return ad.MinimumTimeProblem(paper_arm(arm, mass), q_start=start, q_goal=goal, **limits)


def cart(folder):
    """The double integrator as a robot."""
    path = folder / "cart.urdf"
    path.write_text(CART)
    return ad.Robot.from_urdf(path)


def cart_bang_bang(folder):
    """The double integrator over 2 m: t_f = 2 √2 s, with a switch in the middle."""
    ends = np.array([0.0, 0.0]), np.array([2.0, 0.0])
    return BangBangProblem(canonical_system(cart(folder)), *ends, np.array([-1.0]), np.array([1.0]), 1e-10, Stop())


def cart_guess(modes=(Mode.UPPER, Mode.LOWER), durations=(1.0, 2.0)):
    """A poor guess of its arcs."""
    arcs = tuple(Arc(d, (mode,)) for d, mode in zip(durations, modes, strict=True))
    return BangBangExtremal(arcs, (0,), np.array([[0.0, 0.0, -1.0, -1.0], [1.0, 1.0, -1.0, 0.0]]))


LUUS = """<robot name="luus_two_link"><link name="base"/>
<link name="link1"><inertial><origin xyz="0.5 0 0"/><mass value="1"/><inertia ixx="0.041666666666666664" ixy="0"
 ixz="0" iyy="0.041666666666666664" iyz="0" izz="0.08333333333333333"/></inertial></link>
<joint name="joint1" type="revolute"><parent link="base"/><child link="link1"/><axis xyz="0 0 1"/>
<limit lower="-10" upper="10" effort="1" velocity="1000"/></joint>
<link name="link2"><inertial><origin xyz="0.75 0 0"/><mass value="2"/><inertia ixx="0.10416666666666666" ixy="0"
 ixz="0" iyy="0.10416666666666666" iyz="0" izz="0.20833333333333331"/></inertial></link>
<joint name="joint2" type="revolute"><parent link="link1"/><child link="link2"/><origin xyz="1 0 0"/>
<axis xyz="0 0 1"/><limit lower="-10" upper="10" effort="1" velocity="1000"/></joint></robot>"""
"""R. Luus, Iterative Dynamic Programming (2000), section 12.4.2, example 2: two rods and a tip mass, no gravity."""


def luus_problem(folder):
    """The published two-link benchmark."""
    path = folder / "luus.urdf"
    path.write_text(LUUS)
    return ad.MinimumTimeProblem(ad.Robot.from_urdf(path), q_start=[0.0, 0.5], q_goal=[0.522, 0.5])
