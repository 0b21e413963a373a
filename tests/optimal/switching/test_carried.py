"""Contacts that another joint's torque holds: on which limit the joint's own torque is."""

import numpy as np

from armdyn.optimal.arcs.arc import Mode
from armdyn.optimal.switching.carried import with_other_press
from armdyn.optimal.switching.extremal.change import Carrier, Change
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.signs import WrongSign

U, L, P = Mode.UPPER, Mode.LOWER, Mode.POSITION_UPPER


def test_a_joint_in_contact_goes_to_its_other_torque_limit_where_that_is_asked_for():
    changes = Change(0, P, carrier=Carrier(1, U, L)), Change(0, L)
    given = SwitchingStructure((U, L), changes, np.array([1.0, 2.0]), np.zeros((2, 4)), 3.0)

    def wrong(begin, end, carried):
        return WrongSign(1.0, 0, U, begin, end, (begin + end) / 2, carried)

    pressed = with_other_press(given, [wrong(1.2, 1.8, True)])
    assert pressed.changes == (Change(0, P, carrier=Carrier(1, L, L)), Change(0, L))
    assert with_other_press(given, [wrong(1.2, 1.8, False)]) is None  # its torque is no contact's
    assert with_other_press(given, [wrong(2.2, 2.8, True)]) is None  # after the contact
