"""Study files: their content, and bounds of untrusted ones."""

import re
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ArmdynError, FileError, ProblemError
from armdyn.studies.executor import in_process
from armdyn.studies.reading import read_study
from armdyn.studies.tuning.tune import GainSearch

ARM = "[arms.rr]\nq_start = [-1.5, 0.0]\nq_goal = [0.2, 0.0]\n"
VARY = "[vary]\npayload = [0.1, 0.2]\n"


@pytest.fixture
def study(tmp_path):
    def write(text, folder=tmp_path):
        path = folder / "study.toml"
        path.write_text(text)
        return read_study(path)

    return write


def test_text_of_a_study(study):
    request = study(
        ARM + '[fixed]\nreserve = 0.1\nq_start."joint1" = -1.4\n[vary]\npayload = [0.1, 0.2]\n'
        "q_goal.joint2 = { from = -0.1, to = 0.1, count = 3 }\n[search]\nstarts = 4\nneighbours = 'off'\n"
    )
    assert len(request) == 6 and request.parameters(5) == {"payload": 0.2, "q_goal.joint2": 0.1}
    problem = request.task.problems.problem(request.parameters(5))
    assert problem.q_start.tolist() == [-1.4, 0.0] and problem.q_goal.tolist() == [0.2, 0.1]
    assert problem.robot.payload.mass == 0.2 and problem.reserves.effort.tolist() == [0.1, 0.1]
    assert request.task.options.starts == 4 and request.task.neighbours == "off"


def test_positions_are_written_as_on_the_command_line(study):
    request = study(
        "[arms.panda]\nq_start = 'ready'\nq_goal = [1, 'pi/8', 0.5, '-90deg', 0.3, 2, '-0.5rad']\n"
        "[vary]\nq_goal.panda_joint1 = ['30deg', 0.1]\n"
        "q_start.panda_joint2 = {from = '-10deg', to = 'pi/18', count = 3}\n"
    )
    panda, problem = ad.Robot.from_library("panda"), request.task.problems.problem(request.parameters(0))
    assert problem.q_start.tolist() == pytest.approx([0, -np.pi / 18, *panda.pose("ready")[2:]], rel=1e-11)  # 12 digits
    assert problem.q_goal.tolist() == [np.pi / 6, np.pi / 8, 0.5, -np.pi / 2, 0.3, 2, -0.5]


def test_poses_vary_by_their_names(study):
    request = study("[arms.ur3]\nq_start = 'zero'\n[arms.ur5]\nq_start = 'zero'\n[vary]\nq_goal = ['home', 'up']\n")
    assert request.parameters(3) == {"arm": "ur5", "q_goal": "up"}
    up = ad.Robot.from_library("ur5").pose("up")
    assert request.task.problems.problem(request.parameters(3)).q_goal.tolist() == up.tolist()
    assert request.description()["task"]["arms"]["ur5"]["named"]["up"] == up.tolist()


def test_poses_of_an_srdf_by_the_urdf(study, tmp_path):
    (tmp_path / "one.urdf").write_text(ad.urdf_from_spec(ad.ArmSpec.paper("r")))
    (tmp_path / "one.srdf").write_text(
        '<robot name="one"><group_state name="down"><joint name="joint1" value="-1.5"/></group_state></robot>'
    )
    request = study("[arms.mine]\nrobot = 'one.urdf'\nq_start = 'down'\nq_goal = ['20deg']\n" + VARY)
    problem = request.task.problems.problem(request.parameters(0))
    assert problem.q_start.tolist() == [-1.5] and problem.q_goal.tolist() == [np.deg2rad(20)]


def test_limits_are_scaled_and_replaced(study):
    request = study(ARM + "[fixed]\nvelocity_limit = 8.0\n[vary]\neffort_scale = [0.5]\n")
    own = ad.Robot.from_spec(ad.ArmSpec.paper("rr")).limits
    limits = request.task.problems.problem(request.parameters(0)).limits
    assert limits.effort_upper == pytest.approx(0.5 * own.effort_upper, rel=1e-15)
    assert limits.velocity.tolist() == [8.0, 8.0]
    request = study(ARM + "limits = { effort_lower = [-1.0, -2.0] }\n[vary]\neffort_scale = [0.5]\n")
    weaker = request.task.problems.problem(request.parameters(0)).limits
    assert weaker.effort_lower.tolist() == [-0.5, -1.0] and np.array_equal(weaker.effort_upper, limits.effort_upper)
    arm = ARM + "torque_speed = { joint2 = [[0, 3], [9, 1]] }\n"
    request = study(arm + "[vary]\neffort_scale = [0.5]\n")
    falling = request.task.problems.problem(request.parameters(0)).limits.actuators
    assert np.allclose(falling.range(np.zeros(2), np.full(2, 9.0))[1], [1.5, 0.5])


def test_several_arms_are_an_axis_of_their_own(study):
    request = study(ARM + "[arms.single]\nrobot = 'r'\nq_start = [0.0]\nq_goal = [1.0]\n" + VARY)
    assert [axis.name for axis in request.axes] == ["arm", "payload"]
    assert request.task.problems.problem(request.parameters(2)).robot.joint_names == ("joint1",)


def test_a_file_next_to_the_study_goes_with_it(study, tmp_path):
    text = ad.urdf_from_spec(ad.ArmSpec.paper("r"))
    (tmp_path / "arms").mkdir()
    (tmp_path / "arms" / "one.urdf").write_text(text)
    arm = "[arms.mine]\nrobot = 'arms/one.urdf'\nq_start = [0.0]\nq_goal = [1.0]\n"
    request = study(arm + VARY)
    before = request.description()
    (tmp_path / "arms" / "one.urdf").write_text(text.replace('name="r"', 'name="s"', 1))
    assert request.task.problems.problem(request.parameters(0)).robot.joint_names == (
        "joint1",
    )  # it needs the file no more
    assert study(arm + VARY).description() != before  # another file is another study


@pytest.mark.parametrize("place", ["../outside.urdf", "/etc/passwd.urdf", "link.urdf", "sub/../../outside.urdf"])
def test_no_file_beyond_the_studys_folder(study, tmp_path, place):
    (tmp_path / "outside.urdf").write_text(ad.urdf_from_spec(ad.ArmSpec.paper("r")))
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "link.urdf").symlink_to(tmp_path / "outside.urdf")
    with pytest.raises(ProblemError, match=r"line 2: .*is outside the folder"):
        study(f"[arms.a]\nrobot = '{place}'\nq_start = [0.0]\nq_goal = [1.0]\n" + VARY, inner)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (VARY, "line 1: no arm"),
        (ARM, "line 1: nothing varies"),
        (ARM + VARY + "[problem]\n", "line 6: .problem. is of a problem file, which armdyn mintime"),
        (ARM + VARY + "[paylod]\n", "line 6: no table 'paylod' at the top; known: task"),
        (
            "task = 'drive'\n" + ARM + VARY,
            "line 1: task is 'drive'; it is one of 'minimum-time', 'track', 'monte-carlo'",
        ),
        (ARM + "[vary]\npaylod = [1]\n", "line 5: paylod is no setting; did you mean 'payload'"),
        (ARM + "[vary]\npayload = 1\n", "line 5: payload is 1; write a list, or {from"),
        (ARM + "[vary]\npayload = [1, 'two']\n", "line 5: payload is 'two' kg; it must be|line 5: payload is 'two'"),
        (ARM + "[vary]\npayload = [-1]\n", "line 5: payload is -1 kg; it must be finite and not negative"),
        (ARM + "[vary]\npayload = [nan]\n", "line 5: payload is nan kg"),
        (ARM + "[vary]\npayload = []\n", "line 5: payload has 0 values"),
        (ARM + "[vary]\npayload = {from = 0, to = 1}\n", "line 5: payload has a range without count"),
        (ARM + "[vary]\npayload = {from = 0, to = 1, count = 1e9}\n", "line 5: payload: count is 1000000000.0"),
        (ARM + "[vary]\npayload = {from = 0, to = 1, steps = 2}\n", "line 5: payload: steps is not known"),
        (ARM + "[vary]\nreserve = [1.5]\n", "line 5: reserve is 1.5; it is a part of the limits"),
        (ARM + "[vary]\nq_goal.joint3 = [1]\n", "line 5: q_goal.joint3: arm rr has no joint 'joint3'"),
        (ARM + "[vary]\nkp = [1]\n", "line 5: kp is no setting"),
        (ARM + "[vary]\nq_goal.joint2 = ['30grad']\n", "line 5: q_goal.joint2: '30grad' is not a number"),
        (ARM + "[vary]\nq_goal.joint2 = ['0.1m']\n", "line 5: q_goal.joint2: '0.1m', but the joint turns"),
        (ARM + "[vary]\nq_goal = ['zero', 'hoem']\n", "line 1: q_goal is 'hoem'"),
        (ARM + "[vary]\nq_goal = ['zero', 1]\n", "line 5: q_goal is 1; write names of poses, or q_goal.JOINT"),
        (ARM + "[vary]\nq_goal = ['zero', 'zero']\n", "line 5: q_goal has a value twice"),
        (ARM + f"[vary]\nq_goal = {['zero'] * 65}\n", "line 5: q_goal has 65 names of poses; give at most 64"),
        (ARM + "[vary]\narm = ['r']\n", "line 5: arm is 'r'; the study's arms are rr"),
        (ARM + "[vary]\narm = [3]\n", "line 5: arm is 3; the study's arms are rr"),
        (ARM + VARY + "[fixed]\npayload = 1\n", "line 7: payload is both fixed and varied|payload is both"),
        (ARM + VARY + "[sample]\nmethod = 'random'\n", "line 6: count is 0; a study has 1 to 1000000 cases"),
        (ARM + VARY + "[sample]\nmethod = 'random'\ncount = 10000000\n", "line 8: count is 10000000; a study has"),
        (ARM + VARY + "[search]\nworkers = 3\n", r"line 7: no key 'workers' in \[search\]; known: search"),
        (ARM + VARY + "[search]\nstarts = 'many'\n", "line 7: starts is 'many'"),
        (ARM + VARY + "[track]\n", r"line 6: \[track\] is for task = 'track'"),
        ("[arms.rr]\nq_start = [0, 0]\n" + VARY, "line 1: arms.rr.q_goal is missing: 2 positions"),
        ("[arms.rr]\nq_start = 'hoem'\nq_goal = [0, 1]\n" + VARY, "line 2: arms.rr.q_start is 'hoem'"),
        ("[arms.rr]\nq_start = [0, true]\nq_goal = [0, 1]\n" + VARY, "line 2: arms.rr.q_start has True; a position"),
        ("[arms.rr]\nq_start = 1\nq_goal = [0, 1]\n" + VARY, "line 2: arms.rr.q_start is 1; it must be 2 positions"),
        (
            "[arms.rr]\nq_start = [0]\nq_goal = [0, 1]\n" + VARY,
            "line 2: arms.rr.q_start has shape .1,.; expected 2 numbers, one per joint: joint1, joint2",
        ),
        ("[arms.'../x']\nq_start = [0]\nq_goal = [1]\n" + VARY, "line 1: arm '../x': a name has letters"),
        (
            "[arms.pandaa]\nq_start = [0]\nq_goal = [1]\n" + VARY,
            "line 1: no robot named 'pandaa'.*did you mean 'panda'",
        ),
        ("[arms.a]\nrobot = 'none.urdf'\nq_start = [0]\nq_goal = [1]\n" + VARY, "line 2: .*no such file"),
        ("task = 'track'\n" + ARM + "[vary]\nkp = [1]\n", "line 6: kp is a setting of controller 'pid', not of 'lqr'"),
        ("task = 'track'\n" + ARM + "[vary]\nramp = [1]\n", "line 6: ramp does not apply to reference 'minimum-time'"),
        ("task = 'track'\n" + ARM + VARY + "[track]\ncontroller = 'pid'\n", "line 8: controller 'pid' with reference"),
        (
            "task = 'track'\n" + ARM + VARY + "[track]\nform = 'torque'\n",
            "line 8: form is an option of controller 'pid'",
        ),
        ("task = 'tune'\n" + ARM + "[vary]\nkp = [1]\n", "line 6: kp is chosen by task 'tune': leave it out"),
        ("task = 'monte-carlo'\n" + ARM + VARY + "[monte-carlo]\ncount = 0\n", "line 8: count is 0"),
        ("task = 'monte-carlo'\n" + ARM + VARY + "[monte-carlo]\nwithin = -1\n", "line 8: within is -1 s"),
        ("task = 'tune'\n" + ARM + VARY + "[tune]\ncontroller = 3\n", "line 8: controller is 3"),
        ("task = 'tune'\n" + ARM + VARY + "[tune]\nreference = 'x'\n", "line 8: reference is 'x'"),
        ("task = 'reserve'\n" + ARM + VARY + "[reserve]\nduration = 'x'\n", "line 8: duration is 'x'"),
        ("task = 'reserve'\n" + ARM + "[vary]\nreserve = [0.1]\n", "line 6: reserve is chosen by task 'reserve'"),
        ("task = 'track'\n" + ARM + VARY + "[track]\ncontroller = 'fuzzy'\n", "line 8: controller is 'fuzzy'"),
        ("task = 'track'\n" + ARM + VARY + "[track]\nduration = -1\n", "line 8: duration is -1 s"),
    ],
)
def test_a_complaint_has_the_line_and_the_right_form(study, text, words):
    with pytest.raises(ProblemError, match=words):
        study(text)


def test_the_studies_of_the_docs(study):
    docs = (Path(__file__).parents[2] / "docs" / "sweeps.md").read_text()
    found = [study(text) for text in re.findall(r"```toml\n(.*?)```", docs, flags=re.S)]
    assert [len(one) for one in found] == [30, 49, 150]


def test_a_missing_study(tmp_path):
    with pytest.raises(FileError, match="no such file"):
        read_study(tmp_path / "none.toml")
    assert issubclass(FileError, ArmdynError)


OBSTACLE = "obstacles = [{ type = 'sphere', name = 'ball', center = [0.6, 0.0, 0.3], radius = 0.05 }]\n"


def test_any_field_of_the_problem_may_vary(study):
    request = study(
        ARM + "via = [[-0.5, 0.1]]\n" + OBSTACLE + "clearance = 0.01\n[fixed]\nwrap = true\n[vary]\n"
        "obstacles.ball.center.0 = { from = 0.6, to = 0.7, count = 2 }\n"
        "via = [[], [[-0.5, 0.2]], [[-1.0, 0.1], [-0.5, 0.2]]]\n"
        "jerk_limit = [2e4, 4e4]\npath_constraints = [[], ['tip-speed=2']]\n"
    )
    assert len(request) == 24 and request.axes[1].kind == "words"
    problem = request.task.problems.problem(request.parameters(23))
    assert problem.obstacles[0].center == (0.7, 0.0, 0.3) and problem.obstacles[0].name == "ball"
    assert [q.tolist() for q in problem.via] == [[-1.0, 0.1], [-0.5, 0.2]]
    assert problem.jerk_limit.tolist() == [4e4, 4e4] and problem.clearance == 0.01 and problem.wrap
    assert [one.name for one in problem.path_constraints] == ["frame speed limits"]
    first = request.task.problems.problem(request.parameters(0))
    assert first.obstacles[0].center[0] == 0.6 and first.via == () and first.path_constraints == ()


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        ("obstacles.box.radius = [0.1]", "line 6: obstacles.box.radius: obstacles has no 'box'.*ball"),
        ("obstacles.3.radius = [0.1]", "line 6: obstacles.3.radius: obstacles has no '3'"),
        ("goal_pose.position = [[0, 0, 1]]", "line 6: goal_pose.position: goal_pose is not there to be changed"),
        ("clearance.x = [1]", "line 6: clearance.x: clearance is not there"),
        ("obstackles = [1]", "line 6: obstackles is no setting; did you mean 'obstacles'"),
    ],
)
def test_a_place_that_is_not_there_is_refused(study, vary, words):
    with pytest.raises(ProblemError, match=words):
        study(ARM + OBSTACLE + f"[vary]\n{vary}\n")


@pytest.mark.parametrize(
    ("task", "own"),
    [
        ("monte-carlo", "ramp_ = 0\n[monte-carlo]\nreference = 'ramp'\ncount = 3\nduration = 0.8\n"),
        ("tune", "[tune]\noptions = { members = 2, generations = 1 }\nramp_range = [0.4, 0.6]\nduration = 0.8\n"),
    ],
)
def test_a_task_of_many_arms(study, task, own):
    arm = "[arms.r]\nq_start = [-1.57]\nq_goal = [0.16]\n"
    fixed = "[fixed]\nramp = 0.5\n" if task == "monte-carlo" else ""
    request = study(
        f"task = '{task}'\n" + arm + fixed + "[vary]\npayload = [0.1, 0.2]\n" + own.replace("ramp_ = 0\n", "")
    )
    found = request.task.work(request.parameters(0), b"")
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("r"), ad.Payload(mass=0.1))
    if task == "monte-carlo":
        options = ad.MonteCarloOptions(count=3, duration=0.8)
        same = ad.monte_carlo(robot, ad.ramp(robot, [-1.57], [0.16], 0.5), options=options)
        assert found.facts["worst_settled_time_s"] == max(same.settled_times) and found.facts["success_rate"] == 1
    else:
        family, plants = ad.ControllerFamily.pid(robot, [0.16]), ad.Plants().corners(robot)
        options = ad.TuneOptions(members=2, generations=1, duration=0.8)
        same = ad.tune(robot, ad.Ramps([-1.57], [0.16], (0.4, 0.6)), family, plants, options=options)
        assert {name: found.facts[name] for name in same.values} == same.values
        assert found.facts["settled_time_s"] == same.training.settled_time


def test_a_reserve_for_each_case(study):
    request = study(
        "task = 'reserve'\n[arms.r]\nq_start = [-1.57]\nq_goal = [0.16]\n[vary]\npayload = [0.1]\n"
        "[reserve]\nreserves = [0.0, 0.1]\nduration = 0.8\n"
    )
    found = request.task.work(request.parameters(0), b"")
    assert found.good and found.facts["best_reserve"] in (0.0, 0.1) and found.facts["arms"] == 6


def test_a_chain_is_resumed(study, tmp_path):
    request = study("[arms.r]\nq_start = [-1.57]\nq_goal = [0.16]\n[vary]\npayload = [0.1, 0.11, 0.12]\n"
                  "[search]\nneighbours = 'chain'\n")  # fmt: skip
    run = ad.run_study(request, tmp_path / "s.sqlite", in_process)
    rows = ad.study_table(run.file)
    assert run.counts == {"usable": 3} and [row["begun_from"] for row in rows][1:] == [0, 1]
    again = ad.run_study(request, run.file, in_process)
    assert again.done_here == 0 and ad.study_table(run.file) == rows


@pytest.mark.slow
def test_a_search_for_gains_is_resumed(tmp_path, monkeypatch):
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("r"), ad.Payload(mass=0.1))
    reference = ad.ramp(robot, [-1.57], [0.16], 0.5)
    family, file = ad.ControllerFamily.lqr(), tmp_path / "rows.sqlite"
    options = ad.TuneOptions(members=2, generations=2, duration=0.8, file=file)

    def press(text):
        signal.raise_signal(signal.SIGINT)

    first = ad.tune(robot, reference, family, [robot], options=options, progress=press)
    assert first.status == "interrupted"
    there, ran = len(ad.study_table(file)), []
    work = GainSearch.work
    monkeypatch.setattr(GainSearch, "work", lambda self, *given: ran.append(given) or work(self, *given))
    second = ad.tune(robot, reference, family, [robot], options=options)
    alone = ad.tune(robot, reference, family, [robot], options=replace(options, file=None))
    assert second.values == alone.values and second.history == alone.history
    assert there > 0 and len(ran) == 2 * alone.evaluations - there


def test_files_of_obstacles_scenes_and_presets_are_read_with_the_study(study, tmp_path, monkeypatch):
    monkeypatch.chdir("/")
    names = ("scene.json", "seen.npy", "mine.toml")
    (tmp_path / names[0]).write_text('[{"type": "sphere", "name": "ball", "center": [2, 0, 0], "radius": 0.05}]')
    np.save(tmp_path / names[1], np.array([[0.0, 2.0, 0.0]]))
    (tmp_path / names[2]).write_text(
        'name = "mine"\njoints = 2\n[limits]\nvelocity = 9.0\n[interfaces.position]\nrate = 100\n'
        'necessary = ["velocity"]\n'
    )
    seen = "obstacles = [{ type = 'point cloud', name = 'seen', file = 'seen.npy', size = 0.02 }]\n"
    request = study(
        ARM + f"scene = 'scene.json'\npreset = 'mine.toml'\n{seen}[vary]\nobstacles.ball.radius = [0.1, 0.2]\n"
    )
    for name in names:
        (tmp_path / name).unlink()
    problem = request.task.problems.problem(request.parameters(1))
    assert [one.name for one in problem.obstacles] == ["seen", "ball"] and problem.obstacles[1].radius == 0.2
    assert problem.preset.name == "mine"
    with pytest.raises(ProblemError, match=r"study.toml: obstacles: 'seen.npy': no file inside"):
        study(ARM + f"{seen}{VARY}")
