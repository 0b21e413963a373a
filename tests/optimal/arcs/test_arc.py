import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.arcs.arc import Arc, Event, Mode, arcs_between, detect, merged, without_short
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


def test_short_arc_between_two_switches_turns_their_order():
    arcs = [Arc(0.5, (U, U)), Arc(1e-9, (L, U)), Arc(0.5, (L, L))]
    assert [arc.modes for arc in without_short(arcs, 1e-6)] == [(U, U), (U, L), (L, L)]


def test_short_arc_there_and_back_goes():
    arcs = [Arc(0.5, (U,)), Arc(1e-9, (L,)), Arc(0.5, (U,))]
    (arc,) = without_short(arcs, 1e-6)
    assert arc.modes == (U,)
    assert abs(arc.duration - 1.0) < 1e-12


@pytest.mark.parametrize(("switch", "modes"), [(2, (U, Mode.FREE, L)), (4, (U, L))])
def test_a_blurred_switch_is_a_switch_where_one_looks_less_closely(tmp_path, switch, modes):
    problem = ad.MinimumTimeProblem(cart(tmp_path), q_start=[0.0], q_goal=[1.0])
    torques = np.array([1.0] * 18 + [0.9, 0.5, -0.5, -0.9] + [-1.0] * 18)  # [N], on forty intervals of 0.05 s
    knots = np.linspace(0, 2, 41)
    before = np.nextafter(knots[1:], 0)
    t, tau = np.sort(np.concatenate([knots, before[:-1]])), np.append(np.repeat(torques, 2), torques[-1])[:80]
    v = np.interp(t, knots, np.append(0.0, np.cumsum(torques) * 0.05))
    q = np.interp(t, knots, np.linspace(0, 1, 41))
    motion = ad.Trajectory(t, q[:, None], v[:, None], tau[:, None], problem.robot.joint_names, "mesh")
    arcs = merged(detect(problem, motion, knots / 2, switch))
    assert tuple(arc.modes[0] for arc in arcs) == modes
    assert sum(arc.duration for arc in arcs) == pytest.approx(2.0)
    if switch == 4:  # the mean torque of the blur is 0: it is in the middle
        assert arcs[0].duration == pytest.approx(1.0)
