import json
from dataclasses import replace

import numpy as np
import pytest

from armdyn.errors import TrajectoryError
from armdyn.trajectory import Load, Piece, Trajectory

ARRAYS = ("t", "q", "v", "tau")
PART = Load(1.5, (0.0, 0.0, 0.1), (1e-3, 2e-3, 1.5e-3), "tool0", Load(2.0, (0.0, 0.0, 0.12), frame="tool0"))


def bang(distance=0.75, start=0.0, name="bang", model_hash="bare", begin=0.0):
    """From rest to rest under +3 and -3 of a unit mass, with a jump in the middle."""
    half = np.sqrt(distance / 3)
    switch = begin + half
    t = [begin, switch, np.nextafter(switch, np.inf), begin + 2 * half]
    q = start + distance * np.array([[0.0], [0.5], [0.5], [1.0]])
    v = np.array([[0.0], [3 * half], [3 * half], [0.0]])
    return Trajectory(t, q, v, [[3.0], [3.0], [-3.0], [-3.0]], ("slide",), name, model_hash)


def equal(a, b):
    return all(np.array_equal(getattr(a, field), getattr(b, field)) for field in ARRAYS) and a.pieces == b.pieces


@pytest.fixture
def cycle():
    """There, a dwell, and back with a part."""
    dwell = Trajectory.at_rest([0.75], [2.0], 0.2, ("slide",), model_hash="with part")
    back = bang(-0.75 * -1, name="back", model_hash="with part")
    back = replace(back, q=1.5 - back.q - 0.75 + 0.0, v=-back.v, tau=-back.tau)
    there = bang(name="there").as_piece()
    return there + dwell.as_piece(name="grasp", load=PART, event="grasp") + back.as_piece(load=PART)


def test_a_joined_motion_has_the_samples_of_both_one_ulp_apart():
    first, second = bang(), bang(0.3, start=0.75, name="on", begin=2.0)
    whole = first + second
    n = first.t.size
    assert np.array_equal(whole.t[:n], first.t) and whole.t[n] == np.nextafter(first.t[-1], np.inf)
    assert whole.duration == pytest.approx(first.duration + second.duration, rel=1e-15)
    assert np.array_equal(whole.q, np.vstack([first.q, second.q]))
    assert np.array_equal(whole.tau, np.vstack([first.tau, second.tau]))
    assert whole.jumps.tolist() == [False, True, False, True, False, True, False]  # the second's jump stays one
    assert [piece.name for piece in whole.pieces] == ["bang", "on"] and whole.pieces[1].start == whole.t[n]
    assert whole.name == "bang" and whole.model_hash == "bare" and whole.model_hashes == {"bare"}
    assert whole(first.t[-1]).tau == -3 and whole(whole.t[n]).tau == 3


def test_jumps_stay_jumps_wherever_they_are_moved():
    late = bang(begin=1e6)
    assert late.jumps.sum() == 1
    moved = bang(1e-6, start=-1e-6, model_hash="") + replace(late, q=late.q)
    assert moved.jumps.sum() == 3
    early = replace(bang(), t=bang().t) + bang(start=0.75)
    far = bang(start=0.0, begin=1e9) + bang(start=0.75)
    assert early.jumps.sum() == far.jumps.sum() == 3
    assert (bang(begin=-1.0) + bang(start=0.75)).duration > 1.0  # the first one ends at 0


def test_pieces_of_other_models_leave_the_whole_without_one(cycle):
    assert cycle.model_hash == "" and cycle.model_hashes == {"bare", "with part"}
    assert [(p.name, p.event, p.load) for p in cycle.pieces] == [
        ("there", "", None), ("grasp", "grasp", PART), ("back", "", PART),
    ]  # fmt: skip
    assert "3 pieces" in repr(cycle)


def test_the_parts_are_the_motions_again(cycle):
    there, grasp, back = cycle.split()
    assert np.array_equal(there.t, bang().t) and there.model_hash == "bare" and there.name == "there"
    assert grasp.duration == pytest.approx(0.2) and grasp.model_hash == back.model_hash == "with part"
    assert equal(there + grasp + back, cycle)
    assert bang().split()[0].pieces == ()


@pytest.mark.parametrize(("begin", "end"), [(0.1, 0.7), (0.5, 1.3), (None, 0.4), (1.2, None), (1.05, 1.06)])
def test_a_slice_is_the_same_motion(cycle, begin, end):
    part = cycle.slice(begin, end)
    low, high = begin or cycle.t[0], end or cycle.t[-1]
    assert (part.t[0], part.t[-1]) == pytest.approx((low, high), rel=1e-15)  # at a jump one ulp inside
    at = np.linspace(low, high, 201)
    at = at[np.min(np.abs(at[:, None] - cycle.t), axis=1) > 1e-12]
    for one, other in zip(part(at), cycle(at), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-13)
    inside = [piece for piece in cycle.pieces if piece.start > low and piece.start < high]
    assert [piece.start for piece in part.pieces] == [part.t[0], *(piece.start for piece in inside)]
    if low < 0.5 < high:
        assert part.switch_times[0][0] == cycle.switch_times[0][0]


def test_a_slice_at_a_jump_keeps_the_inner_side():
    motion = bang()
    assert motion.slice(None, 0.5).tau.ravel().tolist() == motion.slice(0, motion.t[2]).tau.ravel().tolist() == [3, 3]
    assert motion.slice(0.5).tau.ravel().tolist() == motion.slice(motion.t[2]).tau.ravel().tolist() == [-3, -3]
    held = replace(motion, hold="zero-order")
    assert equal(held.slice(), held)


@pytest.mark.parametrize(("begin", "end"), [(0.5, 0.5), (0.7, 0.2), (-0.1, 0.5), (0.1, 2.0), (float("nan"), 1)])
def test_a_slice_is_within_the_motion(begin, end):
    with pytest.raises(TrajectoryError, match=r"begin is .* and end .*; expected increasing times within|begin is nan"):
        bang().slice(begin, end)


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (
            bang(start=0.7501, name="next"),
            "next does not start where bang ends: position of slide is 0.75 at the end and 0.7501 at the start, 0.0001",
        ),
        (
            replace(bang(start=0.75), v=bang().v - 0.1),
            "velocity of slide is 0 at the end and -0.1 at the start, 0.1 rad/s",
        ),
        (replace(bang(start=0.75), joint_names=("turn",)), "motions of other joints cannot be joined: slide; turn"),
        (
            replace(bang(start=0.75), hold="zero-order"),
            "torques are linear between samples and one whose torques are constant",
        ),
        (Trajectory.at_rest([0.75, 0], [0, 0], 1), "motions of 1 and 2 joints"),
    ],
)
def test_motions_that_do_not_follow_each_other_are_refused(other, words):
    with pytest.raises(TrajectoryError, match=words):
        bang() + other


def test_a_join_as_wide_as_the_tolerance():
    off = bang(start=0.7501)
    assert bang().join(off, tolerance=1e-3).t.size == 8
    assert (bang() + replace(off, q=off.q - 0.000095)).q[4] == pytest.approx(0.750005)  # states stay as they are
    with pytest.raises(TypeError):
        bang() + 3


def test_a_dwell():
    dwell = Trajectory.at_rest([1.0, 2.0], [3.0, 4.0], 0.5, ("a", "b"), name="wait", model_hash="x")
    assert dwell.duration == 0.5 and dwell(0.3).q.tolist() == [1, 2] and dwell(0.3).tau.tolist() == [3, 4]
    assert not dwell.v.any() and (dwell.name, dwell.model_hash) == ("wait", "x")
    with pytest.raises(TrajectoryError, match="duration is 0 s; it must be positive"):
        Trajectory.at_rest([1.0], [1.0], 0)
    with pytest.raises(TrajectoryError, match="expected one number per joint of both"):
        Trajectory.at_rest([1.0, 2.0], [1.0], 1)


@pytest.mark.parametrize(
    ("pieces", "words"),
    [
        ((Piece(0.1),), "the first 0 s, where the motion begins"),
        ((Piece(0.0), Piece(0.4)), "increasing times of samples"),
        ((Piece(0.0), Piece(1.0)), "before its end, 1 s"),
        ((Piece(0.0), Piece(0.5), Piece(0.5)), "increasing times of samples"),
        ((0.0,), r"pieces\[0\] is 0.0; it must be a Piece"),
        (Piece(0.0), "pieces"),
    ],
)
def test_pieces_follow_each_other(pieces, words):
    with pytest.raises(TrajectoryError, match=words):
        replace(bang(), pieces=pieces)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Load(-1.0), "load mass is -1.0 kg; it must be finite and not negative"),
        (lambda: Load(1.0, (0, 0)), r"load com is \[0.0, 0.0\]; it must be three finite numbers"),
        (
            lambda: Load(1.0, inertia=(1, np.nan, 0)),
            "load inertia is .* Ixx, Iyy, Izz and perhaps Ixy, Ixz, Iyz, finite",
        ),
        (lambda: Load(1e13), "at most 1e\\+12"),
        (lambda: Load(1.0, frame=3), "load frame is 3"),
        (lambda: Piece("soon"), "piece start is 'soon'"),
        (lambda: Piece(0.0, event=None), "piece event is None"),
        (lambda: Piece(0.0, load=1.0), "piece load is 1.0; it must be a Load"),
    ],
)
def test_loads_and_pieces_are_checked(make, words):
    with pytest.raises(TrajectoryError, match=words):
        make()


def test_an_inertia_in_three_forms():
    moments, matrix = Load(1.0, inertia=(1, 2, 3)), Load(1.0, inertia=np.diag([1.0, 2.0, 3.0]))
    assert moments == matrix == Load(1.0, inertia=(1, 2, 3, 0, 0, 0))


def test_pieces_are_saved(cycle, tmp_path):
    loaded = Trajectory.load(cycle.save(tmp_path / "cycle.npz"))
    assert equal(loaded, cycle) and loaded.pieces[1].load == PART
    assert Trajectory.load(bang().save(tmp_path / "plain.npz")).pieces == ()


@pytest.mark.parametrize(
    "pieces",
    [
        "", "{}", "[1]", "[{}]", '[{"start": 0.1}]', '[{"start": 0, "more": 1}]',
        '[{"start": 0, "load": {"mass": NaN}}]',
        '[{"start": 0, "load": {"mass": 1e308}}]', '[{"start": 0, "load": 3}]', "[" * 100_000, '[{"start": 1e999}]',
        '[{"start": 0, "name": "\\ud800"}]', '[{"start": 0, "load": {"mass": 1, "at_flange": 3}}]',
        json.dumps([{"start": 0}] * 5000), '[{"start": ' + "1" * 5000 + "}]",
    ],
)  # fmt: skip
def test_pieces_of_a_stranger_are_refused(cycle, tmp_path, pieces):
    path = cycle.save(tmp_path / "cycle.npz")
    with np.load(path) as file:
        members = dict(file)
    np.savez(path, **members | {"pieces": np.array(pieces)})
    with pytest.raises(TrajectoryError, match=r"cycle\.npz: ") as caught:
        Trajectory.load(path)
    assert len(str(caught.value)) < 700


def test_texts_too_long_for_a_file_are_not_saved(tmp_path):
    with pytest.raises(TrajectoryError, match="names and pieces are more than"):
        bang().as_piece(name="x" * 200_000).save(tmp_path / "long.npz")
    assert not list(tmp_path.iterdir())
