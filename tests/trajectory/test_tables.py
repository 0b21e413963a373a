"""Columns that contradict each other are refused by the likely unit; coarse tables and noisy logs pass."""

import warnings

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from armdyn.errors import ArmdynWarning, TrajectoryError
from armdyn.trajectory.tables import check_columns

JOINTS = ("shoulder", "elbow", "wrist")
WAY = np.array([1.2, -0.4, 0.7])


def quintic(n, duration=2.0):
    """A motion from rest to rest: t, q, v, a."""
    s = np.linspace(0, 1, n)[:, None]
    q, v, a = 10 * s**3 - 15 * s**4 + 6 * s**5, 30 * s**2 - 60 * s**3 + 30 * s**4, 60 * s - 180 * s**2 + 120 * s**3
    return duration * s[:, 0], q * WAY, v * WAY / duration, a * WAY / duration**2


def judged(t, q, v=None, a=None):
    """The warnings of a table."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        check_columns(t, (q, v, a), JOINTS, "table")
    return [str(one.message) for one in said]


@pytest.mark.parametrize("rows", [5, 6, 21, 200, 2000])
@pytest.mark.parametrize(
    ("scales", "words"),
    [
        ((1e3, 1, 1, 1), "is t in ms"), ((1e6, 1, 1, 1), "is t in µs"), ((1e9, 1, 1, 1), "is t in ns"),
        ((1, 1, 180 / np.pi, 1), r"are velocities degrees\? .*'v1 \[deg/s\]'"),
        ((1, 1, 30 / np.pi, 1), "are velocities revolutions per minute"),
        ((1, 180 / np.pi, 1, 1), r"are positions degrees\? .*'q1 \[deg\]'"),
        ((1, 1e3, 1, 1), "are positions mm, or velocities per ms"),
        ((1, 1, 1, 180 / np.pi), r"are accelerations degrees\?"),
    ],
)  # fmt: skip
def test_columns_in_other_units(rows, scales, words):
    if rows < 7 and scales[3] != 1:
        pytest.skip("five samples of a quintic's acceleration do not sum up to its velocity")
    with pytest.raises(TrajectoryError, match=words):
        judged(*(scale * one for scale, one in zip(scales, quintic(rows), strict=True)))


def test_columns_of_zeros_and_of_another_joint_are_remarked():
    t, q, v, a = quintic(100)
    assert "all velocities are 0 although positions change, as of a motion that stops" in judged(t, q, 0 * v)[0]
    assert "all accelerations are 0 although velocities change" in judged(t, q, v, 0 * a)[0]
    assert judged(t, q, v * [1, 0, 1]) == ["table: the velocities of elbow do not fit its positions"]
    assert len(judged(t, q, v[:, [1, 0, 2]])) == 2 and len(judged(t, q, -v)) == 3
    assert not judged(t, 0 * q, 0 * v, 0 * a)  # an arm that stands still


def test_times_alone_in_ms_are_remarked():
    t, q, _, _ = quintic(21)
    assert "no joint is faster than 0.0011 rad/s or m/s in 2000 s: is t in ms?" in judged(1e3 * t, q)[0]
    assert not judged(t, q) and not judged(np.linspace(0, 2000, 21) + 0.5 * (t > 1), q)


@pytest.mark.parametrize("rows", [2, 3, 4, 5, 8, 21, 100])
def test_coarse_tables_pass(rows):
    t, q, v, a = quintic(rows, 0.3)
    for columns in ((q, v), (q, v, a), (q, None, a)):
        assert not judged(t, *columns)
    s, (start, end) = t[:, None] / 0.3, (2 * t[:, None] ** 2, 2 * (0.3 - t[:, None]) ** 2)  # from limit to limit
    bang = np.where(s < 0.5, start, 0.09 - end), np.where(s < 0.5, 4 * t[:, None], 4 * (0.3 - t[:, None]))
    assert not judged(t, bang[0] * WAY, bang[1] * WAY, np.where(s < 0.5, 4, -4) * WAY)


@pytest.mark.parametrize("seed", range(40))
def test_splines_and_waypoints_pass(seed):
    """Splines at their own points, at which they may be nearly at rest, and waypoints that are passed slowly."""
    draw = np.random.default_rng(seed)
    t = np.cumsum(draw.uniform(0.05, 1.5, draw.integers(3, 12)))
    way = draw.uniform(-3, 3, (t.size, 3))
    spline = CubicSpline(t, way, bc_type="clamped")
    dense = np.linspace(t[0], t[-1], 20 * t.size)
    assert not judged(dense, spline(dense), spline(dense, 1), spline(dense, 2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ArmdynWarning)  # what is not refused may be remarked
        check_columns(t, (way, spline(t, 1), spline(t, 2)), JOINTS, "table")
        check_columns(t, (way, draw.uniform(-0.05, 0.05, way.shape), None), JOINTS, "table")
        check_columns(t, (way, 0 * way, 0 * way), JOINTS, "table")


@pytest.mark.parametrize("rate", [100, 1000])
@pytest.mark.parametrize("noise", [1e-4, 1e-3, 5e-3])
def test_logs_with_noise_pass(rate, noise):
    """Encoder steps of 0.1 mrad, velocities with noise, an offset, and a delay of 5 ms, and rest at the end."""
    draw = np.random.default_rng(rate)
    t = np.arange(0, 12, 1 / rate)
    way = np.minimum(t, 8)[:, None] * [2.0, 1.3, 0.0]
    q = 0.5 * np.sin(way) + draw.normal(0, noise, way.shape)
    late = np.minimum(np.maximum(t - 0.005, 0), 8)[:, None] * [2.0, 1.3, 0.0]
    v = np.where(t[:, None] < 8, 0.5 * np.cos(late) * [2.0, 1.3, 0.0], 0) + draw.normal(1e-3, 30 * noise, way.shape)
    assert not judged(t, np.round(q / 1e-4) * 1e-4, v)
    rest = draw.normal(0, noise, way.shape)
    assert not judged(t, rest, 30 * draw.normal(0, noise, way.shape))
