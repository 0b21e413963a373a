"""A path constraint of one's own, after docs/obstacles.md; the registry."""

import re
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.constraints.constraint import ConstraintReport, PathConstraint
from armdyn.optimal.constraints.registry import options, path_constraint_from, path_constraints_of
from armdyn.optimal.constraints.rows import StageRows
from armdyn.optimal.problem.planning_limits import PathConstraintSpec
from problems import POSES, paper_arm, solve

START, GOAL = POSES["rr"]
GUIDE = Path(__file__).parents[3] / "docs" / "obstacles.md"


def rr(*path_constraints, **keywords):
    return ad.MinimumTimeProblem(
        paper_arm("rr"), q_start=START, q_goal=GOAL, path_constraints=path_constraints, **keywords
    )


@pytest.mark.slow
def test_the_guide_s_example_works():
    (code,) = re.findall(r"```python\n(   @dataclass.*?)```", GUIDE.read_text(), re.DOTALL)
    room = {each.__name__: each for each in (dataclass, PathConstraint, ConstraintReport, StageRows)} | {
        "np": np,
        "ca": ca,
    }
    exec(re.sub(r"^   ", "", code, flags=re.MULTILINE), room)
    limited = solve(rr(room["PowerLimit"](20.0)), starts=2)
    motion = limited.trajectory
    # The mesh keeps it at its stages; the example's own tolerance between them is 1 %.
    assert np.max(np.abs(motion.tau * motion.v)) == pytest.approx(20.0, rel=0.01)
    assert limited.duration > solve(rr(), starts=2).duration
    assert "power limits" in limited.problem.path_constraint_names


def test_every_constraint_is_found_once():
    ball = ad.Sphere((1.0, 0, 1.0), 0.05)
    two = [ad.FrameSpeedLimit(2.0), ad.FrameSpeedLimit(1.0, "link2")]
    problem = rr(*two, obstacles=[ball], via=[[-0.7, 0.8]], acceleration_limit=100, jerk_limit=1e4)
    names = [condition.name for condition in path_constraints_of(problem)]
    assert names == ["clearance", "via points", "acceleration limits", "jerk limits", *["frame speed limits"] * 2]
    keywords = ("obstacles", *dict.fromkeys(names[1:]))
    assert problem.path_constraint_names == keywords and problem.continuous_torque


def test_names_of_the_command_line():
    assert set(options()) >= {"tip-speed", "torque-rate"}
    assert path_constraint_from("tip-speed=0.5") == ad.FrameSpeedLimit(0.5)
    assert all(kind.help and kind.metavar for kind in options().values())
    assert isinstance(ad.TorqueRateLimit(1.0), PathConstraintSpec)
    with pytest.raises(ProblemError, match="did you mean 'torque-rate'"):
        path_constraint_from("torque_rate=1")
    with pytest.raises(ProblemError, match="known: tip-speed"):
        path_constraint_from("x=1")


def test_a_constraint_without_rows_and_check_is_refused():
    class Named(PathConstraintSpec):
        name = "names"

    with pytest.raises(ProblemError, match="no rows and no check"):
        path_constraints_of(rr(Named()))
