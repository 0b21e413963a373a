from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import armdyn as ad
from armdyn.optimal.problem.policy.refinement import ArcsPolicy
from armdyn.optimal.verify.arc import (
    Arc,
    Event,
    Mode,
    arcs_between,
    arcs_of,
    merged,
)
from problems import cart

U, L = Mode.UPPER, Mode.LOWER


def test_arcs_lie_between_events_and_add_up():
    events = [Event(0.6, 0, L), Event(0.2, 1, U)]
    arcs = arcs_between([U, L], events, 1.0)
    assert [arc.modes for arc in arcs] == [(U, L), (U, U), (L, U)]
    np.testing.assert_allclose([arc.duration for arc in arcs], [0.2, 0.4, 0.4], atol=1e-12)


def test_a_touch_divides_without_changing_modes():
    arcs = arcs_between([U], [Event(0.5, 0, Mode.POSITION_UPPER, touch=True)], 1.0)
    assert [arc.modes for arc in arcs] == [(U,), (U,)]
    assert arcs[0].touches == ((0, Mode.POSITION_UPPER),)
    assert len(merged(arcs)) == 2


@pytest.mark.parametrize(("brief", "modes"), [(0.05, (U, Mode.FREE, L)), (0.11, (U, L))])
def test_a_blurred_switch_is_a_switch_where_one_looks_less_closely(brief, modes):
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[1.0])
    torques = np.array([1.0] * 18 + [0.9, 0.5, -0.5, -0.9] + [-1.0] * 18)  # [N], on forty intervals of 0.05 s
    knots = np.linspace(0, 2, 41)
    before = np.nextafter(knots[1:], 0)
    t, tau = np.sort(np.concatenate([knots, before[:-1]])), np.append(np.repeat(torques, 2), torques[-1])[:80]
    v = np.interp(t, knots, np.append(0.0, np.cumsum(torques) * 0.05))
    q = np.interp(t, knots, np.linspace(0, 1, 41))
    motion = ad.Trajectory(t, q[:, None], v[:, None], tau[:, None], problem.robot.joint_names, "mesh")
    arcs = merged(arcs_of(problem, motion, ArcsPolicy(brief=brief)))
    assert tuple(arc.modes[0] for arc in arcs) == modes
    assert sum(arc.duration for arc in arcs) == pytest.approx(2.0)
    if len(arcs) == 2:  # the mean torque of the blur is 0: it is in the middle
        assert arcs[0].duration == pytest.approx(1.0)


MODES = st.sampled_from([U, L, Mode.VELOCITY_UPPER, Mode.POSITION_LOWER, Mode.FREE])
ARCS = st.integers(1, 3).flatmap(
    lambda n: st.lists(st.builds(Arc, st.floats(0.1, 2.0), st.tuples(*n * [MODES])), min_size=1, max_size=7)
)


def total(arcs):
    return sum(arc.duration for arc in arcs)


def of_joint(arcs, joint):
    """The modes of a joint, each once, in their order."""
    modes = [arc.modes[joint] for arc in arcs]
    return [mode for k, mode in enumerate(modes) if k == 0 or mode is not modes[k - 1]]


def events_of(arcs):
    """Changes from arc to arc, one joint after the other."""
    ends = np.cumsum([arc.duration for arc in arcs])
    return [
        Event(float(t), i, after.modes[i])
        for t, before, after in zip(ends, arcs, arcs[1:], strict=False)
        for i in range(len(after.modes))
        if after.modes[i] is not before.modes[i]
    ]


@given(ARCS)
def test_merged_keeps_the_duration_and_every_joints_modes(arcs):
    joined = merged(arcs)
    assert total(joined) == pytest.approx(total(arcs), rel=1e-12)
    assert all(a.modes != b.modes for a, b in pairwise(joined))
    assert merged(joined) == joined
    assert all(of_joint(joined, i) == of_joint(arcs, i) for i in range(len(arcs[0].modes)))


@given(ARCS, st.randoms(use_true_random=False))
def test_arcs_from_their_own_events_are_themselves(arcs, random):
    arcs = merged(arcs)
    events = events_of(arcs)
    again = arcs_between(arcs[0].modes, events, total(arcs))
    assert total(again) == pytest.approx(total(arcs), rel=1e-12)
    assert all(of_joint(again, i) == of_joint(arcs, i) for i in range(len(arcs[0].modes)))
    one_by_one = {event.time for event in events}
    if len(one_by_one) == len(events):  # no two joints switch together: not a part of an arc is between them
        assert [arc.modes for arc in again] == [arc.modes for arc in arcs]
        np.testing.assert_allclose([a.duration for a in again], [a.duration for a in arcs], rtol=1e-9)
        random.shuffle(events)
        assert arcs_between(arcs[0].modes, events, total(arcs)) == again
