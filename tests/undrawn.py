"""Figures are not drawn: png and pdf of one take half a second."""

import contextlib

import pytest


@contextlib.contextmanager
def unrendered():
    """Figures are made and written, but their files show nothing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("armdyn.show.plots._rendered", lambda figure, kind: b"<svg/>")
        patch.setattr("matplotlib.figure.Figure.draw_without_rendering", lambda figure: None)  # places the panels
        yield
