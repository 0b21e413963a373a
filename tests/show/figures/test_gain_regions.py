"""The figure of stable gains: its curves against Routh's condition."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.contour import QuadContourSet

from armdyn.control.laws.pid import Pid, PidGains
from armdyn.control.loop.loop import Loop
from armdyn.control.stability.region import GainRegion, gain_plane
from armdyn.control.stability.sampled import sampled_loop
from armdyn.errors import ProblemError
from pid_loops import example
from scripts_of import script

plot_regions = script("gain_regions").plot_regions
KP, KD = np.geomspace(1, 300, 40), np.geomspace(0.01, 50, 40)


@pytest.fixture(scope="module")
def plane():
    robot, poses = example("R Ex4", grams=100.6)
    return gain_plane(robot, poses["q_goal"], kp=KP, kd=KD, ki=50.0)


@pytest.mark.parametrize("form", ["torque", "acceleration", "computed_torque"])
def test_a_plane_equals_its_points(form):
    robot, poses = example("RR Ex5", grams=100.6)
    plane = gain_plane(robot, poses["q_goal"], kp=KP[::13], kd=KD[::13], ki=50.0, form=form)
    for place in np.ndindex(plane.radius.shape):
        gains = PidGains(float(plane.kp[place[1]]), 50.0, float(plane.kd[place[0]]))
        own = sampled_loop(robot, poses["q_goal"], Pid(gains, form, feedforward=False), Loop()).radius
        # Affine in the gains: rounding of slopes of 1e3, which slow poles, close to one another, show at its root.
        assert plane.radius[place] == pytest.approx(own, rel=1e-7)


def test_the_dashed_curve_is_rouths(plane):
    robot, poses = example("R Ex4", grams=100.6)
    region = GainRegion.of(robot, poses["q_goal"], "torque")
    assert np.array_equal(plane.growth < 0, region.stable(KP[None, :], 50.0, KD[:, None]))
    figure = plot_regions({"R": {"100.6 g": plane}}, mark=(30.0, 10.0))
    sets = [one for one in figure.axes[0].collections if isinstance(one, QuadContourSet)]
    _filled, _sampled, continuous = sets
    points = np.vstack([path.vertices for path in continuous.get_paths()])
    inside = (points[:, 0] > 1.2) & (points[:, 0] < 250)
    assert np.sum(inside) > 20
    step = KD[1] / KD[0]
    ratio = points[inside, 1] / region.least_kd(points[inside, 0], 50.0)
    assert np.all((ratio > 1 / step) & (ratio < step))  # within one step of the grid


def test_panels_and_legend(plane):
    other = replace(plane, growth=np.full_like(plane.growth, 1.0), radius=np.full_like(plane.radius, 2.0))
    panels = {name: {"100.6 g": plane, "1000 g": other} for name in ("R", "RR", "RRR", "more")}
    figure = plot_regions(panels, title="regions")
    shown = [axes for axes in figure.axes if axes.get_visible()]
    assert [axes.get_title() for axes in shown] == list(panels)
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts[:2] == ["100.6 g", "1000 g"]
    assert len(texts) == 4


def test_nothing_to_plot(plane):
    with pytest.raises(ProblemError, match="nothing to plot"):
        plot_regions({})
    with pytest.raises(ProblemError, match="logarithmic"):
        plot_regions({"R": {"0 g": replace(plane, kp=plane.kp - plane.kp[0])}})


@pytest.mark.parametrize("wrong", [{"kp": [2.0, 1.0]}, {"kd": [1.0]}, {"kp": [-1.0, 1.0]}, {"ki": -1.0}])
def test_bad_gains(wrong):
    robot, poses = example("R Ex4")
    with pytest.raises(ProblemError):
        gain_plane(robot, poses["q_goal"], **({"kp": [1.0, 2.0], "kd": [1.0, 2.0], "ki": 1.0} | wrong))
