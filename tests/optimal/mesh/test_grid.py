"""Where intervals lie: all are dealt out, equal masses to each, more where a motion bends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armdyn.optimal.mesh.grid import Density, density_of, distribute

PER_ARC, FLOOR = 2, 0.15
LENGTHS = st.floats(1e-3, 10.0)
DURATIONS = st.lists(LENGTHS, min_size=1, max_size=8).map(np.array)


@st.composite
def densities(draw, total=None):
    lengths = np.array(draw(st.lists(LENGTHS, min_size=1, max_size=12)))
    mass = draw(st.lists(st.floats(1e-3, 10.0), min_size=lengths.size, max_size=lengths.size))
    t = np.concatenate([[0.0], np.cumsum(lengths)])
    return Density(t if total is None else t * (total / t[-1]), np.array(mass))


@given(DURATIONS, st.integers(0, 60), st.none() | densities())
def test_all_intervals_are_dealt_and_every_arc_has_two(durations, more, density):
    intervals = 2 * durations.size + more
    arc_of, parts = distribute(durations, intervals, density, PER_ARC)
    assert arc_of.size == parts.size == intervals
    assert np.all(np.diff(arc_of) >= 0) and np.all(np.bincount(arc_of, minlength=durations.size) >= 2)
    assert np.all(parts > 0)
    # A sum of at most 76 numbers below one.
    np.testing.assert_allclose(np.bincount(arc_of, parts), 1.0, rtol=1e-12)


@given(DURATIONS, st.integers(0, 60))
def test_without_a_density_they_are_even_and_go_by_length(durations, more):
    arc_of, parts = distribute(durations, 2 * durations.size + more, None, PER_ARC)
    counts = np.bincount(arc_of)
    np.testing.assert_allclose(parts, 1 / counts[arc_of], rtol=1e-9)
    shorter = durations[:, None] < durations * (1 - 1e-9)
    assert np.all((counts[:, None] <= counts)[shorter])


# By powers of two, so that both ways round alike: between equal masses the last bit decides.
@given(DURATIONS, st.integers(0, 40), densities(), st.integers(-3, 3).map(lambda k: 2.0**k))
def test_a_density_of_other_times_is_stretched(durations, more, density, factor):
    """Durations are guesses: only the place of an interval in the motion matters."""
    intervals = 2 * durations.size + more
    stretched = Density(factor * density.t, density.mass)
    for one, other in zip(
        distribute(durations, intervals, density, PER_ARC),
        distribute(durations, intervals, stretched, PER_ARC),
        strict=True,
    ):
        np.testing.assert_allclose(one, other, rtol=1e-6)


@given(densities(), st.data(), st.integers(1, 30))
def test_parts_have_equal_masses(density, data, count):
    ends = data.draw(st.tuples(st.floats(0, 0.9), st.floats(0.05, 1)).filter(lambda e: e[1] - e[0] > 0.01))
    start, end = (float(part * density.t[-1]) for part in ends)
    parts = density.between(start, end, count)
    times = np.clip(start + (end - start) * np.concatenate([[0], np.cumsum(parts)]), start, end)
    masses = np.diff(density.up_to(times))
    # Times are rounded to 1e-16 of the motion, where the density is at most 1e8 of its mean.
    np.testing.assert_allclose(masses, masses.sum() / count, atol=1e-8 * density.mass.sum())


@given(densities(), st.integers(2, 5))
def test_a_refined_table_agrees(density, times):
    t = np.unique(
        np.concatenate([np.linspace(a, b, times + 1) for a, b in zip(density.t, density.t[1:], strict=False)])
    )
    finer = Density(t, np.diff(density.up_to(t)))
    at = np.linspace(0, density.t[-1], 37)
    np.testing.assert_allclose(finer.up_to(at), density.up_to(at), atol=1e-12 * density.mass.sum())
    np.testing.assert_allclose(finer.between(0.0, at[-1], 9), density.between(0.0, at[-1], 9), atol=1e-9)


@given(densities(total=1.0), densities(total=1.0))
def test_half_by_one_half_by_the_other(one, other):
    both = one.with_half_of(other)
    at = np.linspace(0, 1, 29)
    expected = one.up_to(at) / one.mass.sum() + other.up_to(at) / other.mass.sum()
    np.testing.assert_allclose(both.up_to(at), expected, atol=1e-12)


def test_a_mesh_is_dense_where_the_motion_has_curvature():
    """A function that bends at the middle only: the intervals there are short, no other is too long."""
    t, nodes = np.linspace(0, 1, 21), np.linspace(0, 1, 4)
    at = t[:-1, None] + np.diff(t)[:, None] * nodes
    density = density_of(t, [(nodes, np.tanh(40 * (at - 0.5))[:, :, None])], FLOOR)
    per_time = density.mass / np.diff(t)
    assert per_time[9] > 5 * per_time[0]
    assert np.argmax(per_time) in (8, 9, 10, 11)
    assert per_time.min() > 0.05 * per_time.mean()  # nowhere nothing
    parts = density.between(0.0, 1.0, 40)
    middle = np.searchsorted(np.cumsum(parts), 0.5)
    assert parts[middle] < parts[0] / 5


def test_the_density_of_a_polynomial_of_lower_degree_is_even():
    t, nodes = np.array([0.0, 0.1, 0.4, 1.0]), np.array([0.0, 0.3, 0.6, 1.0])
    at = t[:-1, None] + np.diff(t)[:, None] * nodes
    # Of degree three, as the nodes: the highest coefficient is h³, its cube root over h the same everywhere.
    density = density_of(t, [(nodes, at[:, :, None] ** 3)], FLOOR)
    np.testing.assert_allclose(density.mass / np.diff(t), density.mass.sum(), rtol=1e-9)


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_the_density_does_not_know_units(factor):
    t, nodes = np.linspace(0, 2, 9), np.linspace(0, 1, 4)
    values = np.sin(3 * (t[:-1, None] + np.diff(t)[:, None] * nodes))[:, :, None]
    one, other = (density_of(t, [(nodes, scale * values)], FLOOR) for scale in (1.0, factor))
    np.testing.assert_allclose(one.mass, other.mass, rtol=1e-9)
