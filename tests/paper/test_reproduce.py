"""The whole study: solved cases, stored outcomes, files."""

import json
import multiprocessing

import pytest

from armdyn.paper import PAYLOAD
from armdyn.paper.outcomes.case import Case
from armdyn.paper.plan import Plan, cases_of
from armdyn.paper.reproduce import reproduce
from undrawn import unrendered

pytestmark = pytest.mark.slow

FOLDER = {"trajectory.npz", "figure.png", "figure.pdf", "report.html", "result.json"}


def names(folder):
    return {path.name for path in folder.iterdir()}


@pytest.fixture(scope="module")
def loops(tmp_path_factory):
    """Example 4 with 100.6 g and 200 g."""
    folder, messages = tmp_path_factory.mktemp("paper"), []
    plan = Plan(only=("example4", "table3"), payloads=(PAYLOAD, 0.2))
    shown = []

    def look(outcomes):
        shown.append(({outcome.case for outcome in outcomes}, (folder / "index.html").exists(), len(messages)))

    with unrendered():
        result = reproduce(folder, plan, lambda outcome, done, of: messages.append((outcome.case, done, of)), look)
    return folder, plan, result, messages, shown


def test_files(loops):
    folder, plan, result, *_ = loops
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
    _, plan, result, messages, _ = loops
    assert {case for case, *_ in messages} == set(plan.cases()) == {outcome.case for outcome in result.outcomes}
    assert [done for _, done, _ in messages] == list(range(1, len(messages) + 1)) and messages[-1][1] == messages[-1][2]


def test_shown_cases_are_reported_once_with_their_figures(loops):
    folder, plan, _, messages, ((cases, page, count),) = loops
    assert cases == {case for case in plan.cases() if case.payload == PAYLOAD}
    assert page or count == len(messages)  # a page that will be rewritten at once is not reported
    assert names(folder / "figures") == {"figure3.pdf", "figure3.png"}
    assert (folder / "index.html").read_text("utf-8").count("<figure>") == 1


@pytest.mark.usefixtures("unrendered")
def test_finished_cases_are_not_done_again(loops):
    folder, plan, *_ = loops
    cases = sorted((folder / "cases").iterdir())
    before = {path: path.stat().st_mtime_ns for path in cases}
    lost = folder / "cases" / f"{Case(4, 'r', 'pid', 0.2).name}.json"
    lost.unlink()
    reproduce(folder, plan)
    assert {path for path in cases if path.stat().st_mtime_ns != before[path]} == {lost, lost.with_suffix(".npz")}
    reproduce(folder, Plan(only=plan.only, payloads=(0.2,), fresh=True))
    again = {path.name for path in cases if path.stat().st_mtime_ns != before[path]}
    assert again == {f"{case.name}{s}" for case in cases_of(4, 0.2) for s in (".json", ".npz")}


def test_an_interrupt_keeps_finished_cases(tmp_path):
    plan = Plan(only=("example4", "example1"), payloads=(PAYLOAD, 0.2), workers=2)

    def stop(outcome, done, of):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reproduce(tmp_path, plan, stop)
    kept = {path.stem for path in (tmp_path / "cases").glob("*.json")}
    assert 1 <= len(kept) < len(plan.cases())
    assert not [path for path in tmp_path.rglob("*") if path.name.startswith(".")]  # nothing half written
    for worker in multiprocessing.active_children():  # killed without waiting for their end
        worker.join(5)
    assert not multiprocessing.active_children()
