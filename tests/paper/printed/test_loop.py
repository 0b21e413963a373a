"""Section 4's loop as data."""

from armdyn import paper
from armdyn.control.pid.gains import ContinuousPid
from armdyn.paper.printed.loop import ERROR_RATES, GAINS


def test_the_papers_gains_are_equations_32_to_34():
    assert paper.GAINS is GAINS
    assert (GAINS.kp, GAINS.ki, GAINS.kd) == (30.0, 50.0, 10.0)


def test_the_printed_sign_is_the_other_one():
    brake, push = (ContinuousPid(GAINS, error_rate=ERROR_RATES[sign]) for sign in ("corrected", "printed"))
    assert brake == ContinuousPid(GAINS)
    assert brake.coefficients(1)[2] == 10 and push.coefficients(1)[2] == -10
