"""Structures: conversion from and to arcs, removed and inserted segments, free torques as full ones."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.arcs.arc import Arc, Mode
from armdyn.optimal.switching.extremal.change import Change, Segment, SingularControl
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.from_arcs import banged
from problems import solved

U, L, F, P = Mode.UPPER, Mode.LOWER, Mode.FREE, Mode.POSITION_UPPER


def motion(duration, joints):
    t = np.linspace(0, duration, 11)
    return ad.Trajectory(t, np.outer(t, np.ones(joints)), np.ones((11, joints)), np.zeros((11, joints)))


def structure(arcs):
    return SwitchingStructure.of(arcs, motion(sum(arc.duration for arc in arcs), len(arcs[0].modes)))


@pytest.mark.parametrize("arm", ["r", "rr"])
def test_arcs_of_an_optimum_come_back(arm):
    phases = solved(arm).phases
    back = SwitchingStructure.of(phases.arcs, phases.torques).arcs(1e-7)
    assert [arc.modes for arc in back] == [arc.modes for arc in phases.arcs]
    np.testing.assert_allclose([arc.duration for arc in back], [arc.duration for arc in phases.arcs], rtol=1e-12)


def test_touches_and_changes_at_one_time_come_back():
    arcs = [Arc(1.0, (U, L), ((1, P),)), Arc(0.5, (U, L)), Arc(1.5, (L, U))]
    given = structure(arcs)
    assert [(change.joint, change.mode, change.touch) for change in given.changes] == [
        (1, P, True), (0, L, False), (1, U, False),
    ]  # fmt: skip
    assert given.arcs(1e-7) == arcs
    np.testing.assert_array_equal(given.unknowns, [1.0, 1.5, 1.5, 3.0])
    np.testing.assert_allclose(given.states[:, :2], [[1, 1], [1.5, 1.5], [1.5, 1.5]])


def test_a_segment_that_is_taken_out_keeps_its_neighbours():
    given = structure([Arc(1.0, (U, L)), Arc(0.1, (L, L)), Arc(1.0, (U, L)), Arc(1.0, (U, U))])
    left = given.without([Segment(0, 1)])
    assert left.arcs(1e-7) == [Arc(2.1, (U, L)), Arc(1.0, (U, U))]
    begun = given.without([Segment(-1, 0)])
    assert begun.first == (L, L)
    assert [change.mode for change in begun.changes] == [U, U]
    in_one_piece = given.without([Segment(2, 3)])
    assert [arc.modes for arc in in_one_piece.arcs(1e-7)] == [(U, L), (L, L), (U, L)]


def test_a_singular_control_at_the_start_keeps_the_change_that_begins_it():
    control = SingularControl((1.0,))
    given = structure([Arc(1.0, (U, L)), Arc(1.0, (L, L))]).with_changes(
        [(0.01, Change(1, F, control=control), np.zeros(4))]
    )
    assert given.without([Segment(-1, 0)]).changes == given.changes


def test_changes_of_different_joints_pass_each_other():
    given = structure([Arc(1.0, (U, L)), Arc(1.0, (L, L)), Arc(1.0, (L, U))])
    moved = given.moved(np.array([1.5, 0.0, 0.0]), given.states)
    assert [arc.modes for arc in moved.arcs(1e-7)] == [(U, L), (U, U), (L, U)]
    np.testing.assert_array_equal(moved.times, [2.0, 2.5])
    np.testing.assert_array_equal(moved.states, given.states[::-1])


def test_a_singular_control_moves_with_its_change():
    given = structure([Arc(1.0, (U, L)), Arc(1.0, (L, L))]).with_changes(
        [(0.5, Change(1, F, control=SingularControl((1.0, 2.0))), np.zeros(4))]
    )
    assert given.width == 5
    np.testing.assert_array_equal(given.unknowns, [0.5, 1.0, 2.0, 1.0, 2.0])
    moved = given.moved(np.array([1.0, 0.0, 0.0, 0.25, -1.0]), given.states)
    assert moved.changes[1].control == SingularControl((1.25, 1.0))
    assert moved.places == {1: slice(3, 5)}


@pytest.mark.parametrize(("before", "after"), [(U, L), (L, U), (U, U), (L, L)])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.8])
def test_full_torques_have_the_mean_of_a_free_one(before, after, share):
    arcs = [Arc(1.0, (before,)), Arc(2.0, (F,)), Arc(1.0, (after,))]
    full = banged(arcs, np.array([[0.0], [share], [0.0]]))
    edges = np.cumsum([0.0, *(arc.duration for arc in full)])
    above = sum(
        max(0.0, min(b, 3.0) - max(a, 1.0))
        for arc, a, b in zip(full, edges, edges[1:], strict=False)
        if arc.modes == (U,)
    )
    assert above == pytest.approx(2 * share)
    assert edges[-1] == pytest.approx(4.0)
    assert all(F not in arc.modes for arc in full)
