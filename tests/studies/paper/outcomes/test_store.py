import json

import numpy as np
import pytest

import armdyn
from armdyn.models.spec import ArmSpec, LinkSpec
from armdyn.studies.paper.outcomes.case import Case
from armdyn.studies.paper.outcomes.run import run_case
from armdyn.studies.paper.outcomes.store import fingerprint, load_outcome, save_outcome

CASE = Case(4, "r", "pid", 0.1006)


@pytest.fixture(scope="module")
def outcome():
    return run_case(CASE)


def test_what_is_saved_is_loaded(tmp_path, outcome):
    save_outcome(tmp_path / "cases", outcome)
    found = load_outcome(tmp_path / "cases", CASE)
    for name in ("case", "time", "success", "status", "message", "facts", "summary"):
        assert getattr(found, name) == getattr(outcome, name)
    for name in ("t", "q", "v", "tau"):
        np.testing.assert_array_equal(getattr(found.trajectory, name), getattr(outcome.trajectory, name))


def test_nothing_there_is_none(tmp_path):
    assert load_outcome(tmp_path / "nowhere", CASE) is None


@pytest.mark.parametrize("damage", ["json", "npz", "no npz", "other fields", "a list"])
def test_damaged_files_are_none(tmp_path, outcome, damage):
    path = save_outcome(tmp_path, outcome)
    if damage == "json":
        path.write_bytes(path.read_bytes()[:100])
    elif damage == "npz":
        path.with_suffix(".npz").write_bytes(b"PK")
    elif damage == "no npz":
        path.with_suffix(".npz").unlink()
    elif damage == "other fields":
        content = json.loads(path.read_text())
        del content["time"]
        path.write_text(json.dumps(content))
    else:
        path.write_text("[]")
    assert load_outcome(tmp_path, CASE) is None


def test_other_inputs_are_none(tmp_path, outcome, monkeypatch):
    save_outcome(tmp_path, outcome)
    before = fingerprint(CASE)
    monkeypatch.setattr(armdyn, "__version__", "0.0.0")
    assert fingerprint(CASE) != before and load_outcome(tmp_path, CASE) is None
    monkeypatch.undo()
    assert load_outcome(tmp_path, CASE) is not None
    heavier = ArmSpec(name="r", links=(LinkSpec(length=0.25, com=0.198, mass=0.2, inertia=1.15e-3),))
    monkeypatch.setattr(ArmSpec, "paper", lambda arm: heavier)
    assert fingerprint(CASE) != before and load_outcome(tmp_path, CASE) is None


def test_files_are_whole_or_not_there(tmp_path, outcome, monkeypatch):
    save_outcome(tmp_path, outcome)

    def full(*_):
        raise OSError("disk full")

    monkeypatch.setattr("armdyn.studies.paper.outcomes.store.write_whole", full)
    with pytest.raises(OSError, match="disk full"):
        save_outcome(tmp_path, outcome)
    assert load_outcome(tmp_path, CASE) is None  # the old summary does not stand for the new motion


def test_an_outcome_without_a_motion(tmp_path):
    from armdyn.studies.paper.outcomes.outcome import Outcome

    nothing = Outcome(CASE, None, None, False, "failed", "nothing")
    save_outcome(tmp_path, nothing)
    assert load_outcome(tmp_path, CASE) == nothing or load_outcome(tmp_path, CASE).trajectory is None
