"""Motion problems that several tests solve."""

import numpy as np

import armdyn as ad

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
