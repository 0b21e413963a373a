"""Quadratic models within balls and planes: against a fine grid, and against closed forms."""

import numpy as np
import pytest

from armdyn.optimal.switching.extremal.trust_region import QuadraticForm, held_back, null_space


def test_a_convex_model_ends_on_the_plane_that_is_in_its_way():
    # (y₀ − 2)² + (y₁ − 1)² within y₀ ≤ 1: the least is at (1, 1).
    model = QuadraticForm(np.array([-4.0, -2.0]), 2 * np.eye(2))
    y, rim = model.within(np.array([[-1.0, 0.0]]), np.array([1.0]), 10.0)
    np.testing.assert_allclose(y, [1.0, 1.0], atol=1e-12)
    assert not rim


def test_a_plane_that_is_met_on_the_way_is_let_go():
    # Towards (2, 1): y₁ ≤ 0.3 is met first, then y₀ + 3 y₁ ≤ 2, on which the nearest point is (1.7, 0.1).
    model = QuadraticForm(np.array([-4.0, -2.0]), 2 * np.eye(2))
    y, _ = model.within(np.array([[0.0, -1.0], [-1.0, -3.0]]), np.array([0.3, 2.0]), 10.0)
    np.testing.assert_allclose(y, [1.7, 0.1], atol=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_no_point_of_a_grid_is_much_lower(seed):
    random = np.random.default_rng(seed)
    half = random.normal(size=(2, 2))
    model = QuadraticForm(random.normal(size=2), half + half.T)  # of any curvature
    rows, slack = random.normal(size=(4, 2)), random.uniform(0, 0.5, 4)
    y, _ = model.within(rows, slack, 1.0)
    assert np.all(rows @ y + slack >= -1e-9)
    assert np.linalg.norm(y) <= 1 + 1e-9
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 201)] * 2), axis=-1).reshape(-1, 2)
    inside = grid[(np.linalg.norm(grid, axis=1) <= 1) & np.all(grid @ rows.T + slack >= 0, axis=1)]
    values = inside @ model.gradient + np.einsum("ki,ij,kj->k", inside, model.hessian, inside) / 2
    assert model.at(y) <= 1e-12
    if np.all(np.linalg.eigvalsh(model.hessian) > 0):  # else the least that is found is one of several
        assert model.at(y) <= np.min(values) + 1e-9


def test_where_there_is_no_room_the_plane_is_followed():
    # Two planes meet in the point; down is along the second.
    model = QuadraticForm(np.array([1.0, 0.0]), np.zeros((2, 2)))
    y, rim = model.within(np.array([[0.0, 1.0], [1.0, 1.0]]), np.zeros(2), 1.0)
    assert rim
    np.testing.assert_allclose(y, [-np.sqrt(0.5), np.sqrt(0.5)], atol=1e-6)


def test_planes_remove_their_part_of_the_gradient():
    multiplier, left = held_back(np.array([2.0, 1.0]), np.array([[1.0, 0.0], [0.0, -1.0]]))
    np.testing.assert_allclose(multiplier, [2.0, 0.0])  # the second would have to pull
    assert left == pytest.approx(1.0)
    assert held_back(np.array([3.0, 4.0]), np.empty((0, 2)))[1] == 5.0


def test_directions_that_rows_do_not_feel():
    free = null_space(np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0]]))
    assert free.shape == (2, 3)
    np.testing.assert_allclose(free @ [1.0, 1.0, 0.0], 0.0, atol=1e-12)
    np.testing.assert_allclose(free @ free.T, np.eye(2), atol=1e-12)
