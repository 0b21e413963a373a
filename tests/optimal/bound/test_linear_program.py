"""The interior-point method for programs in boxes, against HiGHS."""

import numpy as np
import pytest
from scipy.optimize import linprog

from armdyn.optimal.bound.linear_program import LinearProgram


def chain(seed, cells=12, nv=3, reachable=True):
    """A random program of the bound's shape: changes from node to node, ways last, their largest sum sought."""
    rng, program = np.random.default_rng(seed), LinearProgram()
    v = program.unknown((cells, nv), -rng.uniform(0.1, 1.0, (cells, nv)), rng.uniform(0.1, 1.0, (cells, nv)))
    given = np.zeros((cells + 1, nv)) if reachable else np.full((cells + 1, nv), 9.0)
    nodes, room = program.rows(given), rng.uniform(0.0, 0.3, given.shape)
    blocks = rng.normal(size=(cells, nv, nv))
    program.blocks(nodes[:-1], v, blocks)
    program.blocks(nodes[1:], v, -blocks)
    program.diagonal(nodes, program.unknown(given.shape, -room, room), -1.0)
    ways, made = program.rows(np.zeros(nv)), program.unknown((1, 1), cost=-1.0)
    program.diagonal(np.broadcast_to(ways, v.shape), v, 1.0 / cells)
    program.diagonal(ways, np.repeat(made, nv), rng.normal(size=nv))
    return program


def tables(program):
    """Cost, matrix, right sides and bounds, put together by hand."""
    costs, right = np.concatenate(program.costs), np.concatenate(program.right, axis=None)
    matrix = np.zeros((len(right), len(costs)))
    for rows, columns, values in program.entries:
        np.add.at(matrix, (rows, columns), values)
    return costs, matrix, right, np.concatenate(program.bounds)


@pytest.mark.parametrize("seed", range(20))
def test_multipliers_prove_the_cost_that_highs_finds(seed):
    costs, matrix, right, bounds = tables(program := chain(seed))
    marginals = program.solved()
    known = linprog(costs, A_eq=matrix, b_eq=right, bounds=bounds, method="highs")
    left, (lower, upper) = costs - marginals @ matrix, np.clip(bounds, -100, 100).T
    proven = marginals @ right + np.sum(np.where(left > 0, left * lower, left * upper))
    # Weak duality: no more than the least cost, but for rounding; below it by the method's tolerance at most.
    assert -2e-6 < proven - known.fun < 1e-9


def test_rows_that_cannot_hold_have_no_multipliers():
    assert chain(1, reachable=False).solved() is None
