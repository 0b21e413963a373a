import numpy as np

from armdyn.optimal.arcs import Arc, Event, Mode, arcs_between, merged, without_short

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
