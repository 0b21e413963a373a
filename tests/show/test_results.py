import json
import os

import pytest

import armdyn as ad
from armdyn.errors import ResultError
from armdyn.show.results import MAX_BYTES, load_result, save_result, source_name, write_run
from oracles import robot_named
from problems import paper_arm
from show.motions import HANGING, RAISED, quintic

FACTS = {"success": True, "duration": 0.25, "arcs": [1.0, None]}
ALWAYS = ["trajectory.npz", "result.json"]


@pytest.fixture
def path(tmp_path):
    return save_result(tmp_path / "result.json", robot_named("rr"), FACTS)


def test_round_trip(path):
    content = load_result(path)
    assert content["duration"] == 0.25 and content["arcs"] == [1.0, None]
    assert content["armdyn"] == ad.__version__
    assert content["model"]["hash"] == robot_named("rr").model_hash
    assert content["model"]["joints"] == ["joint1", "joint2"]
    assert content["units"]["torque"] == "N m or N"


def test_numbers_are_finite_and_names_free(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        save_result(tmp_path / "x.json", robot_named("rr"), {"duration": float("nan")})
    with pytest.raises(ValueError, match="must not be called units"):
        save_result(tmp_path / "x.json", robot_named("rr"), {"units": "none"})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"format": "armdyn-result-9"}, "not a result of format armdyn-result-1 but 'armdyn-result-9'"),
        ({"format": None}, "not a result of format"),
        ({"units": {"time": "ms"}}, "in units .*'ms'"),
        ({"units": None}, "in units None"),
        ({"model": {}}, "does not say of which model"),
        ({"model": "rr"}, "does not say of which model"),
    ],
)
def test_invalid_results_are_refused(path, changes, words):
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    with pytest.raises(ResultError, match=words) as caught:
        load_result(path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "not JSON"),
        (b"[1, 2]", "not a result of format"),
        (b'{"format": NaN}', "NaN is not finite"),
        (b"\xff\xfe\x00", "not JSON"),
        (b"[" * 100_000, "not JSON"),
        (b'{"duration": 1e400}', "1e400 is not finite"),
        (b'{"name": "\\ud800"}', "not JSON"),
        (b'"' + b"x" * MAX_BYTES, "larger than"),
    ],
)
def test_a_wrong_result_is_refused(path, data, words):
    path.write_bytes(data)
    with pytest.raises(ResultError, match=words):
        load_result(path)


def test_no_file(tmp_path):
    with pytest.raises(ResultError, match="no such file"):
        load_result(tmp_path / "x.json")
    with pytest.raises(ResultError, match="cannot be read"):
        load_result(tmp_path)
    os.mkfifo(tmp_path / "pipe.json")
    with pytest.raises(ResultError, match="it is a named pipe"):
        load_result(tmp_path / "pipe.json")


@pytest.mark.parametrize(
    ("source", "name"),
    [
        ("/home/me/env/share/example-robot-data/robots/ur_description/urdf/ur5_robot.urdf",
         "example-robot-data: ur_description/urdf/ur5_robot.urdf"),
        ("/home/me/env/armdyn/models/robots/urdf/cart_pole.urdf", "armdyn: cart_pole.urdf"),
        ("/home/me/arm.urdf", "arm.urdf"), ("~/arm.urdf", "arm.urdf"), ("../me/arm.urdf", "arm.urdf"),
        ("C:\\Users\\me\\arm.urdf", "arm.urdf"), ("arm.urdf", "arm.urdf"), ("arms/arm.urdf", "arms/arm.urdf"),
        ("ArmSpec 'rr'", "ArmSpec 'rr'"), ("Pinocchio model 'a/b'", "Pinocchio model 'a/b'"), ("", ""),
    ],
)  # fmt: skip
def test_a_source_is_shown_without_the_folders_of_a_machine(source, name):
    assert source_name(source) == name


def test_a_library_s_robot_says_its_package(tmp_path):
    path = save_result(tmp_path / "result.json", ad.Robot.from_library("cart_pole"), FACTS)
    assert load_result(path)["model"]["source"] == "armdyn: cart_pole.urdf"


@pytest.mark.usefixtures("unrendered")
@pytest.mark.parametrize(
    ("parts", "drawn", "messages"),
    [
        ((), [], []),
        (("figure",), ["figure.png", "figure.pdf"], ["drawing the figure"]),
        (("report",), ["report.html"], ["writing the report"]),
        (
            ("report", "figure"),
            ["figure.png", "figure.pdf", "report.html"],
            ["drawing the figure", "writing the report"],
        ),
    ],
)
def test_requested_files_are_written_reported_and_listed(parts, drawn, messages, tmp_path):
    robot, heard = paper_arm("r"), []
    motion = quintic(robot, HANGING["r"], RAISED["r"], 0.5)
    files = write_run(
        tmp_path, robot, {"trajectory": motion}, {"success": True}, "title", parts=parts, progress=heard.append
    )
    assert [file.name for file in files] == [ALWAYS[0], *drawn, ALWAYS[1]]
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted([*ALWAYS, *drawn])
    assert json.loads((tmp_path / "result.json").read_text())["files"] == [file.name for file in files]
    assert heard == messages


def test_ctrl_c_while_figures_are_drawn_leaves_the_result_of_the_motion(tmp_path):
    def interrupted(step):
        raise KeyboardInterrupt

    robot = paper_arm("r")
    motion = quintic(robot, HANGING["r"], RAISED["r"], 0.5)
    with pytest.raises(KeyboardInterrupt):
        write_run(tmp_path, robot, {"trajectory": motion}, {"success": True}, "title", progress=interrupted)
    assert json.loads((tmp_path / "result.json").read_text())["files"] == ALWAYS
