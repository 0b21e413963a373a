import pytest

from armdyn.paper.printed.examples import PAYLOADS
from armdyn.paper.tables.grids import feasibility_grid, first_approach_grid, grid
from armdyn.paper.tables.rows import table_3, time_row


@pytest.mark.slow
def test_layout_is_the_papers_with_our_columns(r_loops):
    one = grid([time_row(o) for o in r_loops])
    assert one.header == ("M [g]", "Example 4 published", "PID, tip", "PID, mM")
    assert [line[0] for line in one.body] == [f"{1000 * m:g}" for m in PAYLOADS]
    assert one.body[3][1] == "4.3170" and one.body[3][3].endswith("✓")
    markdown = one.markdown()
    assert len({line.count("|") for line in markdown.splitlines() if line.startswith("|")}) == 1
    third = [line for line in grid(table_3()).markdown().splitlines() if line.startswith("|")]
    assert {line.replace("\\|", "").count("|") for line in third} == {12}
    latex = one.latex()
    assert latex.count(r"\\") == 11 and latex.isascii()


def test_findings_in_the_papers_layout():
    held = feasibility_grid()
    assert held.body[-1][1:] == ("1085.6 g", "1370.7 g", "466.0 g", "574.3 g", "237.1 g", "280.5 g")
    assert "✗" not in held.body[0][1] and held.body[-2][-1].endswith("✗")
    assert first_approach_grid().latex().isascii() and feasibility_grid().latex().isascii()
