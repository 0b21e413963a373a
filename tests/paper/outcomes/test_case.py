"""Cases: names, starts, refused ones."""

import pytest

from armdyn.errors import ProblemError
from armdyn.paper.outcomes.case import Case
from armdyn.paper.printed.examples import EXAMPLES
from armdyn.paper.printed.loop import GAINS
from paper.references import EVERY, READINGS


def test_names_tell_all_cases_apart():
    cases = [Case(5, "rr", "pid", m, r) for m, r in EVERY]
    cases += [Case(5, "rr", "pid", m, r, states="example 2") for m, r in EVERY]
    cases += [Case(5, "rr", "pid", m, r, derivative_sign="printed") for m, r in EVERY]
    cases += [Case(5, "rr", "pid", m, r, arrival_rule="first_crossing") for m, r in EVERY]
    cases += [Case(6, "rrr", "pid", m, "mM", "printed") for m, r in EVERY if r == "mM"]
    assert len({case.name for case in cases}) == len(cases)


def test_example_5_is_printed_with_other_states_than_example_2():
    assert Case(5, "rr", "pid", 0.1).q_start == EXAMPLES[4].q_start != EXAMPLES[1].q_start
    assert Case(5, "rr", "pid", 0.1, states="example 2").q_start == EXAMPLES[1].q_start


def test_readings_differ_in_inertia_but_not_in_mass():
    tip, com = (Case(1, "r", "minimum_time", 0.5, reading).robot().model for reading in READINGS)
    assert sum(i.mass for i in tip.inertias) == pytest.approx(sum(i.mass for i in com.inertias))
    assert tip.inertias[1].inertia[1, 1] != com.inertias[1].inertia[1, 1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((7, "r", "pid", 0.1), "Examples 1 to 6"),
        ((1, "rr", "minimum_time", 0.1), "Example 1 is r"),
        ((4, "r", "time_energy", 0.1), "Example 4 is r pid"),
        ((5, "rr", "pid", 0.1, "mM", "printed"), "RRR's PID loop"),
        ((6, "rrr", "pid", 0.1, "tip", "printed"), "with m"),
        ((4, "r", "pid", 0.1, "tip", "lagrangian", "example 2"), "only Example 5"),
        ((1, "r", "minimum_time", 0.1, "tip", "lagrangian", "printed", "printed"), "for PID loops"),
        ((4, "r", "pid", 0.1, "tip", "lagrangian", "printed", "plus"), "derivative_sign is 'plus'"),
    ],
)
def test_cases_that_are_none_are_refused(arguments, message):
    with pytest.raises(ProblemError, match=message):
        Case(*arguments)


def test_a_loop_is_no_optimal_control_problem():
    with pytest.raises(ProblemError, match="PID loop"):
        Case(4, "r", "pid", 0.1).problem()


def test_the_printed_sign_is_a_number_of_the_controller():
    corrected, printed = (Case(4, "r", "pid", 0.1, derivative_sign=sign) for sign in ("corrected", "printed"))
    assert corrected.loop().gains == GAINS and corrected.loop().error_rate == -1.0
    assert printed.loop().error_rate == 1.0
