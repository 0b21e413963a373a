"""What docs/extending.md shows works as it stands there."""

import re
from pathlib import Path

import pytest

import armdyn as ad
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
