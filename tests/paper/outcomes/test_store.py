import json
import os
from dataclasses import replace

import numpy as np
import pytest

from armdyn.models.values.spec import ArmSpec, LinkSpec
from armdyn.paper.outcomes import store
from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.store import fingerprint, load_outcome, save_outcome
from armdyn.trajectory import Trajectory
from paper import computed

CASE = Case(4, "r", "pid", 0.1006)


@pytest.fixture(scope="module")
def outcome():
    return computed.outcome(CASE)


def test_saved_ones_are_loaded(tmp_path, outcome):
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
    monkeypatch.setattr("armdyn.paper.outcomes.store.version", lambda package: "0.0.0")
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

    monkeypatch.setattr("armdyn.paper.outcomes.store.write_whole", full)
    with pytest.raises(OSError, match="disk full"):
        save_outcome(tmp_path, outcome)
    assert load_outcome(tmp_path, CASE) is None  # the old summary does not stand for the new motion


def test_an_outcome_without_a_motion(tmp_path):
    from armdyn.paper.outcomes.outcome import Outcome

    nothing = Outcome(CASE, None, None, False, "failed", "nothing")
    save_outcome(tmp_path, nothing)
    assert load_outcome(tmp_path, CASE) == nothing or load_outcome(tmp_path, CASE).trajectory is None


def edited(path, change, seal=False):
    """Change a case file, its fingerprint kept; on request with a digest that fits."""
    content = json.loads(path.read_text())
    change(content)
    if seal:
        del content["digest"]
        motion = Trajectory.load(path.with_suffix(".npz")) if content.get("trajectory") is True else None
        content["digest"] = store._digest(content, motion)
    path.write_text(json.dumps(content))


WRONG = {
    "time": ["x", True, [1.0], -1.0, None],
    "success": [1, "yes", None, False],
    "status": [None, 3, "interrupted"],
    "message": [None, 3, ["x"]],
    "facts": [None, [], "x", {}],
    "summary": [None, [], "x"],
    "trajectory": [False, 1, "yes", None],
    "fingerprint": ["", None, 3],
}


@pytest.mark.parametrize("seal", [False, True])
@pytest.mark.parametrize(("name", "value"), [(name, value) for name, values in WRONG.items() for value in values])
def test_edited_fields_are_damage(tmp_path, outcome, name, value, seal):
    edited(save_outcome(tmp_path, outcome), lambda content: content.update({name: value}), seal)
    assert load_outcome(tmp_path, CASE) is None


@pytest.mark.parametrize("seal", [False, True])
@pytest.mark.parametrize(
    "change",
    [
        lambda content: content.pop("summary"),
        lambda content: content.update(more=1),
        lambda content: content["facts"].pop("settled"),
        lambda content: content["facts"].update(more=1.0),
        lambda content: content["facts"].update(certified=True),
        lambda content: content["facts"].update(settled="yes"),
        lambda content: content["facts"].update(max_real_eigenvalue=None),
        lambda content: content["facts"].update(overshoot=[0.0, 0.0]),
        lambda content: content["facts"].update(overshoot=[True]),
        lambda content: content["facts"].update(arrival_rule="first_crossing"),
    ],
)
def test_edited_facts_are_damage(tmp_path, outcome, change, seal):
    edited(save_outcome(tmp_path, outcome), change, seal)
    assert load_outcome(tmp_path, CASE) is None


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e400", "9" * 400])
def test_numbers_that_are_none_are_damage(tmp_path, outcome, number):
    path = save_outcome(tmp_path, outcome)
    path.write_text(path.read_text().replace(f'"time": {outcome.time!r}', f'"time": {number}'))
    assert number in path.read_text() and load_outcome(tmp_path, CASE) is None


def test_a_number_that_could_be_right_is_damage_too(tmp_path, outcome):
    edited(save_outcome(tmp_path, outcome), lambda content: content.update(time=outcome.time + 1e-3))
    assert load_outcome(tmp_path, CASE) is None


@pytest.mark.parametrize("seal", [False, True])
def test_a_motion_of_another_arm_or_run_is_damage(tmp_path, outcome, seal):
    path = save_outcome(tmp_path, outcome)
    other = replace(outcome.trajectory, model_hash="" if seal else CASE.robot().model_hash, v=2 * outcome.trajectory.v)
    other.save(path.with_suffix(".npz"))
    edited(path, lambda content: None, seal)
    assert load_outcome(tmp_path, CASE) is None


def test_a_sealed_and_valid_outcome_is_read(tmp_path, outcome):
    edited(save_outcome(tmp_path, outcome), lambda content: content.update(message="other words"), seal=True)
    assert load_outcome(tmp_path, CASE).message == "other words"


@pytest.mark.parametrize("suffix", [".json", ".npz"])
def test_a_pipe_in_a_files_place_is_not_waited_for(tmp_path, outcome, suffix):
    path = save_outcome(tmp_path, outcome).with_suffix(suffix)
    path.unlink()
    os.mkfifo(path)
    assert load_outcome(tmp_path, CASE) is None


@pytest.mark.parametrize(
    "case",
    [
        Case(1, "r", "minimum_time", 0.1006),
        Case(1, "r", "time_energy", 0.1006),
        Case(6, "rrr", "pid", 0.1006, "mM", "printed"),
        Case(5, "rr", "pid", 0.1006, derivative_sign="printed"),
    ],
)
def test_every_kind_of_outcome_is_loaded(tmp_path, case):
    """The facts that `run_case` gives are those that are known."""
    made = computed.outcome(case)
    save_outcome(tmp_path, made)
    found = load_outcome(tmp_path, case)
    assert found is not None and found.facts == made.facts and found.time == made.time
