"""Figures 2 to 7: their content, and its place."""

from dataclasses import replace

import numpy as np
import pytest

from armdyn.paper import EXAMPLES
from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.run import run_case
from armdyn.paper.page.figures import EXAMPLE_OF_FIGURE, draw, paper_figures, picture
from armdyn.paper.printed import published
from paper.computed import outcome, outcomes


def verticals(panel):
    return {float(line.get_xdata()[0]) for line in panel.lines if len(set(line.get_xdata())) == 1}


def levels(panel):
    return {float(line.get_ydata()[0]) for line in panel.lines if len(set(line.get_ydata())) == 1}


def curves(panel):
    return [line for line in panel.lines if len(line.get_xdata()) > 10]


def test_figures_are_the_papers():
    assert {one.figure: one.number for one in sorted(EXAMPLES, key=lambda one: one.figure)} == EXAMPLE_OF_FIGURE


def test_each_figure_has_its_example_and_the_papers_time():
    figures = paper_figures(outcomes())
    assert [figure.number for figure in figures] == [2, 3, 5, 7]
    for figure in figures:
        example = EXAMPLE_OF_FIGURE[figure.number]
        assert {drawn.case.example for drawn in figure.outcomes} == {example}
        assert figure.published == published.printed_time(example, 0.1006).value
        assert f"{figure.published:g} s" in figure.caption
    kinds = [drawn.case.kind for drawn in figures[0].outcomes]
    assert kinds == ["minimum_time", "time_energy"]
    assert [(one.case.reading, one.case.variant) for one in figures[-1].outcomes] == [
        ("tip", "lagrangian"),
        ("mM", "lagrangian"),
        ("mM", "printed"),
    ]
    assert figures[-1].caption.count("no arrival") == 2


def test_panels_are_position_velocity_and_torque_with_units():
    (figure, *_) = paper_figures(outcomes())
    panels = draw(figure).axes
    assert [panel.get_ylabel() for panel in panels] == [
        "(a) position [rad]",
        "(b) velocity [rad/s]",
        "(c) torque [N m]",
    ]
    assert panels[-1].get_xlabel() == "time [s]"
    assert all(len(curves(panel)) == 2 or panel is panels[2] for panel in panels)


def test_time_optimal_figure_marks_switches_bounds_goal_and_the_papers_time():
    figure = paper_figures(outcomes())[0]
    fastest = figure.outcomes[0]
    position, velocity, torque = draw(figure).axes
    (switch,) = fastest.trajectory.switch_times[0]
    assert f"{switch:.5f} s" in figure.caption
    assert switch in verticals(torque)
    assert {-3.0, 3.0} <= levels(torque)
    assert fastest.case.q_goal[0] in levels(position)
    for panel in (position, velocity, torque):
        assert figure.published in verticals(panel)
        assert any(x == pytest.approx(fastest.time, rel=1e-12) for x in verticals(panel))  # a sum of arcs
        low, high = panel.get_xlim()
        assert low <= 0 and figure.published < high


def test_pid_figure_marks_the_arrival_on_the_curve():
    figure = next(one for one in paper_figures(outcomes()) if one.number == 3)
    position = draw(figure).axes[0]
    marks = [line.get_xydata()[0] for line in position.lines if line.get_marker() == "o"]
    assert [x for x, _ in marks] == [one.time for one in figure.outcomes]
    for (_, angle), one in zip(marks, figure.outcomes, strict=True):
        assert abs(angle - one.case.q_goal[0]) == pytest.approx(0.005, abs=1e-6)  # samples 10 ms apart, cubic between


def test_legend_names_every_curve_and_its_time():
    figure = next(one for one in paper_figures(outcomes()) if one.number == 7)
    texts = [text.get_text() for text in draw(figure).legends[-1].get_texts()]
    assert texts[0] == "payload at the tip, no arrival"
    assert texts[2] == f"(7) as printed, {figure.outcomes[2].time:.4g} s"
    assert texts[-1] == "published, 6.235 s"


def test_a_payload_that_the_paper_has_not_has_no_published_time():
    run = run_case(Case(4, "r", "pid", 0.3))
    (figure,) = paper_figures([run], 0.3)
    assert figure.published is None
    assert "The paper" not in figure.caption
    assert [text.get_text() for text in draw(figure).legends[-1].get_texts()] == [
        f"payload at the tip, {run.time:.4g} s"
    ]


def test_nothing_is_drawn_without_a_motion():
    gone = replace(outcome(Case(4, "r", "pid", 0.1006)), trajectory=None)
    assert paper_figures([gone]) == ()
    assert paper_figures([]) == ()


@pytest.mark.slow
def test_files_are_pdf_and_png(tmp_path):
    drawn = picture(tmp_path / "figures", paper_figures(outcomes())[0])
    assert [path.name for path in drawn.files] == ["figure2.pdf", "figure2.png"]
    assert all(path.stat().st_size > 10_000 for path in drawn.files)
    assert drawn.files[0].read_bytes().startswith(b"%PDF") and drawn.files[1].read_bytes().startswith(b"\x89PNG")
    assert "<svg" in drawn.svg


def test_torque_jumps_are_drawn_as_jumps():
    figure = paper_figures(outcomes())[0]
    torque = draw(figure).axes[2]
    bang_bang = max(curves(torque), key=lambda line: np.abs(np.diff(line.get_ydata())).max())
    t, tau = bang_bang.get_data()
    k = int(np.argmax(np.abs(np.diff(tau))))
    assert (tau[k], tau[k + 1]) == (3.0, -3.0)
    assert t[k + 1] - t[k] <= 2 * np.spacing(t[k])
