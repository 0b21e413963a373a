"""The notebook runs from its first cell to its last, and is stored without outputs."""

from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).parents[2] / "examples" / "first_motion.ipynb"


@pytest.mark.slow
def test_the_notebook_runs(tmp_path):
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(NOTEBOOK, as_version=4)
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    printed = "".join(str(cell.get("outputs")) for cell in notebook.cells)
    assert "0.210671702 s, certified: True" in printed
    assert "all joints within 0.005 rad of the goal" in printed
    assert printed.count("image/png") == 2  # both figures are shown
    assert (tmp_path / "first_motion.html").stat().st_size > 100_000


def test_it_is_kept_without_outputs():
    import nbformat

    for cell in nbformat.read(NOTEBOOK, as_version=4).cells:
        assert not cell.get("outputs") and not cell.get("execution_count")
