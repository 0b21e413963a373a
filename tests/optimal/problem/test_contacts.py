"""Names of obstacles, and pairs of names that may touch."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.cli.options.path_constraints import PathConstraintOptions, obstacles_of
from armdyn.errors import ProblemError
from armdyn.optimal.constraints.clearance import ClearanceConstraint
from problems import paper_arm


def posed(**options):
    return ad.MinimumTimeProblem(paper_arm("rr"), q_start=[-1.5, 0.0], q_goal=[0.2, 0.0], **options)


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


def test_a_box_leaves_its_table_and_does_not_dig_in():
    # The arm stretched out above a table: a box under its end stands on it where both joints are at 0.
    box = ad.Box((0.04, 0.04, 0.1), (0, 0, -0.05))
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), payload=ad.Payload(mass=0.1, shapes=[box]))
    options = {"obstacles": [ad.Plane((0, 0, -0.1), name="table")], "q_start": [0.0, 0.0], "q_goal": [0.3, 0.2]}
    with pytest.raises(ProblemError, match="at the start, 'payload' touches 'table'; clearance is 5 mm"):
        ad.MinimumTimeProblem(robot, **options)
    problem = ad.MinimumTimeProblem(robot, **options, end_contacts=[("table", "payload")])
    up = ad.ramp(robot, problem.q_start, problem.q_goal, 1.0)
    report = ClearanceConstraint().check(problem, up, np.empty(0))
    assert report.reasons == () and report.said.endswith("; the clearance is proven at all times")
    down = ad.ramp(robot, [0.0, 0.0], [-0.01, 0.0], 1.0)  # the box digs in, 5 mm at the end
    report = ClearanceConstraint().check(problem, down, np.empty(0))
    assert "proven" not in report.said
    assert "inside 'table'" in report.reasons[0]
    model, least = problem.collision_model(), -problem.clearance
    assert model.is_free([0.0, 0.0], least) and not model.is_free([-0.1, 0.0], least)
    free = ad.MinimumTimeProblem(robot, **options, allowed_contacts=[("table", "payload")]).without_obstacles()
    assert not (free.obstacles or free.allowed_contacts)
    with pytest.raises(ProblemError, match=r"end_contacts\[0\].*did you mean 'table'"):
        ad.MinimumTimeProblem(robot, **options, end_contacts=[("payload", "tabl")])


def test_end_contacts_in_files_and_on_the_command_line(tmp_path):
    pairs = [("payload", "wall"), ("link2", "wall")]
    with pytest.raises(ProblemError, match=r"is 45.* mm inside 'wall'.*end_contacts may overlap by 10 mm at most"):
        posed(obstacles=[ad.Plane((0.45, 0, 0), (-1, 0, 0), name="wall")], end_contacts=pairs)
    wall = ad.Plane((0.49, 0, 0), (-1, 0, 0), name="wall")  # the payload at the tip touches it at the goal
    problem = posed(obstacles=[wall], end_contacts=pairs)
    (tmp_path / "problem.toml").write_text(problem.to_toml())
    assert ad.read_problem(tmp_path / "problem.toml").end_contacts == problem.end_contacts
    given = PathConstraintOptions(end_contact=["payload, plane"]).problem_arguments(paper_arm("rr"))
    assert given["end_contacts"] == [("payload", "plane")]
