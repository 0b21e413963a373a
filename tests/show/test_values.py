"""A solution draws itself."""

import re

import numpy as np
import pytest

from armdyn.errors import FileError, ProblemError
from public_calls import solution


def test_the_report_is_one_file_with_the_verdict(tmp_path):
    path = tmp_path / "report.html"
    assert solution().report(path) == path
    page = path.read_text()
    assert (
        "r: minimum time" in page and "locally optimal (Pontryagin)" in page and f"{solution().duration:.4f} s" in page
    )
    assert not re.findall(r"(?:https?|wss?)://", page.partition("<body>")[2].partition("<script>")[0])
    for wrong, error in ((None, ProblemError), (tmp_path / "nowhere" / "r.html", FileError)):
        with pytest.raises(error):
            solution().report(wrong)


def test_the_figure_has_the_motion(tmp_path):
    figure = solution().plot()
    assert [panel.get_ylabel() for panel in figure.axes[:3]]
    (curve, *_) = (line for line in figure.axes[0].lines if len(line.get_xdata()) > 2)
    np.testing.assert_allclose(curve.get_xdata()[-1], solution().duration)
    figure.savefig(tmp_path / "motion.pdf")
