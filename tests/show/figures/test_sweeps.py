"""Figures of studies show the rows' numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armdyn.show.figures.sweeps import figures_of, pareto, plot_curve, plot_map, plot_pareto

OUTCOMES = ("time", "effort")


def rows_of(*axes):
    """A grid of rows; the case at x = 2, y = 20 came to nothing."""
    found = []
    for x in (1.0, 2.0, 4.0):
        for y in (10.0, 20.0):
            none = (x, y) == (2.0, 20.0)
            found.append({"x": x, "y": y, "time": None if none else x + y, "effort": None if none else x * y})
    return [{**row, **dict.fromkeys(axes, "a")} for row in found]


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=30))
def test_the_front_has_no_dominated_points(points):
    points = np.array(points, dtype=float)
    front = pareto(points)
    for k, point in enumerate(points):
        beaten = np.any(np.all(points <= point, axis=1) & np.any(points < point, axis=1))
        assert not (front[k] and beaten)
        # Of points that are alike one stands for all.
        assert beaten or any(np.array_equal(points[j], point) for j in np.flatnonzero(front))


def test_a_curve_has_every_row_and_a_gap_where_there_is_none():
    axes = plot_curve(rows_of(), "x", "time", ["y"], log=["x"]).axes[0]
    first, second = axes.get_lines()
    assert first.get_xydata().tolist() == [[1, 11], [2, 12], [4, 14]]
    assert np.isnan(second.get_ydata()[1]) and axes.get_xscale() == "log"
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["y 10", "y 20"]


def test_a_map_of_a_grid_has_cells_and_one_of_draws_points():
    figure = plot_map(rows_of(), "x", "y", "time")
    (mesh,) = figure.axes[0].collections
    cells = np.ma.filled(mesh.get_array().reshape(2, 3), np.nan)
    assert cells == pytest.approx(np.array([[11, 12, 14], [21, np.nan, 24]]), nan_ok=True)
    (cross,) = figure.axes[0].get_lines()
    assert cross.get_xydata().tolist() == [[2, 20]]
    drawn = np.random.default_rng(0).random((30, 2))
    (points,) = plot_map([{"x": x, "y": y, "time": x} for x, y in drawn], "x", "y", "time").axes[0].collections
    assert len(points.get_offsets()) == 30


def test_of_cases_at_one_place_the_least_is_shown_and_that_is_said():
    rows = [*rows_of(), {"x": 1.0, "y": 10.0, "time": 5.0, "effort": 1.0}]
    figure = plot_map(rows, "x", "y", "time")
    assert figure.axes[0].collections[0].get_array().min() == 5
    assert figure.axes[1].get_ylabel() == "time, least of those at a place"


def test_a_number_far_off_leaves_the_others_their_colours():
    drawn = np.random.default_rng(1).random((40, 2))
    rows = [{"x": x, "y": y, "time": 1000.0 if k == 0 else x} for k, (x, y) in enumerate(drawn)]
    (points,) = plot_map(rows, "x", "y", "time").axes[0].collections
    assert points.get_clim()[1] <= 1


def test_a_front_is_joined():
    (line,) = plot_pareto(rows_of(), "time", "effort", "x").axes[0].get_lines()
    assert line.get_label() == "Pareto front: 1 of 5 cases" and line.get_xydata().tolist() == [[11, 10]]


@pytest.mark.parametrize(
    ("settings", "names"),
    [
        ({"x": "linear", "y": "linear"}, {"curve", "map", "pareto"}),
        ({"x": "linear", "arm": "words"}, {"curve", "pareto"}),
        ({"arm": "words"}, {"pareto"}),
    ],
)
def test_the_figures_that_suit_a_study(settings, names):
    assert set(figures_of(rows_of("arm"), settings, OUTCOMES)) == names


def test_where_nothing_came_of_anything():
    rows = [{"x": x, "y": y} for x in (1.0, 2.0) for y in (1.0, 2.0)]
    assert not figures_of(rows, {"x": "linear", "y": "linear"}, OUTCOMES, title="none_$x")
