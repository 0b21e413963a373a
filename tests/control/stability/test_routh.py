"""Routh's table against polynomials with known roots, and exact characteristic polynomials against identities."""

from fractions import Fraction

import numpy as np
import pytest

from armdyn.control import closed_loop_eigenvalues
from armdyn.control.laws.pid import PidGains
from armdyn.control.stability.linear import closed_loop_matrix, plant_at_goal
from armdyn.control.stability.routh import characteristic_polynomial, routh_table
from armdyn.errors import ProblemError
from pid_loops import example


def polynomial_of(random, degree):
    """Integer coefficients, and how many roots lie in the right half-plane and on the axis; some are repeated."""
    product, right, on_axis = np.array([random.choice([-1, 1])], dtype=object), 0, 0
    while len(product) <= degree:
        kind = random.choice(["real", "pair", "imaginary", "zero"], p=[0.4, 0.35, 0.2, 0.05])
        a, b = int(random.choice([-3, -2, -1, 1, 2])), int(random.integers(1, 4))
        if kind != "real" and kind != "zero" and len(product) == degree:
            continue
        factor, r, i = {
            "real": ([1, -a], int(a > 0), 0),
            "pair": ([1, -2 * a, a * a + b * b], 2 * int(a > 0), 0),
            "imaginary": ([1, 0, b * b], 0, 2),
            "zero": ([1, 0], 0, 1),
        }[kind]
        product, right, on_axis = np.convolve(product, np.array(factor, dtype=object)), right + r, on_axis + i
    return product, right, on_axis


@pytest.mark.parametrize("degree", range(1, 10))
def test_counts_of_known_roots(degree):
    """Small integers as roots: rows that begin with zeros or are zero occur often, also several in one table."""
    random, remedies = np.random.default_rng(degree), set()
    for _ in range(400):
        polynomial, right, on_axis = polynomial_of(random, degree)
        table = routh_table(polynomial.astype(float))
        assert (table.right_half_plane, table.on_axis) == (right, on_axis), polynomial
        assert table.is_stable == (right == on_axis == 0)
        assert all(table.first_column)
        remedies |= set(table.remedies)
    assert degree < 3 or remedies == {"", "leading zero", "zero row"}


@pytest.mark.parametrize(
    ("polynomial", "right", "on_axis", "remedy"),
    [
        ([1, 2, 3, 6, 5, 3], 2, 0, "leading zero"),  # Nise, Control Systems Engineering, example 6.2
        ([1, 7, 6, 42, 8, 56], 0, 4, "zero row"),  # the same, example 6.4
        ([1, 0, 1, 1], 2, 0, "leading zero"),
        ([1, 0, 2, 0, 1], 0, 4, "zero row"),  # (s² + 1)²: unstable, but no root to the right
    ],
)
def test_textbook_polynomials(polynomial, right, on_axis, remedy):
    table = routh_table(polynomial)
    assert (table.right_half_plane, table.on_axis) == (right, on_axis)
    assert remedy in table.remedies
    assert not table.is_stable


def test_the_entries_of_a_cubic():
    table = routh_table([2.0, 3.0, 5.0, 7.0])
    assert table.rows == ((2, 5), (3, 7), (Fraction(1, 3), 0)[:1], (7,))
    assert table.is_stable
    assert table.markdown().splitlines()[4] == "| s^1 | 0.333333 |  |  |"


def test_no_rounding_on_the_boundary():
    """s³ + a s² + b s + ab has ±i √b; one ulp of the last coefficient decides."""
    a, b = 0.1, 3.0
    exact = Fraction(a) * Fraction(b)
    near = float(exact)
    sides = [routh_table([1.0, a, b, x]) for x in (np.nextafter(near, 0), np.nextafter(near, 1))]
    assert [table.is_stable for table in sides] == [True, False]
    boundary = routh_table([Fraction(1), Fraction(a), Fraction(b), exact])
    assert (boundary.right_half_plane, boundary.on_axis) == (0, 2)


def test_characteristic_polynomial_obeys_cayley_and_hamilton():
    random = np.random.default_rng(0)
    for n in range(1, 7):
        A = random.integers(-9, 10, (n, n))
        coefficients = characteristic_polynomial(A / 8)
        exact = np.array([[Fraction(int(x), 8) for x in row] for row in A], dtype=object)
        value = np.zeros((n, n), dtype=object)
        for c in coefficients:
            value = value @ exact + c * np.eye(n, dtype=int).astype(object)
        assert not np.any(value)
        assert coefficients[0] == 1
        # Eigenvalues of such small matrices are good to some 1e-13.
        np.testing.assert_allclose(np.array(coefficients, dtype=float), np.poly(A / 8), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["RR Ex5", "RRR Ex6"])
@pytest.mark.parametrize("form", ["torque", "acceleration"])
def test_several_joints_against_eigenvalues(name, form):
    """Exact polynomial and table of the closed loop's matrix; eigenvalues are wrong by 1e-9 of the largest at most."""
    robot, poses = example(name, grams=100.6)
    goal, random = np.array(poses["q_goal"]), np.random.default_rng(3)
    arm = plant_at_goal(robot, goal, form)
    verdicts = set()
    for _ in range(100):
        gains = PidGains(*(tuple(10 ** random.uniform(-1, 3, robot.nv)) for _ in range(3)))
        A = closed_loop_matrix(arm, *gains.per_joint(robot.nv))
        table = routh_table(characteristic_polynomial(A))
        values = closed_loop_eigenvalues(robot, goal, gains, form)
        assert np.abs(values.real).min() > 1e-13 * np.linalg.norm(A)
        assert table.right_half_plane == np.sum(values.real > 0)
        verdicts.add(table.is_stable)
    assert verdicts == {True, False}


@pytest.mark.parametrize("polynomial", [[], [0.0, 0.0], [1.0, np.nan], [[1.0, 2.0]], "s", None])
def test_no_polynomial(polynomial):
    with pytest.raises(ProblemError, match="polynomial"):
        routh_table(polynomial)


@pytest.mark.parametrize("matrix", [[[1.0, 2.0]], [[np.inf]], 3.0])
def test_no_square_matrix(matrix):
    with pytest.raises(ProblemError, match="matrix"):
        characteristic_polynomial(matrix)


@pytest.mark.parametrize("polynomial", [[1.0] * 300, np.ones(10**5), [10.0 ** (-300 * (k % 2)) for k in range(60)]])
def test_polynomials_whose_fractions_would_take_minutes_are_refused(polynomial):
    with pytest.raises(ProblemError, match=r"coefficients with .* binary digits .* at most 100 coefficients"):
        routh_table(polynomial)


def test_entries_beyond_the_range_of_floats_are_printed():
    table = routh_table([Fraction(10**400), Fraction(1, 10**400)])
    assert table.is_stable
    assert "e+400" in table.markdown()
    assert "1e-400" in table.markdown()


def test_a_polynomial_that_would_take_minutes_is_refused_at_once():
    with pytest.raises(ProblemError, match=r"^matrix has 100 rows of numbers of .* takes too long"):
        characteristic_polynomial(np.random.default_rng(0).random((100, 100)))
