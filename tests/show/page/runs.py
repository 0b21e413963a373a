"""Runs for reports: the facts of a solve, without the solve."""

import numpy as np

import armdyn as ad
from armdyn.show.page.facts import Facts
from armdyn.show.page.motions import ShownMotion
from problems import paper_arm

LIMIT = 3.0
EDGES = (0.08, 0.12, 0.21)
"""Ends of three arcs [s]: joint 2 switches at the first, joint 1 at the second."""


def bang_bang(name="minimum time"):
    """RR under torques that jump: joint 1 at 0.12 s, joint 2 at 0.08 s."""
    robot = paper_arm("rr")
    t = np.array([0.0, 0.08, np.nextafter(0.08, 1), 0.12, np.nextafter(0.12, 1), 0.21])
    tau = LIMIT * np.array([[1, 1], [1, 1], [1, -1], [1, -1], [-1, -1], [-1, -1]])
    q = np.column_stack([-1.5 + 8 * t, 0.1 + 2 * t])
    v = np.broadcast_to([8.0, 2.0], q.shape)
    return robot, ad.Trajectory(t=t, q=q, v=v, tau=tau, joint_names=robot.joint_names, name=name)


FACTS = {
    "usable": True,
    "certified": False,
    "extremal": False,
    "duration": 0.21,
    "gap": None,
    "what_to_do": ["not extremal: raise `max_intervals` or `starts`"],
    "decides": [{"limit": "torque limit", "joint": "joint2", "part": 0.275}],
    "certificate": {"ok": False},
    "assessment": "The motion is executable. It is not certified: H is not constant.",
    "checks": [
        {"name": "lands", "holds": True, "said": "open-loop replay ends within 8e-11 rad of the goal (growth 12)"},
        {"name": "keeps its limits", "holds": True, "said": "no limit is exceeded"},
        {"name": "extremal", "holds": False, "said": "|H| ≤ 3.0e-02, wrong signs ≤ 1.0e-03, 3 arcs"},
        {"name": "lower bound", "holds": None, "said": "none was computed"},
    ],
    "arcs": [
        {"duration": 0.08, "modes": ["torque upper", "torque upper"]},
        {"duration": 0.04, "modes": ["torque upper", "torque lower"]},
        {"duration": 0.09, "modes": ["torque lower", "torque lower"]},
    ],
    "local_optima": [0.2125],
    "sensitivities": {
        "payload_mass": 0.35,
        "effort_upper": [-0.006, -0.015],
        "effort_lower": [0.007, 0.005],
        "velocity": [0.0, 0.0],
    },
    "request": {"command": "armdyn mintime rr", "options": {"robot": "rr", "wrap": False}},
}


def judged(**more):
    """The bang-bang motion with the facts of a solve."""
    robot, motion = bang_bang()
    return robot, ShownMotion("minimum time", motion, Facts({**FACTS, **more}))
