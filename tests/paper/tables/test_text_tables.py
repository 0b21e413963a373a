"""Tables of texts and values."""

import csv
import io

import numpy as np

from armdyn.paper.tables.text_tables import Grid, csv_text, write_grid

GRID = Grid("Torque_1 [N m]", ("M [g]", "√|r| ✓"), (("21.2", "3 %"), ("500", "–")), note="± π")


def test_markdown_has_as_many_cells_in_every_line():
    lines = [line.replace("\\|", "") for line in GRID.markdown().splitlines() if line.startswith("|")]
    assert len(lines) == 4 and {line.count("|") for line in lines} == {3}
    assert "**Torque_1 [N m]**" in GRID.markdown() and GRID.markdown().endswith("± π\n")


def test_latex_needs_no_package():
    latex = GRID.latex()
    assert latex.isascii() and r"Torque\_1" in latex and r"3 \%" in latex and latex.count(r"\\") == 3
    assert "smallskip" not in Grid("", ("a",), ()).latex()


def test_csv_is_exact_and_leaves_missing_numbers_empty():
    lines = [("a", "b"), (0.1 + 0.2, None), (np.float64(4.2), 'x, "y"')]
    assert list(csv.reader(io.StringIO(csv_text(lines)))) == [
        ["a", "b"], ["0.30000000000000004", ""], ["4.2", 'x, "y"'],
    ]  # fmt: skip


def test_files(tmp_path):
    assert [path.name for path in write_grid(tmp_path, "grid", GRID)] == ["grid.md", "grid.tex"]
    assert (tmp_path / "grid.md").read_text() == GRID.markdown()
