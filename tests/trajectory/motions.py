"""Motions of all kinds that a trajectory can say: jumps, samples next to each other, clocks that have run for long."""

import numpy as np
from hypothesis import strategies as st

from armdyn.trajectory import HOLDS, LEAST_STEP, Trajectory

NUMBER = st.floats(-50, 50)


@st.composite
def trajectories(draw):
    """Steps from one ulp to seconds, from a start within a day of zero; 1 µs long at least."""
    start = draw(st.sampled_from([0.0, -0.3, 1e-9, 1.0, 86400.0]))
    times = [start]
    for step in draw(st.lists(st.sampled_from(["ulp", 1e-12, 1e-9, 1e-8, 3e-7, 1e-3, 0.0101, 0.5]), max_size=10)):
        last = times[-1]
        times.append(max(np.nextafter(last, np.inf), last + LEAST_STEP * 2) if step == "ulp" else last + step)
    times.append(max(times) + draw(st.floats(1e-6, 1.5)))
    t = np.unique(times)
    joints = draw(st.integers(1, 3))
    count = t.size * joints
    q, v, tau = (np.reshape(draw(st.lists(NUMBER, min_size=count, max_size=count)), (t.size, joints)) for _ in range(3))
    names = [f"joint{i}" for i in range(joints)]
    return Trajectory(t, q, v, tau, joint_names=names, hold=draw(st.sampled_from(HOLDS)))
