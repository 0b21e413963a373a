"""Figures: what is drawn is what the trajectory says, and files are whole and reproducible."""

import subprocess
import sys

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import TrajectoryError
from armdyn.show import plots
from problems import paper_arm
from show.motions import HANGING, RAISED, quintic


def bang_bang():
    switch = 0.5
    t = np.array([0.0, switch, np.nextafter(switch, 1), 1.0])
    v = np.array([[0.0], [1.5], [1.5], [0.0]])
    q = np.array([[0.0], [0.375], [0.375], [0.75]])
    return ad.Trajectory(t=t, q=q, v=v, tau=[[3.0], [3.0], [-3.0], [-3.0]], name="bang-bang")


def curves(panel):
    return [line for line in panel.lines if len(line.get_xdata()) > 2]


def test_panels_show_every_joint_of_every_trajectory():
    robot = paper_arm("rrr")
    runs = [quintic(robot, HANGING["rrr"], RAISED["rrr"], d, n) for d, n in ((0.4, "fast"), (2.0, "slow"))]
    figure = plots.plot_trajectories(runs, limits=robot.limits, title="rrr")
    assert [panel.get_ylabel() for panel in figure.axes] == [
        "position [rad]",
        "velocity [rad/s]",
        "torque [N m]",
    ]
    for panel in figure.axes:
        lines = curves(panel)
        assert len(lines) == 6
        assert len({line.get_color() for line in lines}) == 3
    joints, runs_legend = figure.legends[0], figure.axes[0].get_legend()
    assert [text.get_text() for text in joints.get_texts()] == [*robot.joint_names, "limit"]
    assert [text.get_text() for text in runs_legend.get_texts()] == ["fast, 0.4 s", "slow, 2 s"]


def test_a_torque_jump_is_vertical():
    (line,) = curves(plots.plot_trajectories([bang_bang()]).axes[2])
    t, tau = line.get_data()
    k = int(np.argmax(np.abs(np.diff(tau))))
    assert tau[k] == 3.0
    assert tau[k + 1] == -3.0
    assert t[k + 1] - t[k] < 1e-15


def test_position_between_samples_is_the_cubic():
    run = bang_bang()
    (line,) = curves(plots.plot_trajectories([run]).axes[0])
    t, q = line.get_data()
    assert len(t) > 1000
    np.testing.assert_allclose(q, run(t).q[:, 0], rtol=0, atol=1e-14)


def test_limits_are_drawn_only_where_finite_and_near():
    limits = ad.JointLimits(
        position_lower=[-np.inf],
        position_upper=[np.inf],
        velocity=[1000.0],
        effort_lower=[-3],
        effort_upper=[3],
    )
    figure = plots.plot_trajectories([bang_bang()], limits=limits)
    levels = [
        {float(line.get_ydata()[0]) for line in panel.lines if len(line.get_xdata()) == 2} for panel in figure.axes
    ]
    assert {-3.0, 3.0} <= levels[2]
    assert 1000.0 not in levels[1]
    low, high = figure.axes[1].get_ylim()
    assert high - low < 3


@pytest.mark.parametrize("suffix, magic", [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_the_same_figure_gives_the_same_bytes(tmp_path, suffix, magic):
    paths = [plots.save_figure(plots.plot_trajectories([bang_bang()]), tmp_path / f"{i}.{suffix}") for i in range(2)]
    first, second = (path.read_bytes() for path in paths)
    assert first == second
    assert first.startswith(magic)
    assert len(list(tmp_path.iterdir())) == 2  # no scratch file left


def test_bad_input():
    with pytest.raises(TrajectoryError):
        plots.plot_trajectories([])
    robot = paper_arm("rr")
    with pytest.raises(TrajectoryError):
        plots.plot_trajectories([bang_bang(), quintic(robot, HANGING["rr"], RAISED["rr"], 1.0)])
    with pytest.raises(ValueError, match="png"):
        plots.save_figure(plots.plot_trajectories([bang_bang()]), "figure.gif")


def test_names_that_are_no_mathematics(tmp_path):
    run = bang_bang()
    run = ad.Trajectory(t=run.t, q=run.q, v=run.v, tau=run.tau, joint_names=("_a$\\frac$",), name="$x_{")
    plots.save_figure(plots.plot_trajectories([run, run], title="$\\bad{"), tmp_path / "x.png")


def test_importing_armdyn_loads_no_graphics():
    code = "import sys, armdyn, armdyn.show; assert not {'matplotlib', 'meshcat', 'trimesh'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
