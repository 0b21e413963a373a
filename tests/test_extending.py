"""What docs/extending.md shows works as it stands there."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.optimal.solve.registry import SOLVERS
from armdyn.studies.tasks.registry import TASKS

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


@pytest.fixture
def bound_task():
    """The class of the docs, for the time of a test."""
    yield shown("A study task")["BoundTask"]
    del TASKS["bound"]


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
def solver():
    """The section about a solver, its registration taken back afterwards."""
    yield shown("A solver")
    del SOLVERS["slsqp"]


def test_a_solver(solver):
    assert solver["one"].usable and solver["other"].usable
    # IPOPT relaxes bounds by 1e-8 of them, SLSQP does not.
    assert solver["other"].trajectory.duration == pytest.approx(solver["one"].trajectory.duration, rel=1e-6)
