"""Exit codes 0 usable, 3 not, 4 a requirement is not met: by real runs, and in the same words everywhere."""

from pathlib import Path

import pytest

from armdyn.cli.console import EXIT_CODES
from cli.command import answer, run_here, run_json

ROOT = Path(__file__).parents[2]
BARE = ("--no-figure", "--no-report")
SOLVE = ("mintime", "r", *BARE)


def here(*arguments, code, cwd):
    return answer(run_here(*arguments, "--json", cwd=cwd), code)


def test_a_usable_motion_is_exit_0_certified_or_not(tmp_path):
    output = run_json(*SOLVE, "--require", "certified", "--require", "extremal", cwd=tmp_path)
    assert output["usable"] and output["certified"] and output["extremal"] and output["missing"] == []
    output = here(*SOLVE, "--limit", "torque-rate=500", code=0, cwd=tmp_path)
    assert output["usable"] and not output["certified"] and output["what_to_do"]


def test_an_unmet_requirement_is_exit_4_and_named(tmp_path):
    output = run_json(*SOLVE, "--require", "gap:0.5%", "--require", "certified", code=4, cwd=tmp_path)
    assert output["success"] and output["usable"] and output["certified"]
    (missing,) = output["missing"]
    assert missing.startswith("gap:0.5% is missing: ")
    assert (tmp_path / "results" / "mintime-r" / "result.json").exists()  # the motion is written all the same
    done = run_here(*SOLVE, "--require", "gap:0.5%", cwd=tmp_path)
    assert done.returncode == 4 and "gap:0.5% is missing" in " ".join(done.stdout.split())
    assert "armdyn bound gives one" in " ".join(done.stdout.split()) and "`" not in done.stdout


def test_a_motion_that_is_not_usable_is_exit_3_with_any_requirement(tmp_path):
    for required in ([], ["--require", "certified"]):
        output = here("mintime", "rr", *BARE, "--time-limit", 0.001, *required, code=3, cwd=tmp_path)
        assert not output["usable"] and not output["success"] and output["what_to_do"]
        assert len(output["missing"]) == len(required) // 2


@pytest.mark.parametrize("command", ["mintime", "sweep"])
@pytest.mark.parametrize("wrong", ["optimal", "gap", "gap:5", "gap:much"])
def test_a_requirement_that_is_none_is_exit_2_before_anything_is_solved(command, wrong, tmp_path):
    output = here(command, "rr", "--require", wrong, code=2, cwd=tmp_path)
    assert "--require" in output["message"]
    assert not list(tmp_path.iterdir())


def test_a_sweep_requires_it_of_every_payload(tmp_path):
    sweep = ("sweep", "r", "--payload", "0,0.1", "--no-figure")
    output = here(*sweep, "--require", "certified", code=0, cwd=tmp_path)
    assert output["missing"] == [] and all(row["usable"] and row["certified"] for row in output["rows"])
    output = here(*sweep, "--require", "gap:1%", code=4, cwd=tmp_path)
    assert output["success"] and [text.split(":")[0] for text in output["missing"]] == ["0 g", "100 g"]
    done = run_here(*sweep, "--require", "gap:1%", cwd=tmp_path)
    assert done.returncode == 4 and "required: 0 g: gap:1% is missing" in " ".join(done.stderr.split())


def test_help_and_readme_say_it_in_the_same_words():
    assert EXIT_CODES in " ".join((ROOT / "docs" / "command_line.md").read_text().split())
    assert EXIT_CODES in " ".join(run_here("--help").stdout.replace("│", " ").split())
