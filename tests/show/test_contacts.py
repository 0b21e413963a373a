"""The page of a refused pose, and the line between the nearest points."""

import pickle

import numpy as np
import pytest

import armdyn as ad
from armdyn.show.page.facts import Facts
from armdyn.show.page.scene import mark_of, scene_data
from armdyn.show.replay import contacts_report, write_contacts
from armdyn.show.visuals import robot_shapes
from problems import paper_arm
from show.browser import open_page

WALL = ad.Plane((0.45, 0, 0), (-1, 0, 0), name="wall")


def refused():
    """RR's payload and its second link reach into a wall at the goal."""
    with pytest.raises(ad.ContactError, match=r"at the goal, 'payload' is .* inside 'wall', and 1 more") as caught:
        ad.MinimumTimeProblem(paper_arm("rr"), q_start=[-1.5, 0.0], q_goal=[0.2, 0.0], obstacles=[WALL])
    return caught.value


def test_the_error_says_where_and_what():
    error = pickle.loads(pickle.dumps(refused()))
    assert [(one.body, one.other) for one in error.contacts] == [("payload", "wall"), ("link2", "wall")]
    first = error.contacts[0]
    gap = np.subtract(*first.points)
    assert np.linalg.norm(gap) == pytest.approx(-first.distance, abs=1e-9)
    np.testing.assert_allclose(error.q, [0.2, 0.0])


@pytest.mark.slow
def test_touching_bodies_are_red_and_named(chromium, tmp_path):
    error = refused()
    report = contacts_report(error)
    assert report.verdict.level == "bad" and "'link2' is" in report.verdict.said
    assert len(report.verdict.checks) == 2
    page = write_contacts(error, tmp_path / "contacts.html")
    with open_page(chromium, page) as (_, requests, errors):
        assert not errors and all(url.startswith("file:") for url in requests)


def test_marks_and_colours_of_a_scene():
    robot = ad.Robot.from_spec(
        ad.ArmSpec.paper("rr"), payload=ad.Payload(mass=0.1, shapes=[ad.Box((0.1, 0.1, 0.1), (0, 0, 0))], name="crate")
    )
    assert {"link1", "crate"} <= {shape.name for shape in robot_shapes(robot)}
    motion = ad.ramp(robot, [0.0, 0.0], [1.0, 0.5], 1.0)
    plain, red = (scene_data(robot, [motion], touching=names)["commands"] for names in ((), ("crate",)))
    assert sum(a != b for a, b in zip(plain, red, strict=True)) == 1
    near = {"distance": 0.0051, "time": 0.3, "points": [[0, 0, 1], [0, 0, 1.0051]]}
    assert mark_of(Facts(near)) == {"time": 0.3, "points": near["points"], "label": "5.1 mm"}
    assert mark_of(Facts(near), always=True)["time"] is None
    for wrong in (
        {},
        near | {"points": [[0, 0]]},
        near | {"points": "ab"},
        near | {"points": [[0, 0, "x"], [0, 0, 1]]},
    ):
        assert mark_of(Facts(wrong)) is None
