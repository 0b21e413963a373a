import json

import pytest

from armdyn.studies.paper import EXAMPLES, reproduce


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("paper")
    return folder, {one.number: summary for one, summary in reproduce(folder)}


def test_all_six_examples_are_there(results):
    folder, found = results
    assert sorted(found) == [1, 2, 3, 4, 5, 6]
    for one in EXAMPLES:
        names = {path.name for path in (folder / one.name).iterdir()}
        assert names == {"trajectory.npz", "figure.png", "figure.pdf", "replay.html", "result.json"}
        assert json.loads((folder / one.name / "result.json").read_text())["message"]


def test_minimum_times_are_no_faster_than_the_best_known_and_land(results):
    # Exact (R) and best known (RR, RRR) at 100.6 g [s]; that of RRR leaves the ±π that the arm allows.
    for number, best in ((1, 0.17949750), (2, 0.21067170), (3, 0.21930341)):
        summary = results[1][number]
        assert summary["success"], summary["message"]
        assert best * (1 - 1e-5) < summary["duration"] < 1.12 * best
        assert summary["certified"], summary["message"]
        assert summary["replay_error"] < 1e-3


def test_pid_loops_settle_for_two_and_not_for_three_links(results):
    assert results[1][4]["success"] and results[1][5]["success"]
    # The linearised loop of RRR has an eigenvalue at +1.3031 1/s with 100.6 g at the tip.
    assert not results[1][6]["success"]
    assert results[1][6]["max_real_eigenvalue"] == pytest.approx(1.3031143779437038, abs=1e-6)
