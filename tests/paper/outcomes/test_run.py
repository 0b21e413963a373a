"""Every way in which the paper's examples are run, against independent numbers."""

from dataclasses import replace

import numpy as np
import pytest

from armdyn.models import PLANAR_ARMS
from armdyn.optimal import solve_minimum_time
from armdyn.paper import example
from armdyn.paper.outcomes import run
from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.run import run_case
from paper import computed
from paper.references import EVERY, REFERENCE, grams, reference


@pytest.mark.parametrize(("payload", "reading"), EVERY)
def test_one_link_is_exact_and_the_indirect_method_agrees(payload, reading):
    outcome = computed.outcome(Case(1, "r", "minimum_time", payload, reading))
    assert outcome.success and outcome.facts["certified"]
    assert outcome.time == pytest.approx(reference("minimum_time_r", reading, payload), abs=1e-8)
    # Newton's method on the switching times stops at 1e-10.
    assert outcome.facts["indirect_time_s"] == pytest.approx(outcome.time, abs=1e-8)
    assert len(outcome.facts["switch_times_j1"]) == 1


@pytest.mark.parametrize(("payload", "reading"), EVERY)
def test_time_energy_of_one_link(payload, reading):
    outcome = computed.outcome(Case(1, "r", "time_energy", payload, reading))
    _check_time_energy(outcome, reference_time("r", reading, payload))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("payload", "reading"), [(0.0212, "tip"), (0.1006, "tip"), (0.5, "tip"), (0.1006, "mM"), (0.5, "mM")]
)
def test_time_energy_of_two_links(payload, reading):
    outcome = computed.outcome(Case(2, "rr", "time_energy", payload, reading))
    _check_time_energy(outcome, reference_time("rr", reading, payload))


@pytest.mark.slow
def test_two_links_with_1_kg_cost_less_than_the_references():
    """The reference is another local optimum: J = 1.2197794 in 0.408996 s."""
    outcome = computed.outcome(Case(2, "rr", "time_energy", 1.0, "mM"))
    assert outcome.facts["certified"]
    assert outcome.facts["objective"] < 0.97 * 1.2197794
    # J is flat in the time there: a mesh's linear torques, right to 1e-9 of J, hold it to 3e-7 s.
    assert outcome.facts["indirect_time_s"] == pytest.approx(outcome.time, abs=1e-6)


def test_a_neighbour_is_where_the_search_begins(monkeypatch):
    requests = []

    def solve(problem, options, progress):
        requests.append(options)
        return solve_minimum_time(problem, options, progress)

    monkeypatch.setattr(run, "solve_minimum_time", solve)
    near = run_case(Case(1, "r", "time_energy", 0.1006))
    outcome = run_case(Case(1, "r", "time_energy", 0.1219), near=near)
    _check_time_energy(outcome, reference_time("r", "tip", 0.1219))
    run_case(Case(1, "r", "time_energy", 0.1219), near=replace(near, facts=near.facts | {"certified": False}))
    run_case(Case(1, "r", "time_energy", 0.1219), near=replace(near, success=False, time=None))
    assert [(len(options.guesses), options.starts) for options in requests] == [(0, None), (1, 1), (1, None), (0, None)]


def _check_time_energy(outcome, expected):
    assert outcome.success, outcome.message
    assert outcome.time == pytest.approx(expected, abs=1e-4)
    assert outcome.facts["indirect_time_s"] == pytest.approx(expected, abs=1e-4)
    assert outcome.facts["indirect_time_s"] == pytest.approx(outcome.time, abs=1e-5)
    assert outcome.facts["indirect_hamiltonian_spread"] < 1e-6
    for part in ("q", "v", "tau", "costate_q", "costate_v"):  # against the peak of each
        assert outcome.facts[f"indirect_{part}_difference"] < 0.01, part
    # The value for "no torque limit" must limit nothing.
    assert np.max(np.abs(outcome.trajectory.tau)) < 0.5 * outcome.case.problem().limits.effort_upper[0]


def reference_time(arm, reading, payload):
    return REFERENCE["time_energy"][arm][reading][grams(payload)]


@pytest.mark.parametrize(("payload", "reading"), EVERY)
@pytest.mark.parametrize(
    ("case", "name"), [(Case(4, "r", "pid", 0), "R_Ex4"), (Case(5, "rr", "pid", 0), "RR_Ex5")], ids=["r", "rr"]
)
def test_arrivals(case, name, payload, reading):
    outcome = computed.outcome(Case(case.example, case.arm, "pid", payload, reading))
    expected = reference("pid_arrival", reading, payload)[name]
    if expected is None:
        assert outcome.time is None and outcome.facts["max_real_eigenvalue"] > 0
    else:
        assert outcome.time == pytest.approx(expected, abs=2e-3)  # the reference was sampled at about that


@pytest.mark.slow
@pytest.mark.parametrize("payload", [0.0212, 0.1006, 0.5, 1.0])
def test_three_links_settle_by_the_printed_equations_alone(payload):
    lagrangian = computed.outcome(Case(6, "rrr", "pid", payload, "mM"))
    printed = computed.outcome(Case(6, "rrr", "pid", payload, "mM", "printed"))
    assert lagrangian.time is None and lagrangian.facts["max_real_eigenvalue"] > 0
    expected = reference("pid_arrival", "mM", payload)["RRR_Ex6_eq7_literal"]
    if expected is None or expected > 10:
        assert printed.time is None
    else:
        assert printed.time == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize(("payload", "reading"), EVERY)
def test_eigenvalues_at_the_goal(payload, reading):
    cases = {
        "R": Case(4, "r", "pid", payload, reading),
        "RR Ex5 target": Case(5, "rr", "pid", payload, reading),
        "RR Ex2 target": Case(5, "rr", "pid", payload, reading, states="example 2"),
        "RRR target": Case(6, "rrr", "pid", payload, reading),
        "RRR eq7 literal": Case(6, "rrr", "pid", payload, "mM", "printed"),
    }
    expected = reference("pid_max_real_eigenvalue", reading, payload)
    for name, value in zip(REFERENCE["pid_max_real_eigenvalue"]["columns"], expected, strict=True):
        case = cases[name]
        assert case.loop().growth() == pytest.approx(value, abs=1e-6), name


@pytest.mark.slow
@pytest.mark.parametrize("arm", PLANAR_ARMS)
def test_the_printed_sign_of_the_derivative_is_unstable(arm):
    outcome = computed.outcome(Case(example(arm, "pid").number, arm, "pid", 0.1006, "mM", derivative_sign="printed"))
    assert outcome.time is None and outcome.status == "diverged" and outcome.facts["max_real_eigenvalue"] > 5


def test_other_arrival_rules_are_read_from_the_same_motion():
    times = {
        rule: computed.outcome(Case(5, "rr", "pid", 0.1006, arrival_rule=rule)).time
        for rule in ("first_crossing", "last_entry_first_joint", "last_entry_all_joints")
    }
    assert times["first_crossing"] < times["last_entry_first_joint"] < times["last_entry_all_joints"]
