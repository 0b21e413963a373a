"""The figure of many runs' errors."""

import numpy as np
import pytest

from armdyn.control.tracking.run import Envelope
from armdyn.errors import ProblemError
from armdyn.show.figures.loops import plot_envelope
from armdyn.show.plots import save_figure

T = np.linspace(0.0, 1.0, 101)
ERRORS = np.exp(-3 * T)[None, :, None] * np.array([[1.0, 0.1], [0.5, 0.2], [0.2, 0.9], [0.3, 0.3]])[:, None, :]


def envelope(errors=ERRORS, parts=(0.25, 0.5, 0.75)):
    return Envelope.of(T, errors, parts, ("shoulder", "$elbow"), 0.4, 0.005)


def test_an_envelope_has_the_least_the_greatest_and_a_runs_own_quantiles():
    found = envelope()
    np.testing.assert_allclose(found.high[0], [1.0, 0.9])
    np.testing.assert_allclose(found.low[0], [0.2, 0.1])
    np.testing.assert_allclose(found.quantiles[:, 0, 0], [0.2, 0.3, 0.5])
    with pytest.raises(ProblemError, match=r"parts has 2; expected 0 to 1"):
        envelope(parts=(2,))


@pytest.mark.slow
def test_the_figure_shows_every_joint_in_a_panel_with_the_requirement(tmp_path):
    figure = plot_envelope(envelope(), "four runs")
    panels = figure.axes
    assert [panel.get_ylabel() for panel in panels] == ["shoulder", r"\$elbow"]
    for i, panel in enumerate(panels):
        curves = {line.get_label(): line for line in panel.lines}
        np.testing.assert_allclose(curves["worst"].get_ydata(), ERRORS[:, :, i].max(axis=0))
        np.testing.assert_allclose(curves["median"].get_ydata(), np.sort(ERRORS[:, :, i], axis=0)[1])
        assert curves["tolerance"].get_ydata()[0] == 0.005
        assert panel.get_yscale() == "log"
    path = save_figure(figure, tmp_path / "envelope.png")
    assert path.read_bytes() == save_figure(plot_envelope(envelope(), "four runs"), tmp_path / "again.png").read_bytes()


def test_runs_that_broke_off_end_in_the_figure_where_they_did():
    errors = ERRORS.copy()
    errors[0, 50:] = np.inf
    worst = next(line for line in plot_envelope(envelope(errors)).axes[0].lines if line.get_label() == "worst")
    assert np.all(np.isnan(worst.get_ydata()[50:]))
    assert np.all(np.isfinite(worst.get_ydata()[:50]))
