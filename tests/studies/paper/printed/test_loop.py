"""Section 4's loop as data."""

import armdyn as ad
from armdyn.control.pid.gains import ContinuousPid
from armdyn.studies.paper.printed.loop import ERROR_RATES, PAPER_GAINS


def test_the_papers_gains_are_equations_32_to_34():
    assert ad.PAPER_GAINS is PAPER_GAINS
    assert (PAPER_GAINS.kp, PAPER_GAINS.ki, PAPER_GAINS.kd) == (30.0, 50.0, 10.0)


def test_the_printed_sign_is_the_other_one():
    brake, push = (ContinuousPid(PAPER_GAINS, error_rate=ERROR_RATES[sign]) for sign in ("corrected", "printed"))
    assert brake == ContinuousPid(PAPER_GAINS)
    assert brake.coefficients(1)[2] == 10 and push.coefficients(1)[2] == -10
