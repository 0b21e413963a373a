"""Reports of saved results, and motions side by side, from the command line."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
import yaml

import armdyn as ad
from armdyn.cli.reports.saved import read_saved
from armdyn.cli.reports.subject import SubjectSpec, subject_of
from armdyn.show.results import write_run
from cli.command import answer, run_here, run_json
from problems import pick_and_place
from undrawn import unrendered

BARE = ("--no-figure", "--no-report")
RAMP = ("track", "rr", "--ramp", "0.5", "--controller", "computed-torque", "--payload", "0.1", "--no-figure")


@pytest.fixture(scope="module")
def tracked(tmp_path_factory):
    """A tracked ramp with its own report."""
    folder = tmp_path_factory.mktemp("runs") / "track-rr"
    answer(run_here(*RAMP, "--json", "--out", folder))
    return folder


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "pid-rr"
    answer(run_here("pid", "rr", "--payload", "0.1", "--duration", "1", *BARE, "--json", "--out", folder), 3)
    return folder


def report(*arguments, code=0):
    return answer(run_here("report", *arguments, "--json"), code)


def changed(tracked, folder, **facts):
    """A copy of the run whose result says something else."""
    shutil.copytree(tracked, folder)
    path = folder / "result.json"
    result = json.loads(path.read_text())
    for name, value in facts.items():
        place = result
        *parents, last = name.split("__")
        for parent in parents:
            place = place[parent]
        place[last] = value
    path.write_text(json.dumps(result))
    return folder


def test_from_disk_comes_the_report_that_the_run_has_written(tracked, tmp_path):
    output = report(tracked, "--out", tmp_path)
    assert output["files"] == [str(tmp_path / "report.html")] and not output["warnings"]
    assert (tmp_path / "report.html").read_bytes() == (tracked / "report.html").read_bytes()


def test_its_command_can_be_typed_again(tracked):
    request = json.loads((tracked / "result.json").read_text())["request"]
    assert request["command"].startswith("armdyn track rr --payload 0.1 --ramp 0.5 --controller computed-torque")
    assert request["options"]["rate"] == 1000.0
    assert "armdyn track rr --payload 0.1" in (tracked / "report.html").read_text()


def test_it_is_written_next_to_a_single_result(loop, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(loop, folder)
    assert report(folder / "result.json")["files"] == [str(folder / "report.html")]
    assert "Did not arrive" in (folder / "report.html").read_text()


def test_a_bare_motion(tracked, tmp_path):
    shutil.copy(tracked / "trajectory.npz", tmp_path / "mine.npz")
    output = report(tmp_path / "mine.npz")
    assert "--robot" in output["warnings"][0]
    assert "Not judged" in (tmp_path / "report.html").read_text()
    assert not report(tmp_path / "mine.npz", "--robot", "rr", "--payload", "0.1")["warnings"]
    assert "another arm" in report(tmp_path / "mine.npz", "--robot", "rr", "--payload", "0.2")["warnings"][0]
    assert "moves 2 joints" in report(tmp_path / "mine.npz", "--robot", "rrr", code=2)["message"]


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_a_motion_whose_payload_changes(tmp_path):
    pick_and_place()[1].save(tmp_path / "cycle.npz")
    output = report(tmp_path / "cycle.npz", "--robot", "rr", "--payload", "0.2")
    assert not output["warnings"]  # each piece has its own load
    bare = replace(pick_and_place()[1], pieces=(), model_hash="that of another arm")
    bare.save(tmp_path / "other.npz")
    both = ("compare", tmp_path / "cycle.npz", tmp_path / "other.npz", "--robot", "rr", "--json", "--out", tmp_path)
    (warning, *_) = answer(run_here(*both))["warnings"]
    assert "other.npz: was computed for another arm" in warning
    run = ("replay", "rr", tmp_path / "cycle.npz", "--json", "--out", tmp_path)
    assert not answer(run_here(*run))["warnings"]


def test_a_robot_with_all_that_changes_it_is_made_again(tmp_path):
    pid = ("pid", "rr", "--duration", "0.2", "--armature", "0.01", "--damping", "0.1", "--friction", "0.02",
           "--effort-limit", "5", "--torque-speed", "joint1=0:5,1:4,2:1", *BARE)  # fmt: skip
    answer(run_here(*pid, "--json", "--out", tmp_path), 3)
    assert not report(tmp_path)["warnings"]
    assert json.loads((tmp_path / "result.json").read_text())["model"]["torque_speed"] == {
        "joint1": [[0, 5], [1, 4], [2, 1]]
    }
    assert "Torque and speed" in (tmp_path / "report.html").read_text()


@pytest.fixture
def ramp_of_panda(tmp_path):
    """A result of a Panda, whose fingers are locked."""
    panda = ad.Robot.from_library("panda", payload=ad.Payload(mass=0.5, frame="panda_hand"))
    motion = ad.ramp(panda, panda.pose("ready"), panda.pose("ready") + 0.1, 1.0)
    write_run(tmp_path / "panda", panda, {"trajectory": motion}, {"success": True}, "", parts=())
    return tmp_path / "panda"


@pytest.mark.slow
def test_a_replay_on_another_arm_than_the_result_s(ramp_of_panda, tmp_path):
    (warning,) = run_json("replay", "tiago_arm", ramp_of_panda, "--out", tmp_path / "page")["warnings"]
    assert "another arm" in warning


@pytest.mark.slow
def test_a_replay_has_the_payload_and_the_locks_of_the_result(ramp_of_panda, tmp_path):
    output = run_json("replay", "panda", ramp_of_panda, "--degrees", "--out", tmp_path / "page")
    assert not output["warnings"] and "payload 500 g" in (tmp_path / "page" / "replay.html").read_text()


@pytest.mark.slow
def test_side_by_side(tracked, loop, tmp_path):
    output = answer(run_here("compare", tracked, loop, "--until", "0.4", "--json", "--out", tmp_path))
    first, second = output["motions"]
    run = ad.Trajectory.load(tracked / "trajectory.npz")
    result = json.loads((tracked / "result.json").read_text())
    assert first["there"] == result["settled_time"] and first["later"] == 0
    assert first["duration"] == run.duration and second["duration"] == pytest.approx(1.0)  # whole, not up to 0.4 s
    assert second["there"] is None and second["later"] is None
    fine = run(np.linspace(0, run.duration, 40_001))
    work = np.trapezoid(np.abs(fine.v * fine.tau).sum(axis=1), dx=run.duration / 40_000)
    assert first["work"] == pytest.approx(work, rel=1e-3)  # the trapezoidal rule at a tenth as many times
    assert first["torque"] == pytest.approx(np.abs(run.tau).max() / 3)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["figure.pdf", "figure.svg", "report.html"]
    page = (tmp_path / "report.html").read_text()
    assert "Side by side" in page and "Checks: PID (acceleration)" in page
    with unrendered():
        words = run_here("compare", tracked, loop, "--out", tmp_path).stdout
    assert "slower: than the first motion" in words and "figure.svg" in words


def planned(tracked, folder):
    """The reference that was tracked, as four other planners would leave it."""
    motion = ad.Trajectory.load(tracked / "reference.npz")
    t, q, v = motion.t, motion.q, motion.v
    np.savez(folder / "toppra.npz", ts_sample=t, qs_sample=q, qds_sample=v)
    np.savetxt(folder / "table.csv", np.column_stack([t, q]), delimiter=",", header="t,q1,q2")
    fields = motion.resample(1000).to_joint_trajectory()
    for point in fields["points"]:  # joints in another order, and no torques
        point |= {"positions": point["positions"][::-1], "velocities": [], "accelerations": [], "effort": []}
    (folder / "ros.json").write_text(json.dumps(fields | {"joint_names": fields["joint_names"][::-1]}))
    (folder / "ros.yaml").write_text(yaml.safe_dump(fields | {"joint_names": fields["joint_names"][::-1]}))
    return [folder / name for name in ("toppra.npz", "table.csv", "ros.json", "ros.yaml")]


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_motions_of_other_planners_are_compared(tracked, tmp_path):
    files = planned(tracked, tmp_path)
    output = answer(run_here("compare", tracked, *files, "--json", "--out", tmp_path / "out"))
    first, *others = output["motions"]
    assert not output["warnings"]
    assert first["name"] == "tracked by computed torque"
    assert [one["name"] for one in others] == ["toppra", "table", "ros (ros.json)", "ros (ros.yaml)"]
    motion = ad.Trajectory.load(tracked / "reference.npz")
    for one in others:
        assert one["verdict"] == "Keeps its limits"
        assert one["there"] == one["duration"] == pytest.approx(motion.duration, abs=1e-9)  # whole nanoseconds
        # Torques by inverse dynamics of differences: some parts in a thousand of a quintic's at 200 samples and more.
        assert one["torque"] == pytest.approx(np.abs(motion.tau).max() / 3, rel=0.01)
        assert one["later"] == pytest.approx(motion.duration / first["there"] - 1, abs=1e-6)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Checks: toppra" in page and "Path constraints" not in page
    words = run_here("compare", tracked, files[0], "--out", tmp_path / "out").stdout
    assert "+" in words and "Keeps its" in words  # of narrow columns


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_only_motions_of_other_planners(tracked, tmp_path):
    toppra, table, *_ = planned(tracked, tmp_path)
    for command in (("compare", toppra, table), ("report", toppra)):
        message = answer(run_here(*command, "--json"), 2)["message"]
        assert "toppra.npz does not say of which robot it is: name it by --robot" in message
    named = ("--robot", "rr", "--payload", "0.1", "--json", "--out", tmp_path / "out")
    first, second = answer(run_here("compare", toppra, table, *named))["motions"]
    assert first["verdict"] == second["verdict"] == "Keeps its limits"
    assert answer(run_here("report", toppra, *named))["robot"] == "rr"
    assert "Keeps its limits" in (tmp_path / "out" / "report.html").read_text()
    assert "2 columns" in answer(run_here("report", table, "--robot", "rrr", "--json"), 2)["message"]
    message = answer(run_here("compare", toppra, tracked, "--lock", "joint1=0", "--json"), 2)["message"]
    assert "--lock is of a robot that --robot names" in message


@pytest.mark.slow
def test_joints_of_a_bigger_robot(tmp_path):
    """Of a Panda whose last joints are locked, a file has the others."""
    robot = ad.Robot.from_library("panda", arm=("panda_joint1", "panda_joint4"))
    ad.ramp(robot, [0, -0.3, 0, -2.2], [0.2, 0, 0.1, -2.0], 1.0).to_csv(tmp_path / "a.csv")
    named = ("--robot", "panda", "--arm", "panda_joint1,panda_joint4", "--out", tmp_path, "--json")
    assert answer(run_here("report", tmp_path / "a.csv", *named))["success"]
    assert "of 7 joints" in answer(run_here("report", tmp_path / "a.csv", *named[:2], "--json"), 2)["message"]


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_a_motion_that_breaks_limits_or_has_another_task_is_reported(tracked, tmp_path):
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), ad.Payload(mass=0.1))
    reference = ad.Trajectory.load(tracked / "reference.npz")
    fast = ad.ramp(robot, reference.q[0], reference.q[-1], 0.1)
    fast.to_csv(tmp_path / "fast.csv")
    away = ad.ramp(robot, reference.q[0] + 0.1, reference.q[-1] + 0.2, 0.5)
    away.to_csv(tmp_path / "away.csv")
    files = (tmp_path / "fast.csv", tmp_path / "away.csv")
    output = answer(run_here("compare", tracked, *files, "--json", "--out", tmp_path))
    assert output["motions"][1]["verdict"] == "Breaks its limits" and output["motions"][1]["torque"] > 1
    assert len(output["warnings"]) == 1 and "away begins 0.1 rad from where tracked" in output["warnings"][0]
    both = answer(run_here("compare", *files, "--robot", "rr", "--payload", "0.1", "--json", "--out", tmp_path))
    assert [line.split()[1] for line in both["warnings"]] == ["begins", "ends"]


def test_no_folder_of_this_machine_is_in_the_page(tracked, tmp_path):
    page = (tracked / "report.html").read_text()
    assert str(tracked.parent) not in page and f"--out {tracked.name}" in page
    output = json.loads((tracked / "result.json").read_text())
    assert str(tracked.parent) in output["request"]["command"]  # where it can be typed again


def test_obstacles_are_in_the_result(tracked, tmp_path):
    box = {"type": "box", "size": [0.1, 0.1, 0.1], "position": [1, 0, 0], "name": "crate"}
    for name, entries, count in (("a", [box], 1), ("b", [box, {"type": "box"}], 0), ("c", "box", 0), ("d", [3], 0)):
        folder = changed(tracked, tmp_path / name, obstacles=entries)
        assert len(subject_of(read_saved(folder), SubjectSpec()).obstacles) == count
    report(tmp_path / "a")
    assert (tmp_path / "a" / "report.html").read_text() != (tracked / "report.html").read_text()


@pytest.mark.parametrize(
    "name", ["/etc/passwd", "../arm.urdf", "arm.urdf", "panda_mj_description", "nobody", "", 3, None]
)
def test_a_robot_is_not_read_because_a_result_names_it(name, tracked, tmp_path, monkeypatch):
    monkeypatch.setattr(ad.Robot, "from_urdf", None)  # reading a file would fail
    monkeypatch.setattr(ad.Robot, "from_mjcf", None)
    monkeypatch.setattr(ad.Robot, "from_description", None)
    folder = changed(tracked, tmp_path / "run", request__options__robot=name, model__source="arm.urdf")
    output = report(folder)
    assert output["success"] and len(output["warnings"]) == 1


def test_obstacles_of_a_stranger_s_command_are_not_read(tracked, tmp_path):
    (tmp_path / "box.json").write_text("[]")
    folder = changed(
        tracked, tmp_path / "a", request__options__obstacle=[str(tmp_path / "box.json"), "sphere:0.1@1,0,0"]
    )
    assert report(folder)["success"]
    assert not subject_of(read_saved(folder), SubjectSpec()).obstacles


@pytest.mark.parametrize("name", ["trajectory.npz", "result.json", "reference.npz"])
def test_a_link_out_of_the_folder_is_refused(name, tracked, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(tracked, folder)
    (folder / name).rename(tmp_path / name)
    (folder / name).symlink_to(tmp_path / name)
    assert "leads out of its folder" in report(folder, code=2)["message"]


@pytest.mark.parametrize(
    ("facts", "message"),
    [
        ({"format": "other"}, "format"),
        ({"model": None}, "model"),
    ],
)
def test_a_damaged_result(facts, message, tracked, tmp_path):
    assert message in report(changed(tracked, tmp_path / "run", **facts), code=2)["message"]


@pytest.mark.parametrize("facts", [{"model__limits": 3}, {"model__limits__velocity": ["x", 1]}, {"model__sliding": [1]},
                                   {"model__payload": {"mass": -1}}, {"model__armature": [-1, 1]}])  # fmt: skip
def test_a_model_that_makes_no_sense_is_left_out_or_reported(facts, tracked, tmp_path):
    assert report(changed(tracked, tmp_path / "run", **facts))["success"]


def test_bad_input(tracked, tmp_path):
    assert "two results" in answer(run_here("compare", tracked, "--json"), 2)["message"]
    assert "no such file" in report(tmp_path, code=2)["message"]
    for name in ("none.npz", "none.csv", "none.json"):
        assert "no such file" in report(tmp_path / name, code=2)["message"]
    for text in ("0", "-1", "soon"):
        assert "--until" in report(tracked, "--until", text, code=2)["message"]
    ad.ramp(ad.Robot.from_spec(ad.ArmSpec.paper("r")), [0.0], [1.0], 0.5).save(tmp_path / "one.npz")
    output = answer(run_here("compare", tracked, tmp_path / "one.npz", "--json"), 2)
    assert "only motions of one arm" in output["message"]


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_a_file_that_a_result_names_is_the_arm_if_it_is_the_very_one(tracked, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    answer(run_here("urdf", "rr", "--out", ".", "--json"))
    poses = ("--q-start=-90deg,0", "--q-goal=-80deg,5deg")
    answer(
        run_here("mintime", "rr.urdf", *poses, "--starts", "1", "--no-figure", "--no-report", "--json", "--out", "a")
    )
    motion = ad.Trajectory.load("a/trajectory.npz")
    table = np.column_stack([motion.t, motion.q])[np.concatenate([[True], np.diff(motion.t) > 1e-6])]
    np.savetxt("other.csv", table, delimiter=",", header="t,q1,q2", comments="")
    output = answer(run_here("compare", "a", "other.csv", "--json", "--out", "both"))
    assert output["warnings"] == [] and len(output["motions"]) == 2
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir("elsewhere")
    output = answer(run_here("compare", "../a", "../other.csv", "--json", "--out", "both"))
    assert output["warnings"] == [] and len(output["motions"]) == 2
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rr.urdf").write_text((tmp_path / "rr.urdf").read_text().replace('mass value="', 'mass value="1'))
    done = run_here("compare", "a", "other.csv", "--json", "--out", "both")
    assert "rr.urdf is not the arm that moved" in answer(done, 2)["warnings"][0]
    # A table [robot] alone, with inertias of its own, as `armdyn identify` writes it.
    bodies = {f"joint{k}": [0.2, 0.03, 0.0, 0.0, 1e-5, 0.0, 0.007, 0.0, 0.0, 0.007] for k in (1, 2)}
    (tmp_path / "arm.toml").write_text(
        "[robot]\nname = 'rr'\ninertias = {" + ", ".join(f"{name} = {row}" for name, row in bodies.items()) + "}\n"
    )
    answer(run_here("track", "arm.toml", *poses, "--ramp", "1", "--no-figure", "--no-report", "--json", "--out", "a"))
    monkeypatch.chdir("elsewhere")
    assert answer(run_here("compare", "../a", "../other.csv", "--json", "--out", "both"))["warnings"] == []


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_a_motion_is_compared_with_its_tracking_on_another_arm(tracked, tmp_path):
    fast = ("--no-figure", "--no-report", "--json")
    loop = ("--payload", "0.1", "--ramp", "0.5", "--plant-payload", "0.12")
    answer(run_here("track", "rr", *loop, *fast, "--out", tmp_path / "real"))
    for order in ((tracked, tmp_path / "real"), (tmp_path / "real", tracked)):
        output = answer(run_here("compare", *order, "--json", "--out", tmp_path / "both"))
        assert not any("another arm" in warning for warning in output["warnings"])


@pytest.mark.slow
def test_an_arm_of_a_problem_file_that_comes_with_armdyn_is_drawn(tmp_path):
    problem = "[robot]\nname = 'r'\n[problem]\nq_start = [-1.0]\nq_goal = [1.0]\n"
    (tmp_path / "problem.toml").write_text(problem)
    run_json("mintime", "problem.toml", "--no-figure", "--no-report", "--out", "run", cwd=tmp_path)
    (tmp_path / "problem.toml").unlink()
    assert run_json("report", "run", cwd=tmp_path)["warnings"] == []
    result = tmp_path / "run" / "result.json"
    result.write_text(result.read_text().replace('"name": "r"', '"name": "rr"'))
    assert "cannot be made again" in run_json("report", "run", cwd=tmp_path)["warnings"][0]


def test_a_result_remembers_where_its_arm_is_mounted(tmp_path):
    out, ceiling = tmp_path / "run", ("--mount", "0,0,2.5,180deg,0,0")
    run_json("track", "rr", *ceiling, "--ramp", "0.5", "--controller", "computed-torque", *BARE, "--out", out)
    arm = subject_of(read_saved(out), SubjectSpec()).robot
    assert arm.model_hash == ad.Robot.from_spec(ad.ArmSpec.paper("rr"), mount=arm.options.mount).model_hash
    np.testing.assert_allclose(np.array(arm.options.mount)[:3, 3], [0, 0, 2.5])
    np.testing.assert_allclose(np.diag(arm.options.mount), [1, -1, -1, 1], atol=1e-15)  # rounding of sin(pi)
    assert not report(out)["warnings"] and "0, 0, 2.5 m" in (out / "report.html").read_text()
    assert "X,Y,Z,ROLL,PITCH,YAW" in run_here("doctor", "rr", "--mount", "0,0").stderr
    assert "give both" in run_here("report", out, *ceiling).stderr
