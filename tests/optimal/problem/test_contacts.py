"""Names of obstacles, and pairs of names that may touch."""

import pytest

import armdyn as ad
from armdyn.cli.options.course import PathConstraintOptions, obstacles_of
from armdyn.errors import ProblemError
from problems import paper_arm


def posed(**asked):
    return ad.MinimumTimeProblem(paper_arm("rr"), q_start=[-1.5, 0.0], q_goal=[0.2, 0.0], **asked)


def test_obstacles_of_one_name_are_numbered():
    balls = [ad.Sphere((1, 0, z), 0.1, name=name) for z, name in enumerate(["ball", "ball", "ball 2", "ball", "post"])]
    assert [one.name for one in posed(obstacles=balls).obstacles] == ["ball", "ball 3", "ball 2", "ball 4", "post"]


def test_a_contact_is_of_names_that_there_are(tmp_path):
    wall = ad.Plane((0.45, 0, 0), (-1, 0, 0), name="wall")  # the payload at the tip touches it at the goal
    with pytest.raises(ProblemError, match=r"is 4.* mm inside 'wall'"):
        posed(obstacles=[wall])
    allowed = [("payload", "wall"), ("wall", "link2")]
    problem = posed(obstacles=[wall], allowed_contacts=allowed)
    assert set(problem.collision_model().pairs) == {("link1", "wall")}
    (tmp_path / "problem.toml").write_text(problem.to_toml())
    again = ad.read_problem(tmp_path / "problem.toml")
    assert again.allowed_contacts == tuple(allowed) and again.obstacles == (wall,)
    with pytest.raises(ProblemError, match=r"allowed_contacts\[1\].*'wal'; did you mean 'wall'"):
        posed(obstacles=[wall], allowed_contacts=[("payload", "wall"), ("link2", "wal")])
    with pytest.raises(ProblemError, match="two names"):
        posed(obstacles=[wall], allowed_contacts=["payload"])


def test_on_the_command_line():
    options = PathConstraintOptions(obstacle=["plane:-1,0,0@0.45,0,0"], allow_contact=["payload, plane"])
    given = options.problem_arguments(paper_arm("rr"))
    assert given["obstacles"] == (ad.Plane((0.45, 0, 0), (-1, 0, 0)),)
    assert given["allowed_contacts"] == [("payload", "plane")]
    assert obstacles_of(["cylinder:0.1@0,0,0;0,0,1"]) == (ad.Cylinder((0, 0, 0), (0, 0, 1), 0.1),)
