"""The code of docs/extending.md works as it stands there."""

import ast
import json
import re
from dataclasses import replace
from pathlib import Path

import casadi as ca
import coal
import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.cli.options.path_constraints import obstacles_of
from armdyn.control.laws.readings import table
from armdyn.control.laws.registry import CONTROLLERS
from armdyn.dynamics.symbolic import Dynamics
from armdyn.errors import ProblemError, TrajectoryError
from armdyn.models.scene.collision import collision_model
from armdyn.models.scene.obstacles import SHAPES, obstacle_entry
from armdyn.optimal.constraints.rate_limits import FrameSpeedLimit
from armdyn.optimal.constraints.registry import TightenedConstraints, path_constraints_of
from armdyn.optimal.mesh.assembly import CollocationInterval
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.task import Task
from armdyn.show.visuals import obstacle_shapes
from armdyn.studies.tasks.registry import TASKS
from armdyn.studies.tasks.task import result_of
from armdyn.trajectory.formats import FORMATS, register
from cli.command import answer, run_here
from problems import paper_arm

DOCS = (Path(__file__).parents[1] / "docs" / "extending.md").read_text()


def section(name):
    """The text of a section."""
    return re.search(rf"(?ms)^## {name}\n(.*?)(?=^## |\Z)", DOCS)[1]


def shown(name):
    """The names that the Python of a section defines."""
    made = {"__name__": "extending"}
    for block in re.findall(r"```python\n(.*?)```", section(name), re.S):
        exec(block, made)
    return made


def test_the_python_of_every_section_is_run():
    """By the tests below, each on its own: classes registered by a section are not there for other tests."""
    with_code = [name for name in re.findall("(?m)^## (.*)", DOCS) if "```python" in section(name)]
    assert with_code == re.findall(r'[=d] shown\("(.*)"\)', Path(__file__).read_text())
    assert sum(section(name).count("```python") for name in with_code) == DOCS.count("```python")


def test_the_first_code_of_every_section_fits_into_the_package():
    """It imports no registry, which imports it."""
    registries = (
        r"^(?:from|import) (armdyn|\S*\.registry|armdyn\.trajectory\.formats|armdyn\.models\.scene\.obstacles)\b(?!\.)"
    )
    for name in re.findall("(?m)^## (.*)", DOCS):
        first = re.search(r"```python\n(.*?)```", section(name), re.S)[1]
        assert not re.findall(registries, first, re.M), name
        ast.parse(first)


@pytest.fixture
def bound_task():
    """The class of the docs, for the time of a test."""
    yield shown("A study task")["BoundTask"]
    del TASKS["bound"]


@pytest.mark.slow
def test_a_study_task(bound_task, tmp_path):
    (tmp_path / "study.toml").write_text(re.search(r"```toml\n(.*?)```", section("A study task"), re.S)[1])
    study = ad.read_study(tmp_path / "study.toml")
    assert isinstance(study.task, bound_task)
    run = ad.run_study(study, tmp_path / "rows.sqlite")
    rows = ad.study_table(run.file)
    assert run.counts == {"done": 6} and all(row["good"] for row in rows)
    for row, k in zip(rows, range(6), strict=True):
        alone = ad.lower_bound(study.task.problems.problem(study.parameters(k)))
        assert row["lower_bound_s"] == alone.duration and row["joint"] == alone.joint
    assert rows[0]["velocity_limit"] == 4 and rows[1]["via"] == "[[-0.5, 0.3]]"
    # The same again does nothing; another task for the same rows is refused.
    assert ad.run_study(study, run.file).done_here == 0
    (tmp_path / "study.toml").write_text((tmp_path / "study.toml").read_text().replace("least = 0.1", "least = 0.2"))
    with pytest.raises(ad.ArmdynError, match=r"task\.least is 0.1 there and 0.2 here"):
        ad.run_study(ad.read_study(tmp_path / "study.toml"), run.file)


@pytest.mark.slow
def test_a_path_constraint():
    made = shown("A path constraint")
    limited, problem, robot = made["limited"], made["problem"], made["robot"]
    free = ad.solve_minimum_time(problem.variant(path_constraints=()))
    assert limited.usable and limited.duration > 1.05 * free.duration
    # By nothing of armdyn's but its trajectory: second differences of the tip's position.
    model, data = robot.model, robot.model.createData()
    number, t = model.getFrameId(robot.tip), np.linspace(0.01, limited.duration - 0.01, 200)

    def tip(times):
        places = []
        for q in limited.trajectory(times).q:
            pin.framesForwardKinematics(model, data, q)
            places.append(data.oMf[number].translation.copy())
        return np.array(places)

    h = 1e-3
    sizes = np.linalg.norm(tip(t + h) - 2 * tip(t) + tip(t - h), axis=1) / h**2
    assert 4.5 < np.max(sizes) < 5.01  # over h the torque may jump


@pytest.fixture
def controller():
    """The section about a controller, its registration taken back afterwards."""
    yield shown("A controller")
    del CONTROLLERS["sliding-mode"]


def test_a_controller(controller, tmp_path):
    sliding, run = controller["SlidingMode"](), controller["run"]
    assert run.settled and run.peak_error < 0.01  # with an unknown payload
    robot, motion = paper_arm("rr", 0.1006), controller["motion"]
    exact = ad.track(robot, motion, sliding)
    assert exact.settled and exact.peak_error < 2e-3
    assert ad.sampled_stability(robot, [0.2, 0.0], sliding, ad.Loop()).stable
    bare = ("--no-report", "--no-figure", "--json", "--out", tmp_path)
    output = answer(
        run_here("track", "rr", "--ramp", "0.6", "--controller", "sliding-mode", "--gains", "30,100,2", *bare)
    )
    assert output["success"]
    output = answer(run_here("track", "rr", "--ramp", "0.6", "--controller", "sliding-mode", "--gains", "30", *bare), 2)
    assert "--gains has 1 numbers; give three, SLOPE,GAIN,WIDTH" in output["message"]


@pytest.fixture
def output_format():
    """The section about an output format, its registration taken back afterwards."""
    yield shown("An output format")
    del FORMATS["jsonl"]


def test_an_output_format(output_format, tmp_path):
    motion = output_format["motion"]
    samples = motion.resample(125)
    lines = FORMATS["jsonl"]().text(samples).splitlines()
    assert len(lines) == samples.t.size
    assert json.loads(lines[1]) == {"t": samples.t[1]} | dict(zip(samples.joint_names, samples.q[1], strict=True))
    motion.save(tmp_path / "trajectory.npz")
    output = answer(run_here("export", "trajectory.npz", "--format", "jsonl", "--json", cwd=tmp_path))
    assert output["files"] == ["trajectory.jsonl"] and output["rate"] == 125
    assert (tmp_path / "trajectory.jsonl").read_text().splitlines() == lines
    with pytest.raises(TrajectoryError, match="no names"):
        FORMATS["jsonl"]().text(replace(motion, joint_names=()).resample(125))


@pytest.fixture
def wedge():
    """The class of the docs, for the time of a test."""
    yield shown("An obstacle shape")["Wedge"]
    del SHAPES["wedge"]


def test_an_obstacle_shape(wedge, tmp_path):
    turned = np.eye(4)
    turned[:3, :3], turned[:3, 3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]], [0.1, 0.2, 0.3]
    one = wedge(0.4, 0.2, 0.3, turned)
    placement, solid = one.solid()
    at = coal.Transform3s(placement[:3, :3], placement[:3, 3])
    normal = np.array([-0.3, 0, 0.4]) / 0.5  # of its ramp, 3 : 4 : 5
    for away in (0.01, 0.1, 0.3):
        point = turned[:3, :3] @ (np.array([0.2, 0, 0.15]) + away * normal) + turned[:3, 3]
        ball = coal.Sphere(1e-6), coal.Transform3s(np.eye(3), point)
        exact = coal.distance(*ball, solid, at, coal.DistanceRequest(), coal.DistanceResult())
        assert exact == pytest.approx(away, abs=1e-5)  # GJK stops at 1e-6, and the ball has a radius
    # It is kept clear of, drawn, written and read like the other shapes.
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    problem = ad.MinimumTimeProblem(robot, q_start=[-1.5, 0.0], q_goal=[0.2, 0.0], obstacles=[one])
    assert [constraint.name for constraint in path_constraints_of(problem)] == ["clearance"]
    (tmp_path / "problem.toml").write_text(problem.to_toml())
    (again,) = ad.read_problem(tmp_path / "problem.toml").obstacles
    assert np.allclose(again.placement, one.placement, atol=1e-14) and again.height == one.height
    assert len(obstacle_shapes([one])) == 1
    (output,) = obstacles_of(["wedge:0.4,0.2,0.1@0.3,0,-0.05"])
    assert output == wedge(0.4, 0.2, 0.1, [0.3, 0.0, -0.05])
    assert collision_model(robot, (output,), False).nearer([0.0, 0.0], np.inf)[0].distance < 0
    with pytest.raises(ProblemError, match="wedge:L,W,H@X,Y,Z"):
        obstacles_of(["wedge:0.1@0,0,0"])
    with pytest.raises(ProblemError, match="length of obstacle 'wedge' is 0"):
        wedge(0, 1, 1, [0, 0, 0])


def test_a_constraint_with_a_mistake_is_refused_with_its_class():
    class Wrong(FrameSpeedLimit):
        def check(self, problem, motion, passing):
            return None

    class Unnamed(FrameSpeedLimit):
        name = ""

    def of(limit):
        return ad.MinimumTimeProblem(paper_arm("r"), q_start=[-1.0], q_goal=[0.5], path_constraints=[limit])

    problem = of(Wrong(1.0))
    constraints = TightenedConstraints.of(Task.of(problem))
    with pytest.raises(ProblemError, match=r"result of Wrong\.check is None; it must be a ConstraintReport"):
        constraints.check(problem, spline(problem, []), np.empty(0))
    with pytest.raises(ProblemError, match="Unnamed has no name"):
        of(Unnamed(1.0))
    rows = replace(constraints.rows(problem)[0], expression=lambda *_: ca.SX(2, 3))
    with pytest.raises(ProblemError, match=r"rows of <lambda> have shape \(2, 3\)"):
        rows.functions(CollocationInterval(Dynamics(problem.robot, free_last_body=True), Task.of(problem).scheme))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda law: None, "law returned None; it must return a Law"),
        (lambda law: replace(law, rows=law.rows[:, :-1]), r"integral_gain are \[2, 2, 2, 2, \d+, 2, 2\]; they must be"),
        (lambda law: replace(law, integral_gain=np.zeros(1)), r"2, 1\]; they must be"),
    ],
)
def test_a_law_of_other_sizes_is_refused_with_these(change, words):
    class Wrong(ad.ComputedTorque):
        def law(self, robot, ticks, loop):
            return change(super().law(robot, ticks, loop))

    robot = paper_arm("rr")
    with pytest.raises(ProblemError, match=words):
        ad.track(robot, ad.ramp(robot, [0.0, 0.0], [0.1, 0.0], 0.1), Wrong())
    with pytest.raises(ProblemError, match=words):
        ad.sampled_stability(robot, [0.1, 0.0], Wrong(), ad.Loop())
    with pytest.raises(ProblemError, match=r"different numbers of rows: \{'q': 5, 'v': 6\}"):
        table({"q": np.zeros((5, 2)), "v": np.zeros((6, 2))})


def test_an_incomplete_format_is_refused():
    with pytest.raises(TrajectoryError, match="Wrong is no output format: it has no suffix, summary, text"):
        register(type("Wrong", (), {"name": "wrong"}))


@pytest.mark.parametrize("solid", [None, (np.zeros(3), coal.Sphere(0.1)), (np.eye(4), "box")])
def test_an_obstacle_with_a_mistake_is_refused_with_its_class(solid):
    class Wrong(ad.Sphere):
        def solid(self):
            return solid

    one = Wrong((0.3, 0.0, 0.0), 0.05)
    with pytest.raises(ProblemError, match=r"a solid of Wrong is .*; it must be a placement of shape \(4, 4\)"):
        collision_model(paper_arm("r"), (one,), False)
    with pytest.raises(ProblemError, match="Wrong has no name for files"):
        obstacle_entry(one)


def test_a_task_without_a_result_is_a_refused_case():
    class Wrong:
        def work(self, settings, guess, revisit=False):
            return None

    result, _ = result_of(Wrong(), {}, b"")
    assert result.status == "refused" and "result of work is None; it must be a CaseResult" in result.message
