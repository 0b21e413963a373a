"""The whole study: what is solved, what is kept, what is written."""

import json
import multiprocessing

import pytest

from armdyn.errors import ProblemError
from armdyn.models import PAPER_PAYLOADS
from armdyn.studies.paper import EXAMPLES, PAYLOAD
from armdyn.studies.paper.outcomes.case import Case
from armdyn.studies.paper.reproduce import EXAMPLES_OF_PART, Plan, cases_of, reproduce

FOLDER = {"trajectory.npz", "figure.png", "figure.pdf", "replay.html", "result.json"}


def names(folder):
    return {path.name for path in folder.iterdir()}


def test_everything_is_every_example_with_every_payload():
    cases = Plan().cases()
    assert len(cases) == len(set(cases))
    for one in EXAMPLES:
        assert {case.payload for case in cases if case.example == one.number} == set(PAPER_PAYLOADS)
    kinds = {(case.arm, case.kind, case.reading) for case in cases}
    assert {("r", "minimum_time", "mM"), ("rr", "time_energy", "mM"), ("rrr", "minimum_time", "tip")} <= kinds
    assert any(case.variant == "printed" for case in cases)
    assert any(case.states == "example 2" for case in cases)
    # The longest come first, so that no core waits for one at the end.
    assert cases[0].arm == "rrr" and cases[0].kind != "pid" and cases[-1].kind == "pid"


@pytest.mark.parametrize("part", EXAMPLES_OF_PART)
def test_a_part_takes_its_examples_only(part):
    cases = Plan(only=(part,)).cases()
    assert {case.example for case in cases} == set(EXAMPLES_OF_PART[part])
    payloads = {case.payload for case in cases}
    if part == "table3":
        assert not cases
    elif part.startswith("figure") or part == "table7":
        assert payloads == {PAYLOAD}  # the paper has them for this one alone
    else:
        assert payloads == set(PAPER_PAYLOADS)


def test_payloads_and_rules_are_taken():
    plan = Plan(only=("example4",), payloads=(0.2, 0.3), arrival_rule="first_crossing")
    assert {case.payload for case in plan.cases()} == {0.2, 0.3} and plan.shown_payload == 0.2
    assert all(case.arrival_rule == "first_crossing" for case in plan.cases())
    assert Plan(payloads=(0.2, PAYLOAD)).shown_payload == PAYLOAD == Plan().shown_payload


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"only": ("table9",)}, "no 'table9'"),
        ({"payloads": (-0.1,)}, "-0.1 kg"),
        ({"payloads": (float("nan"),)}, "nan kg"),
    ],
)
def test_plans_that_cannot_be_are_refused(given, message):
    with pytest.raises(ProblemError, match=message):
        Plan(**given)


@pytest.fixture(scope="module")
def loops(tmp_path_factory):
    """Example 4 with 100.6 g and 200 g."""
    folder, told = tmp_path_factory.mktemp("paper"), []
    plan = Plan(only=("example4", "table3"), payloads=(PAYLOAD, 0.2))
    result = reproduce(folder, plan, lambda outcome, done, of: told.append((outcome.case, done, of)))
    return folder, plan, result, told


def test_files(loops):
    folder, plan, result, _ = loops
    assert all(file.stat().st_size > 0 for file in result.files)
    assert {"index.html", "cases", "tables", "figures", "example4_r_pid"} <= names(folder)
    assert names(folder / "example4_r_pid") == FOLDER
    assert json.loads((folder / "example4_r_pid" / "result.json").read_text())["arrival_time"] == pytest.approx(
        4.1735, abs=2e-3
    )
    assert len(names(folder / "cases")) == 2 * len(plan.cases())
    assert {row.table for row in result.rows} == {3}  # the table that was named
    assert names(folder / "tables") == {"table3.csv", "table3.md", "table3.tex"}


def test_progress_counts_every_case_once(loops):
    _, plan, result, told = loops
    assert {case for case, *_ in told} == set(plan.cases()) == {outcome.case for outcome in result.outcomes}
    assert [done for _, done, _ in told] == list(range(1, len(told) + 1)) and told[-1][1] == told[-1][2]


@pytest.mark.slow
def test_what_is_done_is_not_done_again(loops):
    folder, plan, *_ = loops
    cases = sorted((folder / "cases").iterdir())
    before = {path: path.stat().st_mtime_ns for path in cases}
    reproduce(folder, plan)
    assert {path: path.stat().st_mtime_ns for path in cases} == before
    lost = folder / "cases" / f"{Case(4, 'r', 'pid', 0.2).name}.json"
    lost.unlink()
    reproduce(folder, plan)
    assert {path for path in cases if path.stat().st_mtime_ns != before[path]} == {lost, lost.with_suffix(".npz")}
    reproduce(folder, Plan(only=plan.only, payloads=(0.2,), fresh=True))
    again = {path.name for path in cases if path.stat().st_mtime_ns != before[path]}
    assert again == {f"{case.name}{s}" for case in cases_of(4, 0.2) for s in (".json", ".npz")}


@pytest.mark.slow
def test_an_interrupt_leaves_what_is_done(tmp_path):
    plan = Plan(only=("example4", "example3"), payloads=(PAYLOAD, 0.2), workers=2)

    def stop(outcome, done, of):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reproduce(tmp_path, plan, stop)
    kept = {path.stem for path in (tmp_path / "cases").glob("*.json")}
    assert 1 <= len(kept) < len(plan.cases())
    assert not [path for path in tmp_path.rglob("*") if path.name.startswith(".")]  # nothing half written
    assert not multiprocessing.active_children()
