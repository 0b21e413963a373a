"""Every number has one name, and every name its place."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armdyn.dynamics import Dynamics
from armdyn.optimal.mesh.assembly import interval_functions
from armdyn.optimal.mesh.layout import Layout, Parameters
from armdyn.optimal.problem.options import Scheme
from problems import paper_arm

CONTROLS = ["linear", "constant"]
SCHEMES = st.builds(Scheme, st.sampled_from(CONTROLS))
LAYOUTS = st.builds(Layout, st.integers(1, 7), SCHEMES)


def places(fields, *names):
    """Where fields are in a block, one after the other."""
    slots = [getattr(fields, name) for name in names]
    return np.concatenate([np.arange(fields.size)[slot].ravel() for slot in slots])


@given(LAYOUTS)
def test_fields_fill_their_blocks_without_gap_or_overlap(layout):
    knot = layout.knot
    np.testing.assert_array_equal(places(knot, "q", "v", "time", "torque"), np.arange(knot.size))
    np.testing.assert_array_equal(places(layout.knot, "state"), places(layout.knot, "q", "v"))


@given(LAYOUTS, st.integers(1, 5))
def test_blocks_fill_the_unknowns_and_intervals_share_their_knots(layout, N):
    knots, inners, intervals = layout.knots(N), layout.inners(N), layout.intervals(N)
    every = np.sort(np.concatenate([knots.ravel(), inners.ravel()]))
    np.testing.assert_array_equal(every, np.arange(layout.size(N)))
    for k in range(N):
        parts = knots[k], inners[k], knots[k + 1]
        np.testing.assert_array_equal(intervals[:, k], np.concatenate(parts))
        for mine, part in zip(layout.parts(intervals[:, k]), parts, strict=True):
            np.testing.assert_array_equal(mine, part)
    kinds = layout.states(N), layout.times(N), layout.middles(N), layout.torques(N)
    named = np.concatenate([kind.ravel() for kind in kinds])
    np.testing.assert_array_equal(np.sort(named), np.arange(layout.size(N)))


@given(LAYOUTS, st.integers(1, 5))
def test_every_unknown_is_in_one_block(layout, N):
    knots, inners = layout.knots(N), layout.inners(N)
    assert knots.shape == (N + 1, layout.knot.size) and inners.shape == (N, layout.block - layout.knot.size)
    every = np.sort(np.concatenate([knots.ravel(), inners.ravel()]))
    np.testing.assert_array_equal(every, np.arange(layout.size(N)))


@pytest.mark.parametrize("control", CONTROLS)
def test_there_are_as_many_equations_as_an_interval_has(control):
    scheme = Scheme(control, compile=False)
    layout = Layout(2, scheme)
    one = interval_functions(Dynamics(paper_arm("rr"), free_last_body=True), scheme)
    assert one.defects.numel_out(0) == layout.rows


def test_equations_by_their_names():
    layout = Layout(2, Scheme("constant"))
    assert layout.equation(1) == ("position defect", 1)
    assert layout.equation(layout.rows - 2) == ("velocity defect", 1)


@given(st.integers(1, 7), st.integers(1, 5))
def test_condensed_unknowns_are_the_others_without_middles_and_repeated_times(joints, N):
    layout = Layout(joints, Scheme("constant"))
    kept, knots, torques = layout.condensed(N), layout.knots(N), layout.torques(N)
    expected = [part for k in range(N) for part in (knots[k, layout.knot.state], torques[k])]
    expected += [knots[N, layout.knot.state], [layout.knot.time]]
    np.testing.assert_array_equal(kept, np.concatenate(expected))
    left_out = np.concatenate([layout.middles(N).ravel(), layout.times(N)[1:]])
    np.testing.assert_array_equal(np.sort(np.append(kept, left_out)), np.arange(layout.size(N)))


@given(st.integers(1, 7), st.integers(1, 5))
def test_parameters_by_name_are_the_same_for_numbers_and_symbols(joints, N):
    fractions, rest = np.arange(1.0, N + 1), np.arange(100.0, 100.0 + Parameters.size(joints) - 1)
    given_ = Parameters.of(np.append(0.0, rest), joints)
    p = Parameters(fractions, *(getattr(given_, name) for name in list(Parameters.__annotations__)[1:])).packed()
    assert p.size == Parameters.size(joints, N)
    columns = p[Parameters.by_interval(joints, N)]
    one = ca.SX.sym("p", Parameters.size(joints))
    for k in range(N):
        for name in Parameters.__annotations__:
            number = getattr(Parameters.of(columns[:, k], joints), name)
            value = ca.Function("one", [one], [getattr(Parameters.of(one, joints), name)])(columns[:, k])
            np.testing.assert_array_equal(value.full().ravel(), np.ravel(number))
            np.testing.assert_array_equal(number, fractions[k] if name == "fraction" else getattr(given_, name))
