import json

import pytest

from armdyn.show.report import write_run
from problems import paper_arm
from show.motions import HANGING, RAISED, quintic

ALWAYS = ["trajectory.npz", "result.json"]


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
