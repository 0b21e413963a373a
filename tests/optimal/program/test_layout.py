"""Where what stands: every unknown, equation and parameter has one name."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armdyn.dynamics import Dynamics
from armdyn.optimal.program.assembly import build_nlp
from armdyn.optimal.program.layout import CondensedLayout, Layout, Parameters
from armdyn.optimal.task.scheme import Scheme
from armdyn.optimal.task.tableau import TABLEAUS
from problems import paper_arm

SCHEMES = st.builds(
    Scheme,
    st.sampled_from(sorted(TABLEAUS)),
    st.sampled_from(["linear", "constant", "stage"]),
    st.sampled_from(["forward", "inverse"]),
)
LAYOUTS = st.builds(Layout, st.integers(1, 4), SCHEMES)
COUNT = st.integers(1, 6)


def once(parts, size):
    """Every number below a size stands in one of the parts, and once."""
    return np.array_equal(np.sort(np.concatenate([np.ravel(part) for part in parts])), np.arange(size))


@given(LAYOUTS, COUNT)
def test_every_unknown_has_one_name(layout, N):
    knot, inner = layout.knot, layout.inner
    accelerations = layout.inners(N)[:, inner.accelerations]
    linear = layout.knots(N)[:, knot.torque]
    parts = (layout.states(N), layout.times(N), linear, layout.inner_states(N), layout.torques(N), accelerations)
    assert once(parts, layout.size(N))
    assert once((layout.knots(N), layout.inners(N)), layout.size(N))
    assert once([np.arange(knot.size)[s] for s in (knot.q, knot.v, knot.torque)] + [[knot.time]], knot.size)


@given(LAYOUTS, COUNT, st.integers(0, 2**16))
def test_blocks_come_apart_and_together(layout, N, seed):
    x = np.random.default_rng(seed).normal(size=layout.size(N))
    knots, inner = layout.split(x)
    assert len(knots) == N + 1 and len(inner) == N
    np.testing.assert_array_equal(layout.joined(knots, inner), x)
    np.testing.assert_array_equal(x[layout.knots(N)], knots)
    np.testing.assert_array_equal(x[layout.inners(N)], inner)


@given(LAYOUTS, COUNT)
def test_intervals_share_their_knots(layout, N):
    index = layout.intervals(N)
    np.testing.assert_array_equal(index[layout.block :, :-1], index[: layout.knot.size, 1:])
    first, own, last = layout.parts(index[:, -1])
    np.testing.assert_array_equal(np.concatenate([first, own, last]), index[:, -1])
    np.testing.assert_array_equal(last, layout.knots(N)[-1])


@given(LAYOUTS)
def test_every_equation_says_what_it_is(layout):
    said = [layout.equation(row) for row in range(layout.equations.size - 1)]
    n = layout.nv
    assert all(0 <= joint < n for _, joint in said)
    words = [word for word, _ in said]
    assert words.count("position defect") == words.count("velocity defect") == layout.defects.size // 2
    stages = layout.scheme.tableau.c.size
    assert words.count("equation of motion") == (n * stages if layout.scheme.dynamics == "inverse" else 0)


@pytest.mark.parametrize("form", ["forward", "inverse"])
@pytest.mark.parametrize("control", ["linear", "constant", "stage"])
def test_the_program_has_as_many_unknowns_and_equations(control, form):
    scheme = Scheme("radau3", control, form, compile=False)
    nlp = build_nlp(Dynamics(paper_arm("rr"), free_last_body=True), scheme, 3)
    assert nlp.functions["x"].numel() == nlp.layout.size(3)
    assert nlp.functions["g"].numel() == 3 * nlp.layout.equations.size
    assert nlp.functions["p"].numel() == Parameters.size(2, 3)


@given(st.integers(1, 4), COUNT, st.sampled_from(["linear", "constant"]))
def test_a_condensed_program_leaves_out_what_follows(nv, N, control):
    full = Layout(nv, Scheme("lobatto3", control))
    condensed, x = CondensedLayout(full), np.arange(full.size(N), dtype=float)
    x[full.times(N)] = x[full.times(N)[0]]
    w = x[condensed.kept(N)]
    np.testing.assert_array_equal(condensed.expanded(w, x[full.inner_states(N)][:, 0].T), x)
    index = condensed.intervals(N)
    assert once([np.unique(index)], w.size)
    begin, _, end, _, time = condensed.parts(index)
    np.testing.assert_array_equal(end[:, :-1], begin[:, 1:])
    assert np.all(time == w.size - 1)


@given(st.integers(1, 4), COUNT)
def test_parameters_keep_their_names(joints, N):
    numbers = np.arange(Parameters.size(joints), dtype=float)
    by_name = Parameters.of(numbers, joints)
    np.testing.assert_array_equal(by_name.packed(), numbers)
    assert len(by_name.last_body) == 10 and len(by_name.weights) == len(by_name.effort) == joints
    many = Parameters(np.full(N, 1 / N), *(getattr(by_name, name) for name in list(by_name.__dict__)[1:])).packed()
    assert many.size == Parameters.size(joints, N)
