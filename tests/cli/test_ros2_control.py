"""`armdyn export --format ros2`, judged by the rules and splines of ros2_control's controller, written down anew."""

import json
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest

import armdyn as ad
from cli.command import answer, run_here

FLOAT_EPSILON = float(np.finfo(np.float32).eps)


def accepted(message, joints):
    """Whether joint_trajectory_controller takes a message, as its validate_trajectory_msg: default parameters."""
    points = message["points"]
    if set(message["joint_names"]) != set(joints) or not points:
        return False
    if any(abs(v) > FLOAT_EPSILON for v in points[-1]["velocities"]):
        return False
    stamps = [p["time_from_start"]["sec"] * 10**9 + p["time_from_start"]["nanosec"] for p in points]
    sizes = {len(p[name]) for p in points for name in ("positions", "velocities", "accelerations")}
    return all(b > a for a, b in pairwise(stamps)) and sizes == {len(joints)}


def along(message, parts=101):
    """Positions and velocities along the quintics between the points, (m, nv) each, by linear equations."""
    points = message["points"]
    t = np.array([p["time_from_start"]["sec"] + p["time_from_start"]["nanosec"] / 1e9 for p in points])
    rows = [np.array([p[name] for p in points]) for name in ("positions", "velocities", "accelerations")]
    s = np.linspace(0, 1, parts)
    powers = np.arange(6)

    def derivative(order, x):
        factors = np.array([np.prod([p - i for i in range(order)]) if p >= order else 0 for p in powers])
        return factors * np.where(powers >= order, x ** np.maximum(powers - order, 0), 0)

    system = np.array([derivative(d, x) for x in (0.0, 1.0) for d in range(3)])
    h = np.diff(t)[:, None]
    given = np.stack([h**d * rows[d][k : len(t) - 1 + k] for k in (0, 1) for d in range(3)])
    coefficients = np.linalg.solve(system, given.reshape(6, -1)).reshape(given.shape)
    q, v = (
        np.einsum("kp,pnj->knj", np.array([derivative(d, x) for x in s]), coefficients) / h[None] ** d for d in (0, 1)
    )
    return q.reshape(-1, q.shape[2]), v.reshape(-1, v.shape[2])


def keeps_limits(message, limits, tolerance=1e-3):
    """Whether positions and velocities along the quintics keep the limits; a thousandth is tolerated, as docs say."""
    q, v = along(message)
    room = tolerance * (limits.position_upper - limits.position_lower)
    inside = np.all((q <= limits.position_upper + room) & (q >= limits.position_lower - room))
    return bool(inside and np.all(np.abs(v) <= (1 + tolerance) * limits.velocity))


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """Folders of minimum-time motions by arm, each solved once: torque-limited, speed-limited, with ramps of 1 ms."""
    tasks = {
        "panda": ("panda", "--q-start", "ready", "--q-goal", "1,0.2,0.5,-1.5,0.3,2,-0.5"),
        "rrr": ("rrr", "--velocity-limit", "3"),
        "rr": ("rr",),
    }

    @lru_cache
    def folder(arm):
        out = tmp_path_factory.mktemp(arm)
        run_here("mintime", *tasks[arm], "--search", "quick", "--no-figure", "--no-report", "--out", out)
        return out

    return folder


def exported(folder, *options, code=0):
    return answer(run_here("export", folder / "trajectory.npz", "--format", "ros2", *options, "--json"), code)


def limits_of(folder):
    given = json.loads((folder / "result.json").read_text())["model"]
    wide = {name: [np.inf if x is None else x for x in row] for name, row in given["limits"].items()}
    low = [-np.inf if x is None else x for x in given["limits"]["position_lower"]]
    rows = {name: wide[name] for name in ("position_upper", "velocity", "effort_lower", "effort_upper")}
    return ad.models.JointLimits(position_lower=low, **rows), given["joints"]


@pytest.mark.slow
@pytest.mark.parametrize("arm", ["panda", "rrr", "rr"])
def test_every_message_is_accepted_and_its_quintics_keep_the_limits(planned, tmp_path, arm):
    limits, joints = limits_of(planned(arm))
    for rate in (100, 250, 500, 1000):
        output = exported(planned(arm), "--rate", rate, "--out", tmp_path)
        message = json.loads((tmp_path / "trajectory.json").read_text())
        assert accepted(message, joints) and keeps_limits(message, limits)
        assert output["ros2_control"]["accepted"] and output["rate"] >= rate
        assert (output["rate"] > rate) == (output["ros2_control"]["raised"] is not None)
        stamps = [p["time_from_start"]["sec"] + p["time_from_start"]["nanosec"] / 1e9 for p in message["points"]]
        assert 0.999 / output["rate"] <= min(np.diff(stamps)) and max(np.diff(stamps)) < 2 / output["rate"]


@pytest.mark.slow
def test_a_rate_that_breaks_a_limit_between_rows_is_raised_or_refused_with_one_that_would_do(planned, tmp_path):
    folder = planned("rrr")
    limits, joints = limits_of(folder)
    output = exported(folder, "--rate", "250", "--out", tmp_path)
    raised = output["ros2_control"]["raised"]
    assert "would do" not in raised  # it was raised
    assert any(joint in raised for joint in joints) and "beyond its velocity limit of 3" in raised
    refused = exported(folder, "--rate", "250", "--tolerance", "0.1", "--out", tmp_path / "strict", code=3)
    enough = refused["ros2_control"]["enough"]
    assert refused["status"] == "refused" and f"--rate {enough:g} would do" in refused["message"]
    assert not (tmp_path / "strict").exists()
    exported(folder, "--rate", f"{enough}", "--tolerance", "0.1", "--out", tmp_path / "strict")
    assert keeps_limits(json.loads((tmp_path / "strict" / "trajectory.json").read_text()), limits)
    # The same rows at 250 Hz, as `export` wrote them before: the judges here and in armdyn agree that they are beyond.
    samples = ad.Trajectory.load(folder / "trajectory.npz").resample(250, least=1)
    assert not keeps_limits(samples.to_joint_trajectory(), limits)
    words = run_here("export", folder / "trajectory.npz", "--format", "ros2", "--rate", "250", "--out", tmp_path)
    assert "rate raised: between these points" in " ".join(words.stdout.split())


@pytest.mark.slow
def test_a_table_at_a_rate_too_low_is_written_with_the_rate_that_would_do_and_every_command_says_the_same(
    planned, tmp_path, unrendered
):
    folder, table = planned("rrr"), tmp_path / "trajectory.csv"
    limits, joints = limits_of(folder)

    def written(rate):
        output = answer(run_here("export", folder / "trajectory.npz", "--rate", rate, "--out", tmp_path, "--json"))
        columns = np.genfromtxt(table, delimiter=",", skip_header=1)
        points = [
            {"positions": row[1:4], "velocities": row[4:7], "accelerations": row[7:10],
             "time_from_start": {"sec": 0, "nanosec": 1e9 * row[0]}} for row in columns
        ]  # fmt: skip
        return output, keeps_limits({"points": points}, limits)

    def broken():
        """Whether compare, optimality and check say so, who must agree."""
        (tmp_path / "arm.toml").write_text('[robot]\nname = "rrr"\nvelocity_limit = 3\n')
        arm = ("--robot", tmp_path / "arm.toml")
        seen = answer(run_here("compare", folder, table, "--json", "--out", tmp_path / "c"))["motions"][1]["verdict"]
        brief = ("--search", "quick", "--no-figure", "--no-report", "--json", "--out", tmp_path / "o")
        judged = json.loads(run_here("optimality", "rrr", table, "--velocity-limit", "3", *brief).stdout)
        checked = json.loads(run_here("check", table, "--preset", "ros2-jtc", *arm, "--json").stdout)
        found = {seen == "Breaks its limits", judged["status"] == "limits_broken", not checked["success"]}
        assert len(found) == 1
        return found.pop()

    low, kept = written(250)
    assert not kept and low["rate"] == 250 and broken()
    (said,) = [one for one in low["warnings"] if "ros2_control" in one]
    assert any(joint in said for joint in joints) and "beyond its velocity limit of 3" in said
    enough = said.split("--rate ")[1].split()[0]
    high, kept = written(enough)
    assert kept and not high["warnings"] and not broken()


def test_a_motion_that_ends_at_speed_says_what_the_controller_needs(tmp_path):
    solved = ("--q-goal", "1", "--v-goal", "2", "--search", "quick", "--no-figure", "--no-report", "--out", tmp_path)
    run_here("mintime", "r", "--q-start", "0", *solved)
    file = tmp_path / "trajectory.npz"
    words = " ".join(run_here("export", file, "--format", "ros2").stdout.split())
    assert "ends in motion, joint1 at 2 rad/s: ros2_control takes it with allow_nonzero_velocity_at_traject" in words
    message = json.loads((tmp_path / "trajectory.json").read_text())
    assert message["points"][-1]["velocities"] == [2.0] and not accepted(message, ["joint1"])
    refused = exported(tmp_path, "--preset", "ros2-jtc", code=3)
    assert "end_velocity of joint1: 2 of 1.1921e-07 rad/s" in refused["message"]
    file = tmp_path / "trajectory.json"
    assert answer(run_here("check", file, "--preset", "ros2-jtc", "--json"), 3)["status"] == "refused"


def test_efforts_are_left_out_where_the_controller_does_not_take_them(planned, tmp_path):
    words = run_here("export", planned("rr") / "trajectory.npz", "--format", "ros2", "--no-effort", "--out", tmp_path)
    assert "effort" not in words.stdout.split("motion")[-1]
    assert all("effort" not in point for point in json.loads((tmp_path / "trajectory.json").read_text())["points"])


def test_a_motion_beyond_its_limits_is_written_and_it_is_said(tmp_path):
    run_here("pid", "r", "--no-figure", "--no-report", "--out", tmp_path)
    result = json.loads((tmp_path / "result.json").read_text())
    result["model"]["limits"]["velocity"] = [0.1]
    (tmp_path / "result.json").write_text(json.dumps(result))
    words = run_here("export", tmp_path / "trajectory.npz", "--format", "ros2", "--rate", "500")
    said = " ".join(words.stdout.split())
    assert words.returncode == 0 and "at 500 Hz" in said
    assert "the motion itself exceeds a limit: velocity of joint1" in said
