"""Figures: they show the trajectory's numbers, and files are whole and reproducible."""

import subprocess
import sys

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import TrajectoryError
from armdyn.show import plots
from armdyn.show.figures.style import COLORS
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
    weak = robot.with_limits([30.0, 30.0, 1.0], None).limits  # the third joint's force has a panel of its own
    mixed = plots.plot_trajectories(runs, limits=weak, sliding=[False, False, True])
    expected = ["position [rad or m]", "velocity [rad/s or m/s]", "torque [N m]", "torque [N]"]
    assert [panel.get_ylabel() for panel in mixed.axes] == expected
    joints, runs_legend = figure.legends
    assert runs_legend.get_title().get_text() == "rrr"
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


def notes(figure):
    return [panel.get_title(loc="right") for panel in figure.axes]


def ticks(panel):
    return {(float(line.get_xdata()[0]), line.get_color()) for line in panel.lines if line.get_label() == "_switch"}


def labels(legend):
    return [text.get_text() for text in legend.get_texts()]


def test_limits_that_are_not_drawn_are_listed():
    limits = ad.JointLimits(
        position_lower=[-np.inf], position_upper=[np.inf], velocity=[1000.0], effort_lower=[-3], effort_upper=[3]
    )
    figure = plots.plot_trajectories([bang_bang()], limits=limits)
    assert notes(figure) == ["no position limits", "limits beyond the panel: ±1000 rad/s", ""]
    assert notes(plots.plot_trajectories([bang_bang()])) == ["", "", ""]  # no limits given: none to speak of
    half = ad.JointLimits(
        position_lower=[-np.inf, -9.0], position_upper=[np.inf, 0.5], velocity=[2, 2], effort_lower=[-3, -3],
        effort_upper=[3, 3],
    )  # fmt: skip
    run = bang_bang()
    two = ad.Trajectory(t=run.t, q=run.q.repeat(2, 1), v=run.v.repeat(2, 1), tau=run.tau.repeat(2, 1))
    position = notes(plots.plot_trajectories([two], limits=half))[0]
    assert position == "other limits beyond the panel: −9 rad; 1 of 2 joints without a limit"


def test_ticks_say_when_a_torque_switches():
    figure = plots.plot_trajectories([bang_bang()])
    for panel in figure.axes:
        assert ticks(panel) == {(0.5, COLORS[0])}
        low, high = panel.get_ylim()
        assert low < 0 < high  # ticks are in parts of the panel, and leave its scale alone
    assert labels(figure.legends[0]) == ["joint 1", "switch"]


def test_small_steps_of_a_torque_are_no_switches():
    t = np.array([0.0, 0.5, np.nextafter(0.5, 1), 1.0])
    steps = ad.Trajectory(t=t, q=np.zeros((4, 1)), v=np.zeros((4, 1)), tau=[[0.0], [1.0], [1.3], [3.0]])
    assert steps.switch_times == ((0.5,),)
    assert plots.switches(steps) == ((),)
    assert plots.switches(bang_bang()) == ((0.5,),)


def test_a_motion_whose_switching_times_are_not_resolved_is_marked():
    figure = plots.plot_trajectories([bang_bang(), bang_bang()], unresolved=(1,))
    assert labels(figure.legends[1]) == ["bang-bang, 1 s", "bang-bang, 1 s (switching times not resolved)"]
    alone = plots.plot_trajectories([bang_bang()], unresolved=(0,))
    assert not any(ticks(panel) for panel in alone.axes)
    assert labels(alone.legends[0]) == ["joint 1"]
    assert labels(alone.legends[1]) == ["bang-bang, 1 s (switching times not resolved)"]
    with pytest.raises(TrajectoryError, match="unresolved has 1; expected places of 1 trajectories"):
        plots.plot_trajectories([bang_bang()], unresolved=(1,))


def test_joints_of_another_scale_have_a_torque_panel_of_their_own():
    strength = np.array([150.0, 28.0, 87.0, 12.0, 0.0])
    free = np.full(5, np.inf)
    limits = ad.JointLimits(
        position_lower=-free, position_upper=free, velocity=free, effort_lower=-strength, effort_upper=strength
    )
    t, shape = np.array([0.0, 1.0]), np.array([[1.0], [-1.0]])
    motion = ad.Trajectory(t=t, q=np.zeros((2, 5)), v=np.zeros((2, 5)), tau=0.2 * shape * strength)
    figure = plots.plot_trajectories([motion], limits=limits)
    torques = figure.axes[2:]
    assert {panel.get_ylabel() for panel in torques} == {"torque [N m]"}
    drawn = [{line.get_color() for line in panel.lines} & set(COLORS) for panel in torques]
    assert drawn == [{COLORS[i] for i in group} for group in ((0, 2), (1, 3), (4,))]
    assert figure.axes[-1].get_xlabel() == "time [s]"
    assert len(plots.plot_trajectories([motion]).axes) == 3  # without limits no scale is known


@pytest.mark.parametrize("joints", [1, 7])
def test_nothing_outside_the_panels_lies_on_them_or_off_the_page(joints):
    run = bang_bang()
    arrays = {name: np.repeat(getattr(run, name), joints, 1) for name in ("q", "v", "tau")}
    names = tuple(f"shoulder_lift_joint_{i}" for i in range(joints))
    long = ad.Trajectory(t=run.t, joint_names=names, name="a motion with a long name", **arrays)
    figure = plots.plot_trajectories([long] * 3, title="a title", unresolved=(2,))
    plots.svg_text(figure)  # laid out
    page = figure.bbox
    boxes = [legend.get_window_extent() for legend in figure.legends]
    assert len(boxes) == 2
    for box in boxes:
        assert page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1
        assert not any(box.overlaps(panel.get_window_extent()) for panel in figure.axes)
    assert not boxes[0].overlaps(boxes[1])


@pytest.mark.slow
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


def test_torque_limits_that_fall_with_speed_are_drawn_along_the_motion():
    t, rest = np.linspace(0, 1, 5), np.zeros((5, 2))
    v = np.column_stack([10 * t, rest[:, 0]])
    robot = paper_arm("rr")
    motion = ad.Trajectory(t, rest, v, rest, robot.joint_names)
    limits = robot.with_torque_speed({"joint1": [[0, 3], [10, 1]]}).limits
    plain, falling = (curves(plots.plot_trajectories([motion], limits=of).axes[2]) for of in (robot.limits, limits))
    assert len(falling) == len(plain) + 2
    assert any(np.allclose(line.get_ydata(), 3 - 2 * t) for line in falling[len(plain) :])
