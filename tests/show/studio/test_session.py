"""A session without its page, with a real solver."""

import json
import time

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import FileError, ProblemError
from armdyn.models.scene.reaching import frame_placement
from armdyn.show.studio.session import Session, SessionSetup, restored
from armdyn.show.studio.state import StudioState
from armdyn.show.studio.words import answer_html, warnings_of
from problems import paper_problem

QUICK = ad.MinimumTimeOptions(search="quick")


def setup_of(arm="rr", **arguments):
    return SessionSetup.of(paper_problem(arm, **arguments), QUICK)


def session_of(setup, folder):
    return Session(setup, folder, StudioState.of(setup.problem, 1e-3))


def settle(session, seconds=120.0):
    """Frames until the motion of the state is there."""
    end = time.monotonic() + seconds
    while not session.current:
        assert time.monotonic() < end, "no motion came"
        session.tick()
        time.sleep(0.01)


def test_the_motion_of_the_newest_state_is_that_of_a_plain_solve(tmp_path):
    setup = setup_of()
    with session_of(setup, tmp_path) as session:
        settle(session)
        assert session.solution.duration == pytest.approx(
            ad.solve_minimum_time(setup.problem, QUICK).duration, rel=1e-9
        )
        session.change(goal=(0.5, 0.2))
        session.change(goal=(0.4, -0.3), payload=0.2)
        assert "computing" in answer_html(session)
        settle(session)
        arm = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), payload=ad.Payload(mass=0.2))
        plain = ad.MinimumTimeProblem(arm, q_start=setup.problem.q_start, q_goal=[0.4, -0.3])
        assert session.solution.duration == pytest.approx(ad.solve_minimum_time(plain, QUICK).duration, rel=1e-9)
        assert f"{session.solution.duration:.4f} s" in answer_html(session)


def test_files_are_read_again(tmp_path):
    with session_of(setup_of(), tmp_path) as session:
        with pytest.raises(ProblemError, match="no motion yet"):
            session.save_motion()
        session.change(goal=(0.3, 0.1), reserve=0.1, obstacles=(ad.Sphere((0.34, 0, -0.12), 0.02),))
        settle(session)
        again = ad.read_problem(session.save_problem())
        np.testing.assert_allclose(again.q_goal, [0.3, 0.1])
        assert again.obstacles == session.state.obstacles
        np.testing.assert_array_equal(again.reserves.effort, [0.1, 0.1])
        motion = ad.Trajectory.load(session.save_motion())
        assert motion.duration == session.solution.duration
        assert motion.model_hash == again.robot.model_hash
        assert f"{motion.duration:.4f} s" in session.save_report().read_text()


def test_dragging_brings_the_tip_where_it_is_dragged(tmp_path):
    setup = SessionSetup.of(
        ad.MinimumTimeProblem(
            ad.Robot.from_library("panda"), q_start="ready", q_goal=[1, 0.2, 0.5, -1.5, 0.3, 2, -0.5]
        ),
        QUICK,
    )
    session = session_of(setup, tmp_path)
    to = session.pose_of("goal") * pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, -0.1), np.array([0.03, -0.05, 0.02]))
    session.drag("goal", to)
    there = frame_placement(session.robot, session.robot.tip, np.array(session.state.goal))
    assert np.linalg.norm(pin.log6(there.actInv(to)).vector) < 1e-8  # as `reaching.REACHED`, with room
    assert not session.warnings
    limits = setup.problem.limits
    for x in (0.5, 5.0):  # beyond the arm's reach
        far = pin.SE3(to.rotation, to.translation + np.array([x, 0, 0]))
        session.drag("goal", far)
        q = np.array(session.state.goal)
        assert np.all((limits.position_lower <= q) & (q <= limits.position_upper))
    assert any("out of reach" in one for one in warnings_of(session))


def test_a_planar_arm_follows_a_position(tmp_path):
    session = session_of(setup_of(), tmp_path)
    to = session.pose_of("goal")
    session.drag("goal", pin.SE3(np.eye(3), to.translation + np.array([-0.05, 0, 0.02])))
    np.testing.assert_allclose(session.pose_of("goal").translation - to.translation, [-0.05, 0, 0.02], atol=1e-8)


@pytest.mark.slow
def test_faults_are_named_in_words(tmp_path):
    setup = setup_of(position_limit=(-2.0, 2.0))
    with session_of(setup, tmp_path) as session:
        settle(session)
        tip = session.pose_of("goal").translation
        session.change(obstacles=(ad.Sphere(tip, 0.05, name="ball"),))
        assert session.touching == {"goal"}
        assert any("At the goal" in one and "ball" in one for one in warnings_of(session))
        assert session.problem is None
        with pytest.raises(ProblemError, match="no problem"):
            session.save_problem()
        assert session.solution is not None  # the last one stays in sight
        assert "of an earlier state" in answer_html(session)
        session.change(obstacles=(), goal=(9.0, 0.0))
        assert session.state.goal == (2.0, 0.0)  # a slider's end
        session.change(payload=50.0)
        assert any("hold the goal" in one for one in warnings_of(session))
        with pytest.raises(ProblemError):
            session.change(reserve=2.0)
        assert session.state.reserve == 0.0


def test_names_of_a_stranger_are_no_markup(tmp_path):
    session = session_of(setup_of(), tmp_path)
    tip = session.pose_of("goal").translation
    session.change(obstacles=(ad.Sphere(tip, 0.05, name="<img src=x onerror=alert(1)>"),))
    assert "&lt;img" in answer_html(session)
    assert "<img" not in answer_html(session)


@pytest.mark.slow
def test_the_state_is_taken_up_again(tmp_path):
    setup = setup_of()
    assert restored(setup, tmp_path) is None
    with session_of(setup, tmp_path) as session:
        session.change(goal=(0.3, 0.1), obstacles=(ad.Box((0.1, 0.1, 0.1), (1, 1, 1)),))
        end = time.monotonic() + 10
        while not (tmp_path / "studio.json").exists():  # saved while it runs: it may be killed
            assert time.monotonic() < end
            session.tick()
            time.sleep(0.01)
        assert restored(setup, tmp_path) == session.state
        session.change(payload=0.3)
        last = session.state
    assert restored(setup, tmp_path) == last
    with pytest.raises(FileError, match="another robot"):
        restored(setup_of("rrr"), tmp_path)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "armdyn-studio-1"}', "x" * 2**21, '{"format": NaN}'])
def test_a_file_that_is_none_of_a_session_is_refused(tmp_path, text):
    (tmp_path / "studio.json").write_text(text)
    with pytest.raises(FileError):
        restored(setup_of(), tmp_path)


def test_positions_beyond_other_limits_are_clipped(tmp_path):
    with session_of(setup_of(), tmp_path) as session:
        session.change(goal=(1.5, 0.1))
    content = json.loads((tmp_path / "studio.json").read_text())
    content["state"]["goal"] = [1e3, 0.1]
    (tmp_path / "studio.json").write_text(json.dumps(content))
    state = restored(setup_of(), tmp_path)
    assert state.goal[0] <= 2 * np.pi


def test_a_payload_keeps_its_place_through_zero(tmp_path):
    arm = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), payload=ad.Payload(mass=0.1, com=(0.01, 0, 0), frame="link1"))
    problem = ad.MinimumTimeProblem(arm, q_start=[-1.5, 0], q_goal=[0.1, 0])
    session = session_of(SessionSetup.of(problem, QUICK), tmp_path)
    session.change(payload=0.0)
    assert session.robot.payload is None
    session.change(payload=0.3)
    assert (session.robot.payload.mass, session.robot.payload.frame) == (0.3, "link1")
    again = Session(session.setup, tmp_path, session.state)  # a session that takes up this state
    assert again.robot.payload == session.robot.payload


def test_a_folder_that_cannot_be_written_is_no_end(tmp_path):
    (tmp_path / "file").write_text("")
    with session_of(setup_of(), tmp_path / "file") as session:
        session.change(goal=(0.3, 0.1))
        session.tick()
        assert any("not saved" in one for one in warnings_of(session))
