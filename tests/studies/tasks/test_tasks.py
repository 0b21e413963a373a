"""A case's work equals the same call by itself."""

import json
from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.studies.problems import ArmProblems, StudyArm
from armdyn.studies.tasks.minimum_time import MinimumTimeTask
from armdyn.studies.tasks.task import CaseResult, motion_bytes, motion_from, result_of
from armdyn.studies.tasks.tracking import TrackTask
from problems import paper_problem

START, GOAL = [-np.pi / 2], [np.pi / 20]


def arm(name="r", q_start=START, q_goal=GOAL):
    return StudyArm(name="arm", robot={"name": name}, problem={"q_start": list(q_start), "q_goal": list(q_goal)})


R = arm()


def paper_arm(payload=0.0):
    return ad.Robot.from_spec(ad.ArmSpec.paper("r"), ad.Payload(mass=payload) if payload else None)


def test_the_fastest_motion():
    problem = paper_problem("r", 0.1)
    recipe = arm("r", problem.q_start.tolist(), problem.q_goal.tolist())
    alone = ad.solve_minimum_time(problem)
    for guess in (b"", motion_bytes(alone.trajectory)):
        for neighbours in ("add", "lead"):
            outcome = MinimumTimeTask(problems=ArmProblems(arms=(recipe,)), neighbours=neighbours).work(
                {"payload": 0.1}, guess
            )
            assert outcome.status == "usable" and outcome.good and outcome.facts["certified"]
            # Both are certified, to 1e-9 relative.
            assert outcome.facts["duration_s"] == pytest.approx(alone.duration, rel=1e-8)
    kept = motion_from(outcome.motion, problem.robot)
    assert kept.duration == outcome.facts["duration_s"]
    # One joint, always on its limit of torque: ∫ τ² dt is that squared, times the duration.
    full = float(problem.limits.effort_upper[0]) ** 2 * alone.duration
    assert outcome.facts["torque_squared"] == pytest.approx(full, rel=1e-9)
    assert (
        not MinimumTimeTask(problems=ArmProblems(arms=(recipe,)), neighbours="off").work({"payload": 0.1}, b"").motion
    )


def test_a_motion_is_packed_whole_and_a_damaged_one_is_refused():
    motion = ad.ramp(paper_arm(), START, GOAL, 0.5)
    data = motion_bytes(motion)
    back = motion_from(data, paper_arm())
    for name in ("t", "q", "v", "tau"):
        assert np.array_equal(getattr(back, name), getattr(motion, name))
    for bad in (b"", b"nonsense", data[: len(data) // 2], motion_bytes(motion)[:-3]):
        with pytest.raises(ad.ArmdynError):
            motion_from(bad, ad.Robot.from_spec(ad.ArmSpec.paper("rr")))


def test_a_controllers_run():
    task = TrackTask(
        problems=ArmProblems(arms=(R,), fixed={"payload": 0.1, "ramp": 0.5}), controller="pid", reference="ramp"
    )
    gains = {"kp": 30.0, "ki": 20.0, "kd": 1.0}
    outcome = task.work({**gains, "plant_payload": 0.12, "rate": 500.0, "delay": 2.0}, b"")
    robot, plant = paper_arm(0.1), paper_arm(0.12)
    run = ad.track(
        robot, ad.ramp(robot, START, GOAL, 0.5), ad.Pid(ad.PidGains(**gains)), plant,
        ad.Loop(rate=500.0, delay=2),
    )  # fmt: skip
    same = replace(task, form="torque").work({**gains, "plant_payload": 0.12, "rate": 500.0, "delay": 2.0}, b"")
    assert same.facts == outcome.facts
    assert replace(task, form="computed_torque").work(gains, b"").facts["peak_error"] != run.peak_error
    assert outcome.status == run.status and outcome.facts["peak_error"] == run.peak_error
    assert outcome.facts["settled_time_s"] == run.settled_time and outcome.good == run.settled


def test_a_reference_is_solved_once_for_all_gains(monkeypatch):
    from armdyn.studies.tasks import closed_loop as tracking

    solved = []
    solve = tracking.solve_minimum_time
    monkeypatch.setattr(tracking, "solve_minimum_time", lambda *given: solved.append(given) or solve(*given))
    task = TrackTask(problems=ArmProblems(arms=(R,), fixed={"reserve": 0.123}), controller="computed-torque")
    first, second, third = (
        task.work(settings, b"") for settings in ({"bandwidth": 50.0}, {"bandwidth": 90.0}, {"reserve": 0.2})
    )
    assert len(solved) == 2
    assert first.facts["reference_s"] == second.facts["reference_s"] < third.facts["reference_s"]


def test_another_studys_arm_of_the_same_name_has_a_reference_of_its_own():
    """Workers of a cluster outlive a study."""
    outcomes = [
        TrackTask(problems=ArmProblems(arms=(one,), fixed={"payload": 0.05}), controller="computed-torque").work(
            {}, b""
        )
        for one in (R, arm(q_goal=[0.5]), arm("rr", [-1.5, 0.0], [0.2, 0.0]))
    ]
    assert len({outcome.facts["reference_s"] for outcome in outcomes}) == 3


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"kp": 1.0}, "controller 'pid' with reference 'ramp' needs ki, kd, ramp, in [fixed] or [vary]"),
        ({"kp": 1.0, "ki": 1.0, "kd": 1.0}, "needs ramp"),
    ],
)
def test_misfits_are_refused_in_a_row(settings, words):
    outcome, seconds = result_of(
        TrackTask(problems=ArmProblems(arms=(R,)), controller="pid", reference="ramp"), settings, b""
    )
    assert outcome.status == "refused" and words in outcome.message and not outcome.good and seconds >= 0


def test_values_that_json_or_sqlite_cannot_hold_are_converted():
    class Odd:
        def work(self, settings, guess, revisit=False):
            facts = {"a": float("nan"), "b": np.float64(2.0), "c": np.bool_(True), "d": float("inf"), "e": "f"}
            return CaseResult(status="odd", message="half a pair: \ud800", facts=facts)

    outcome, _ = result_of(Odd(), {}, b"")
    assert json.loads(json.dumps(outcome.facts, allow_nan=False)) == {"a": None, "b": 2, "c": True, "d": None, "e": "f"}
    assert outcome.message == "half a pair: ?"


def test_a_warning_is_in_the_row_and_not_on_the_terminal(recwarn):
    # A tenth of the motor's torque holds the arm at the start, hanging, and not at the goal.
    task = MinimumTimeTask(problems=ArmProblems(arms=(R,)), options=ad.MinimumTimeOptions(starts=1, search="quick"))
    outcome, _ = result_of(task, {"payload": 1.0, "effort_limit": 1.5}, b"")
    assert "needs" in outcome.facts["warning"] and "to hold the goal" in outcome.facts["warning"] and not recwarn
    assert "warning" not in result_of(task, {}, b"")[0].facts


def test_a_problem_that_is_none_is_refused_in_a_row():
    outcome, _ = result_of(MinimumTimeTask(problems=ArmProblems(arms=(R,))), {"q_goal.joint1": -np.pi / 2}, b"")
    assert outcome.status == "refused" and "same state" in outcome.message
