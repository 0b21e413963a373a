"""Blocks of equations against the same equations written out, place by place."""

import casadi as ca
import numpy as np

from armdyn.optimal.constraints.rows import differentiated
from armdyn.optimal.mesh.assembly import Block, program_of

SIZE = 5


def products():
    """y₀ y₁ s₀ - own, of two unknowns; costs y₀² s₁."""
    y, p = ca.SX.sym("y", 2), ca.SX.sym("p", 3)
    return differentiated("products", y, p, y[0] * y[1] * p[1] - p[0], y[0] ** 2 * p[2], False)


def cubes():
    """(y³ own, y common), of one unknown, with no parameters that all blocks share."""
    y, p = ca.SX.sym("y"), ca.SX.sym("p", 2)
    return differentiated("cubes", y, p, ca.vertcat(y**3 * p[0], y * p[1]), None, False)


def blocks():
    """Products of neighbours, and of the last and the first, cubes of two."""
    pairs = np.array([[0, 1, 4], [1, 2, 0]])
    return [
        Block(products(), pairs, np.array([[0, 1, 2], [6, 6, 6], [7, 7, 7]])),
        Block(cubes(), np.array([[3, 1]]), np.array([[3, 4], [5, 5]])),
    ]


def by_hand(x, p):
    """Cost and equations; parameters: three own, two own, one common, two shared."""
    shared = p[6:]
    equations = [x[0] * x[1] * shared[0] - p[0], x[1] * x[2] * shared[0] - p[1], x[4] * x[0] * shared[0] - p[2]]
    for own, y in ((p[3], x[3]), (p[4], x[1])):
        equations += [y**3 * own, y * p[5]]
    return shared[1] * (x[0] ** 2 + x[1] ** 2 + x[4] ** 2) + shared[1] * (x[2] + x[3]), ca.vertcat(*equations)


def test_a_program_of_blocks_is_the_one_written_out():
    program = program_of(blocks(), SIZE, paid=[2, 3], price=7)
    x, p = ca.MX.sym("x", SIZE), ca.MX.sym("p", 8)
    sigma, lam = ca.MX.sym("sigma"), ca.MX.sym("lam", 7)
    f, g = by_hand(x, p)
    lagrangian = sigma * f + ca.dot(lam, g)
    expected = ca.Function(
        "expected", [x, p, sigma, lam], [f, g, ca.jacobian(g, x), ca.triu(ca.hessian(lagrangian, x)[0])]
    )
    rng = np.random.default_rng(0)
    at, weights = (rng.normal(size=SIZE), rng.normal(size=8)), (rng.normal(), rng.normal(size=7))
    own = ca.Function("own", [program.functions[name] for name in "xp"], [program.functions[name] for name in "fg"])
    got = [*own(*at), program.jacobian(*at)[1], program.hessian(*at, *weights)]
    for mine, hand in zip(got, expected(*at, *weights), strict=True):
        np.testing.assert_allclose(mine.full(), hand.full(), rtol=1e-14, atol=1e-14)  # a few ulp of numbers near one


def test_the_hessian_is_an_upper_triangle_even_where_unknowns_come_in_another_order():
    pattern = program_of(blocks(), SIZE, paid=[2, 3], price=7).hessian.sparsity_out(0)
    rows, cols = map(np.array, pattern.get_triplet())
    assert np.all(rows <= cols)
    assert (0, 4) in {*zip(rows.tolist(), cols.tolist(), strict=True)}  # its place names 4 before 0


def test_a_block_counts_its_places_and_rows():
    pairs, singles = blocks()
    assert (pairs.places, pairs.rows) == (3, 1)
    assert (singles.places, singles.rows) == (2, 2)
