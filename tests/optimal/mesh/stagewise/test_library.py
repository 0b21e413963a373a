"""Riccati recursion against a dense solve of the same equations, and its inertia test against eigenvalues."""

import ctypes
import shutil

import numpy as np
import pytest
from scipy.linalg import null_space

from armdyn.codegen.compiled import compiled_library
from armdyn.dynamics import Dynamics
from armdyn.optimal.mesh.stages import StageFunctions
from armdyn.optimal.mesh.stagewise.solver import _source, stagewise_library
from problems import paper_arm

pytestmark = pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler")

N, JOINTS = 4, 2
STATE, BLOCK = 2 * JOINTS, 3 * JOINTS
WIDTH, SIZE = 5 * JOINTS + 1, BLOCK * N + STATE + 1
NEWTON = """
int newton_step(int N, int bounded, double *J, const double *Jm, const double *H, double *sigma,
                const char *is_free, const double *d, const double *c, double *dw, double *dlam) {
    Program nlp = program_of(N, NULL, bounded);
    End end;
    nlp.stages = calloc(N, sizeof *nlp.stages), nlp.reduced = calloc(nlp.size, sizeof *nlp.reduced);
    nlp.sigma = sigma, nlp.is_free = is_free;
    for (int k = 0; k < N; k++) {
        solve_for_next(nlp.stages + k, (double(*)[NY])(J + k * NX * NY));
        memcpy(nlp.stages[k].Jm, Jm + k * NX * NY, sizeof nlp.stages[k].Jm);
        memcpy(nlp.stages[k].H, H + k * NY * (NY + 1) / 2, sizeof nlp.stages[k].H);
    }
    int found = factor(&nlp, &end);
    if (found) step(&nlp, &end, d, c, dw, dlam);
    free(nlp.stages), free(nlp.reduced);
    return found;
}
"""


@pytest.fixture(scope="module")
def newton_step(tmp_path_factory):
    """The Riccati recursion alone: (J, Jm, H, sigma, is_free, d, c) to step and multipliers, or None."""
    one = StageFunctions.of(Dynamics(paper_arm("rr"), free_last_body=True))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ARMDYN_CACHE", str(tmp_path_factory.mktemp("cache")))
        library = compiled_library(_source(JOINTS, one) + NEWTON, 3000, True)

    def call(*given):
        *_, d, c = given
        dw, dlam = np.empty(d.size), np.empty(c.size)
        given = [np.ascontiguousarray(array) for array in given]
        pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (*given, dw, dlam)]
        return (dw, dlam) if library.newton_step(N, d.size > SIZE, *pointers) else None

    return call


def equations(seed, curvature):
    """Random J, of equations and of middles, and H of all intervals; the three of the whole program's free unknowns."""
    random = np.random.default_rng(seed)
    J = 0.3 * random.normal(size=(N, STATE, WIDTH))
    J[:, :, :STATE] -= np.eye(STATE)
    J[:, :, BLOCK : BLOCK + STATE] += np.eye(STATE)
    half = random.normal(size=(N, WIDTH, WIDTH))
    H = half + half.transpose(0, 2, 1) + curvature * np.eye(WIDTH)
    Jm = random.normal(size=J.shape)
    A, M, W = np.zeros((STATE * N, SIZE)), np.zeros((STATE * N, SIZE)), np.zeros((SIZE, SIZE))
    for k in range(N):
        places = [*range(BLOCK * k, BLOCK * k + WIDTH - 1), SIZE - 1]
        A[STATE * k : STATE * (k + 1), places] = J[k]
        M[STATE * k : STATE * (k + 1), places] = Jm[k]
        W[np.ix_(places, places)] += H[k]
    free = np.r_[STATE : BLOCK * N, SIZE - 1]
    return (J, Jm, H[:, *np.tril_indices(WIDTH)]), (A[:, free], M[:, free], W[np.ix_(free, free)]), free, random


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_step_is_that_of_the_whole_matrix(newton_step, seed):
    parts, (A, _, W), free, random = equations(seed, 12.0)
    d, c, sigma = random.normal(size=SIZE), random.normal(size=STATE * N), random.uniform(0, 2, SIZE)
    matrix = np.block([[W + np.diag(sigma[free]), A.T], [A, np.zeros((STATE * N, STATE * N))]])
    expected = np.linalg.solve(matrix, -np.concatenate([d[free], c]))
    dw, dlam = newton_step(*parts, sigma, np.ones(SIZE, dtype=np.int8), d, c)
    held = np.setdiff1d(np.arange(SIZE), free)
    assert np.all(dw[held] == 0)
    # Rounding times the matrix's condition, some 1e3, and HELD, 1e4.
    np.testing.assert_allclose(np.concatenate([dw[free], dlam]), expected, atol=1e-9 * np.max(np.abs(expected)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_step_with_slacks_is_that_of_the_whole_matrix(newton_step, seed):
    parts, (A, M, W), free, random = equations(seed, 12.0)
    rows = STATE * N
    d, c, sigma = random.normal(size=SIZE + rows), random.normal(size=2 * rows), random.uniform(0, 2, SIZE + rows)
    is_free = np.append(np.ones(SIZE), random.integers(0, 2, rows)).astype(np.int8)
    some = np.flatnonzero(is_free[SIZE:])
    slack, none = np.eye(some.size), np.zeros
    gradient = np.concatenate([d[free], d[SIZE + some]])
    J = np.block([[A, none((rows, some.size))], [M[some], -slack]])
    whole = np.block([[W, none((free.size, some.size))], [none((some.size, free.size)), none((some.size, some.size))]])
    whole += np.diag(np.concatenate([sigma[free], sigma[SIZE + some]]))
    matrix = np.block([[whole, J.T], [J, none((len(J), len(J)))]])
    expected = np.linalg.solve(matrix, -np.concatenate([gradient, c[:rows], c[rows + some]]))
    dw, dlam = newton_step(*parts, sigma, is_free, d, c)
    found = np.concatenate([dw[free], dw[SIZE + some], dlam[:rows], dlam[rows + some]])
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.max(np.abs(expected)))  # as above
    assert np.all(dw[SIZE:][is_free[SIZE:] == 0] == 0) and np.all(dlam[rows:][is_free[SIZE:] == 0] == 0)


@pytest.mark.slow
def test_factors_exist_where_the_curvature_is_a_minimums(newton_step):
    judged = []
    for seed in range(60):
        parts, (A, _, W), _, _ = equations(seed, curvature=2.0)
        along = null_space(A)
        least = np.min(np.linalg.eigvalsh(along.T @ W @ along))
        nothing, is_free = np.zeros(SIZE), np.ones(SIZE, dtype=np.int8)
        there = newton_step(*parts, nothing, is_free, nothing, np.zeros(STATE * N)) is not None
        judged.append((least > 0, there))
        # HELD is a number: curvature below its inverse may count as of the wrong sign.
        assert there == (least > 0) or abs(least) < 1e-2
    assert len(set(judged)) >= 2  # both kinds were there


def test_functions_without_a_library():
    dynamics = Dynamics(paper_arm("rr"), free_last_body=True)
    assert stagewise_library(dynamics, False) is None
    assert stagewise_library(dynamics, True) is stagewise_library(dynamics, True)
