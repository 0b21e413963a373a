"""Any planner's motion against the fastest, from its file."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import armdyn as ad
from armdyn.cli.motion.optimality import _possible
from cli.command import answer, run_here

QUICK = ("--search", "quick", "--no-report", "--no-figure", "--json")


@pytest.fixture(scope="module")
def rr():
    return ad.Robot.from_spec(ad.ArmSpec.paper("rr"))


@pytest.fixture(scope="module")
def motion(rr):
    """A quintic ramp, whose positions, velocities and torques are known in closed form."""
    return ad.ramp(rr, [-1.5, 0.1], [0.2, -0.1], 0.6)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def files(motion, here):
    """The same motion as five planners would leave it."""
    t, q, v = motion.t, motion.q, motion.v
    np.savez(here / "toppra.npz", ts_sample=t, qs_sample=q, qds_sample=v)
    np.savetxt(here / "plain.csv", np.column_stack([t, q]), delimiter=",", header="t,q1,q2")
    degrees = np.column_stack([t, np.rad2deg(q[:, ::-1])])
    np.savetxt(here / "degrees.csv", degrees, delimiter=";", header="time;joint2 [deg];joint1 [deg]")
    motion.save(here / "own.npz")
    points = [
        {"positions": row.tolist(), "time_from_start": {"sec": 0, "nanosec": round(1e9 * time)}}
        for time, row in zip(t, q[:, ::-1], strict=True)
    ]
    (here / "moveit.json").write_text(json.dumps({"joint_names": ["joint2", "joint1"], "points": points}))
    return ["toppra.npz", "plain.csv", "degrees.csv", "own.npz", "moveit.json"]


@pytest.mark.slow
def test_every_format_of_a_motion_has_one_answer(motion, here, rr):
    output = [answer(run_here("optimality", "rr", name, *QUICK)) for name in files(motion, here)]
    api = ad.time_optimality(rr, motion, ad.MinimumTimeOptions(search="quick"))
    for facts in output:
        assert facts["success"] and facts["status"] == "compared" and facts["certified"] and facts["feasible"]
        assert facts["duration"] == pytest.approx(0.6, abs=1e-9)  # of times in text 18 digits, of ROS nanoseconds
        # Splines of positions know the end's velocity, zero, to some 1e-6 rad/s of 1000 samples a second.
        assert facts["optimal_duration"] == pytest.approx(api.optimal_duration, rel=1e-5)
        assert facts["ratio"] == pytest.approx(0.6 / facts["optimal_duration"], rel=1e-12)
        assert facts["on_no_limit"]["joint1"] == pytest.approx(float(api.idle[0]), abs=0.01)  # cells of a grid


@pytest.mark.slow
def test_its_output_and_files(motion, here):
    motion.save(here / "own.npz")
    done = run_here("optimality", "rr", "own.npz", "--search", "quick", "--no-report", "--out", "out")
    words = " ".join(done.stdout.split())
    assert done.returncode == 0 and "the motion takes 0.600000 s" in words and "limits kept" in words
    assert "% less time" in words and "on no limit joint1 100 %, joint2 100 % of the time" in words
    assert "at its ends" not in words
    assert re.search(r"the fastest takes 0\.\d+ s, locally optimal \(Pontryagin\) it could be", words)
    few = np.linspace(0, motion.t.size - 1, 11, dtype=int)
    np.savetxt(here / "few.csv", np.column_stack([motion.t, motion.q])[few], delimiter=",", header="t,q1,q2")
    few = run_here("optimality", "rr", "few.csv", *QUICK[:-1], "--out", "few").stdout  # a spline of eleven positions
    assert re.search(r"at its ends both move by up to 0\.1\d* rad/s", " ".join(few.split()))
    assert {path.name for path in (here / "out").iterdir()} >= {"trajectory.npz", "optimum.npz", "figure.png"}
    optimum = ad.Trajectory.load(here / "out" / "optimum.npz")
    assert json.loads((here / "out" / "result.json").read_text())["optimal_duration"] == optimum.duration


def test_a_motion_that_breaks_its_limits_is_not_as_it_should_be(rr, here):
    ad.ramp(rr, [-1.5, 0.1], [0.2, -0.1], 0.15).save(here / "fast.npz")
    facts = answer(run_here("optimality", "rr", "fast.npz", *QUICK), 3)
    assert (facts["success"], facts["status"], facts["feasible"]) == (False, "limits_broken", False)
    assert "torque limit" in facts["worst_violation"] and facts["ratio"] < 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["own.npz", "rr"], "own.npz stands where the robot belongs: armdyn optimality ROBOT FILE"),
        (["moveit.json", "rr"], "moveit.json stands where the robot belongs"),
        (["rr", "moveit.json"], "joint_names are a, b; joint 'joint1' is not among them"),
        (["rrr", "own.npz"], "the trajectory has 2 joints; rrr has 3"),
        (["rr", "nowhere.csv"], "nowhere.csv: no such file"),
        (["rr", "bad.csv"], "bad.csv: there is no t"),
        (["rr", "other.csv"], "other.csv: there is no q of joint1, joint2"),
        (["rr", "short.csv"], "short.csv: t must be at least three increasing times"),
        (
            ["ur5", "radians.csv"],
            "radians.csv: shoulder_pan_joint is at 90 rad, and its limits are [-6.283, 6.283] rad: ",
        ),
        (
            ["ur5", "radians.csv"],
            "these are degrees; positions are radians, in a table also degrees in columns named 'q1",
        ),
        (["rr", "own.npz", "--reserve", "2"], "reserve of joint 'joint1' is 2"),
    ],
)
def test_a_wrong_motion_is_refused(motion, here, arguments, words):
    motion.save(here / "own.npz")
    (here / "bad.csv").write_text("x,y\n1,2\n")
    (here / "other.csv").write_text("t,q_arm1,q_arm2\n0,0,0\n1,1,1\n")
    (here / "short.csv").write_text("t,q1,q2\n0,0,0\n1,1,1\n")
    turns = [[t, 90 * t, *[-40 * t] * 5] for t in (0, 0.5, 1)]
    np.savetxt(here / "radians.csv", turns, delimiter=",", header="t,q1,q2,q3,q4,q5,q6", comments="")
    (here / "moveit.json").write_text(json.dumps({"joint_names": ["a", "b"], "points": [{}, {}]}))
    assert words in answer(run_here("optimality", *arguments, *QUICK), 2)["message"]


@pytest.mark.parametrize("column", [1, 2])
@pytest.mark.parametrize("value", ["1e308", "-1e308", "1e13"])
def test_numbers_that_are_too_large(motion, here, column, value):
    rows = [[str(x) for x in (t, *q)] for t, q in zip(motion.t, motion.q, strict=True)]
    rows[5][column] = value
    (here / "large.csv").write_text("\n".join(",".join(row) for row in [["t", "q1", "q2"], *rows]))
    output = answer(run_here("optimality", "rr", "large.csv", *QUICK), 2)
    assert output["message"] == f"large.csv: q is {float(value):g} in sample 5; the most is 1e+12"


def test_an_own_file_with_such_a_number(motion, here):
    fields = dict(np.load(motion.save(here / "own.npz")))
    fields["t"][-1] = 1e308
    np.savez(here / "large.npz", **fields)
    assert "the most is 1e+12" in answer(run_here("optimality", "rr", "large.npz", *QUICK), 2)["message"]


@pytest.mark.slow
def test_a_planner_is_measured_by_the_accelerations_that_it_had_to_keep(motion, here):
    motion.save(here / "own.npz")
    free, bound = (
        answer(run_here("optimality", "rr", "own.npz", *QUICK, *limit))["optimal_duration"]
        for limit in ((), ("--acceleration-limit", "30"))
    )
    assert 2 * np.sqrt(1.7 / 30) < bound < motion.duration and free < 0.7 * bound


@pytest.mark.parametrize(
    ("taken", "words"),
    [
        (0.2 - 7e-15, "no faster: it takes as long as the fastest that was found"),
        (0.2 + 7e-15, "no faster: it takes as long as the fastest that was found"),
        (0.25, "50 ms faster: 20 % less time"),
        (2000.0, "2000 s faster: more than 99.9 % less time"),
        (0.199, "no faster: it takes 1 ms less than the fastest that was found: it breaks a limit"),
    ],
)
def test_rounding_is_no_gain_of_time(taken, words):
    assert _possible(SimpleNamespace(gap=taken - 0.2, duration=taken, optimal_duration=0.2, feasible=False)) == words


def test_ctrl_c_is_no_missing_optimum(motion, here, monkeypatch):
    motion.save(here / "motion.npz")
    nothing = ad.time_optimality

    def stopped(*given, **more):
        found = nothing(*given, **more)
        return replace(found, solution=replace(found.solution, success=False, status=ad.Status.INTERRUPTED))

    monkeypatch.setattr(ad, "time_optimality", stopped, raising=False)
    output = answer(run_here("optimality", "rr", "motion.npz", "--search", "quick", "--json"), 130)
    assert output["status"] == "interrupted" and not any(file.endswith((".png", ".html")) for file in output["files"])
