import numpy as np
import pytest
from scipy.optimize import brentq

from armdyn.models import PLANAR_ARMS
from armdyn.paper.claims.feasibility import all_holdings, holding, largest_payload
from armdyn.paper.outcomes.case import READINGS
from paper.references import EVERY, REFERENCE, reference


@pytest.mark.parametrize("arm", PLANAR_ARMS)
@pytest.mark.parametrize(("payload", "reading"), EVERY)
def test_holding_torque(arm, payload, reading):
    expected = reference("static_hold_torque", reading, payload)[arm.upper()]
    # A sum of a few products: rounding only.
    np.testing.assert_allclose(holding(arm, payload, reading).torque, expected, rtol=1e-12)


@pytest.mark.parametrize("arm", PLANAR_ARMS)
@pytest.mark.parametrize("reading", READINGS)
def test_largest_payload(arm, reading):
    largest = largest_payload(arm, reading)
    assert largest == pytest.approx(REFERENCE["max_holdable_payload"][reading][arm.upper()], abs=5e-5)  # as printed

    def excess(payload):
        one = holding(arm, payload, reading)
        return max(abs(t) - limit for t, limit in zip(one.torque, one.limit, strict=True))

    assert largest == pytest.approx(brentq(excess, 0, 5), abs=1e-9)
    assert holding(arm, 0.999 * largest, reading).possible and not holding(arm, 1.001 * largest, reading).possible


def test_up_to_one_kilogram_holds_for_one_link_only():
    held = {(h.arm, h.reading) for h in all_holdings() if h.payload == 1.0 and h.possible}
    assert held == {("r", "tip"), ("r", "mM")}
