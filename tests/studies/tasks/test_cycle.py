"""Study task "cycle": numbers of a cycle file vary."""

import json

import pytest

import armdyn as ad
from armdyn.errors import ArmdynError, ProblemError
from armdyn.studies.reading import read_study
from armdyn.studies.settings import label
from cycles import BOLT

STUDY = """
task = "cycle"
[cycle]
file = "cell.toml"
seed = 3
bound_programs = 40
[vary]
parts.bolt.mass = [0.1, 90.0]
steps."to the hole".to.0 = [0.8, 1.0]
"""


@pytest.fixture
def study(tmp_path):
    def write(text=STUDY):
        (tmp_path / "cell.toml").write_text(BOLT)
        (tmp_path / "study.toml").write_text(text)
        return read_study(tmp_path / "study.toml")

    return write


@pytest.mark.slow
def test_rows_are_the_cycles_of_the_file_with_its_numbers_changed(study, tmp_path):
    request = study()
    assert request.task.options.seed == 3 and request.task.options.search == "quick"
    assert request.task.options.bound_programs == 40
    run = ad.run_study(request, tmp_path / "rows.sqlite")
    rows = ad.study_table(run.file)
    assert [row["status"] for row in rows] == ["usable", "usable", "refused", "refused"]
    assert "step 2 (grasp bolt): the arm cannot rest with 'bolt' of 90 kg" in rows[2]["message"]
    own = ad.solve_cycle(ad.read_cycle(tmp_path / "cell.toml"), ad.MinimumTimeOptions(search="quick", seed=3))
    assert rows[1]["duration_s"] == pytest.approx(own.duration, rel=1e-9)
    assert rows[1]["step_1_s"] + rows[1]["step_3_s"] + 0.2 == pytest.approx(rows[1]["duration_s"])
    assert rows[0]["duration_s"] != rows[1]["duration_s"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("parts.bolt.mass", "parts.nut.mass"), r"line 8: .*parts.nut is not there to be changed"),
        (("parts.bolt.mass", "payload.mass"), "its way begins with robot, cycle, parts, steps"),
        (('"to the hole"', '"to the hoel"'), r"did you mean 'to the hole'"),
        (('"to the hole"', "9"), r"steps has no '9'"),
        (("to.0 = [0.8, 1.0]", 'too = ["zero"]'), "line 9: .*a move has no 'too'; did you mean 'to'"),
        (("to.0 = [0.8, 1.0]", 'to = ["zero", "zreo"]'), "line 9: .*to.* is 'zreo'.*did you mean 'zero'"),
        (
            ('steps."to the hole".to.0 = [0.8, 1.0]', 'steps.1.grasp = ["bolt", "blot"]'),
            "line 9: .*did you mean 'bolt'",
        ),
        (("cell.toml", "../cell.toml"), "line 4: .*is outside the folder"),
        (("file =", "fiel ="), "did you mean 'file'"),
        (("[vary]", "[arms.rr]\n[vary]"), "no table 'arms'"),
    ],
)
def test_faults_are_named_with_its_line(study, change, said):
    with pytest.raises(ArmdynError, match=said):
        study(STUDY.replace(*change))


def test_a_move_s_end_is_no_range(study):
    request = study(STUDY.replace("[0.8, 1.0]", "{ from = 0.8, to = 1.0, count = 3 }"))
    assert [request.parameters(k)["steps.to the hole.to.0"] for k in range(3)] == [0.8, 0.9, 1.0]
    with pytest.raises(ProblemError, match=r"from = A, to = B"):
        study(STUDY.replace("parts.bolt.mass = [0.1, 90.0]", "parts.bolt.mass = { to = 1 }"))


def test_axes_have_units():
    assert label("parts.bolt.mass") == "parts.bolt.mass [kg]"
    assert label("steps.pick.to.position.0") == "steps.pick.to.position.0 [m]"


def test_the_scene_is_a_part_of_the_study(study, tmp_path):
    scene = tmp_path / "scene.json"
    found = []
    for radius in (0.05, 0.06):
        scene.write_text(json.dumps([{"type": "sphere", "name": "ball", "center": [2, 0, 0], "radius": radius}]))
        text = BOLT.replace("start = [0.1, 0.2]", 'start = [0.1, 0.2]\nscene = "scene.json"')
        (tmp_path / "cell.toml").write_text(text)
        (tmp_path / "study.toml").write_text(STUDY)
        found.append(read_study(tmp_path / "study.toml"))
    scene.unlink()  # workers need none
    assert [one.description()["task"]["cycle"]["cycle"]["obstacles"][0]["radius"] for one in found] == [0.05, 0.06]
    assert found[1].task.checked("cycle.obstacles.ball.radius", 0.1) == 0.1
