"""MJCFs written by hand."""

from armdyn.models.values.spec import PLANAR_LINKS

AXIAL = [0.5 * link.mass * 0.012**2 for link in PLANAR_LINKS]
"""Moments of the paper's rods about their own axes, as `urdf_from_spec` has them [kg m²]."""


def inertial(i):
    link = PLANAR_LINKS[i]
    return f'<inertial mass="{link.mass}" pos="{link.com} 0 0" diaginertia="{AXIAL[i]} {link.inertia} {link.inertia}"/>'


RR = f"""<mujoco model="rr">
 <compiler angle="radian"/>
 <default>
  <joint axis="0 -1 0"/>
  <default class="arm"><joint range="-3.141592653589793 3.141592653589793"/><motor ctrlrange="-3 3"/></default>
 </default>
 <worldbody>
  <body name="link1" childclass="arm">
   <joint name="joint1"/>{inertial(0)}
   <body name="link2" pos="{PLANAR_LINKS[0].length} 0 0">
    <joint name="joint2"/>{inertial(1)}
    <site name="tip" pos="{PLANAR_LINKS[1].length} 0 0"/>
   </body>
  </body>
 </worldbody>
 <actuator><motor joint="joint1" class="arm"/><motor joint="joint2" class="arm"/></actuator>
</mujoco>"""
"""The paper's RR."""


def mjcf(bodies, more="", compiler=""):
    """An MJCF of bodies in the world."""
    return f'<mujoco model="m"><compiler {compiler}/>{more}<worldbody>{bodies}</worldbody></mujoco>'


def one(joint='<joint name="j"/>', inside='<geom size="0.1"/>', name="b", place=""):
    """A body with a joint."""
    return f'<body name="{name}" {place}>{joint}{inside}</body>'


def two(joint='<joint name="k"/>', place="", first='<joint name="j"/>', inner="c"):
    """A body with a joint, and in it another with its own."""
    return one(first, '<geom size="0.1"/>' + one(joint, name=inner, place=place))
