"""Section 4's loop as data."""

from armdyn import paper
from armdyn.paper.continuous_pid import ContinuousLoop
from armdyn.paper.printed.loop import ERROR_RATES, GAINS
from problems import paper_arm


def test_the_papers_gains_are_equations_32_to_34():
    assert paper.GAINS is GAINS
    assert (GAINS.kp, GAINS.ki, GAINS.kd) == (30.0, 50.0, 10.0)


def test_the_printed_sign_is_the_other_one():
    robot = paper_arm("r")
    brake, push = (ContinuousLoop(robot, [0.0], error_rate=ERROR_RATES[sign]) for sign in ("corrected", "printed"))
    assert brake.coefficients[2] == 10 and push.coefficients[2] == -10
