import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armdyn.errors import ArmdynError, TrajectoryError
from armdyn.trajectory import Trajectory

T = np.array([0.0, 0.3, 1.0, 1.1])
CUBICS = np.array([[0.1, 1.0, -2.0, 0.7], [2.0, 0.0, 0.5, -1.0]])  # per joint, lowest power first


def position(t):
    return np.stack([np.polynomial.polynomial.polyval(t, c) for c in CUBICS], axis=-1)


def velocity(t):
    slopes = [np.polynomial.polynomial.polyder(c) for c in CUBICS]
    return np.stack([np.polynomial.polynomial.polyval(t, c) for c in slopes], axis=-1)


def torque(t):
    return np.stack([1.0 - 2.0 * np.asarray(t), 3.0 * np.asarray(t)], axis=-1)


@pytest.fixture
def motion():
    return Trajectory(t=T, q=position(T), v=velocity(T), tau=torque(T), joint_names=("one", "zwei"), name="motion")


def test_cubics_and_linear_torques_are_met_exactly(motion):
    times = np.linspace(0.0, 1.1, 57)
    sample = motion(times)
    # Some ten roundings of numbers of order one; the velocity divides a difference by steps of 0.1.
    assert np.allclose(sample.q, position(times), rtol=0, atol=1e-14)
    assert np.allclose(sample.v, velocity(times), rtol=0, atol=1e-13)
    assert np.allclose(sample.tau, torque(times), rtol=0, atol=1e-14)


def test_samples_come_back_to_the_bit_except_the_last(motion):
    sample = motion(T[:-1])
    assert np.array_equal(sample.q, motion.q[:-1])
    assert np.array_equal(sample.tau, motion.tau[:-1])
    assert np.allclose(motion(T[-1]).q, motion.q[-1], rtol=1e-15)


def test_shapes_follow_the_times(motion):
    assert motion(0.5).q.shape == (2,)
    assert motion([0.5]).v.shape == (1, 2)
    assert motion(np.zeros((4, 3))).tau.shape == (4, 3, 2)


def test_ends_are_held(motion):
    assert np.array_equal(motion(-1.0).q, motion.q[0])
    assert np.array_equal(motion(5.0).tau, motion(1.1).tau)


def test_jump_of_one_ulp():
    """A torque that switches from +3 to -3 at once, told by two samples one ulp apart."""
    switch = 0.5
    after = np.nextafter(switch, 1.0)
    t = [0.0, switch, after, 1.0]
    v = [0.0, 1.5, 1.5, 0.0]
    q = [0.0, 0.375, 0.375, 0.75]
    bang = Trajectory(t=t, q=np.reshape(q, (4, 1)), v=np.reshape(v, (4, 1)), tau=[[3.0], [3.0], [-3.0], [-3.0]])
    assert bang(np.array([0.0, 0.25, switch, after, 0.75, 1.0])).tau.ravel().tolist() == [3, 3, 3, -3, -3, -3]
    times = np.linspace(0, 1, 41)
    sample = bang(times)
    expected = np.where(times < switch, 1.5 * times**2, 0.75 - 1.5 * (1 - times) ** 2)
    assert np.allclose(sample.q.ravel(), expected, rtol=0, atol=1e-15)
    assert np.all(np.isfinite(sample.v))
    assert sample.v.max() <= 1.5


def test_duration_and_joints(motion):
    assert motion.duration == 1.1
    assert replace(motion, t=T + 5.0).duration == pytest.approx(1.1, rel=1e-15)


def test_it_is_a_value(motion):
    with pytest.raises(ValueError, match="read-only"):
        motion.q[0, 0] = 1.0
    mine = T.copy()
    copied = replace(motion, t=mine)
    mine[0] = -1.0
    assert copied.t[0] == 0.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"t": [0.0]}, "at least two increasing times"),
        ({"t": 1.0}, "at least two increasing times"),
        ({"t": [0.0, 0.3, 0.3, 1.0]}, "increasing"),
        ({"t": [0.0, 1.0, 0.5, 2.0]}, "increasing"),
        ({"t": [0.0, 0.5, 1.0]}, r"q has shape \(4, 2\); expected \(3, joints\)"),
        ({"t": [0.0, 0.5, np.nan, 1.0]}, "t has a value that is not finite"),
        ({"q": np.full((4, 2), np.inf)}, "q has a value that is not finite"),
        ({"q": np.zeros(4)}, "q has shape"),
        ({"v": np.zeros((3, 2))}, "v has shape"),
        ({"tau": np.zeros((4, 3))}, r"v has shape \(4, 2\) but tau \(4, 3\)"),
        ({"tau": np.full((4, 2), np.nan)}, "tau has a value"),
        ({"joint_names": ("one",)}, "1 joint names for 2 joints"),
        ({"q": "up"}, "q is not an array of numbers"),
        ({"v": [[1.0, 2.0], [3.0]]}, "v is not an array of numbers"),
    ],
)
def test_arrays_must_fit(motion, changes, words):
    with pytest.raises(TrajectoryError, match=words):
        replace(motion, **changes)


def same(a, b):
    arrays = all(np.array_equal(getattr(a, x), getattr(b, x)) for x in ("t", "q", "v", "tau"))
    return arrays and (a.name, a.joint_names) == (b.name, b.joint_names)


def test_round_trip(motion, tmp_path):
    path = tmp_path / "motion.npz"
    assert motion.save(path) == path
    assert same(Trajectory.load(path), motion)
    assert same(Trajectory.load(str(path)), motion)


def test_round_trip_without_names(motion, tmp_path):
    bare = replace(motion, joint_names=(), name="")
    assert same(Trajectory.load(bare.save(tmp_path / "bare.npz")), bare)


def test_suffix_is_as_given(motion, tmp_path):
    motion.save(tmp_path / "motion")
    assert [path.name for path in tmp_path.iterdir()] == ["motion"]


def test_save_overwrites_and_leaves_nothing_else(motion, tmp_path):
    path = tmp_path / "motion.npz"
    motion.save(path)
    replace(motion, name="second").save(path)
    assert Trajectory.load(path).name == "second"
    assert list(tmp_path.iterdir()) == [path]
    assert path.stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize("failing", ["savez_compressed", "replace"])
def test_failed_save_keeps_the_old_file(motion, tmp_path, monkeypatch, failing):
    path = tmp_path / "motion.npz"
    motion.save(path)

    def fail(*_, **__):
        raise OSError("disk full")

    monkeypatch.setattr(np if failing == "savez_compressed" else Path, failing, fail)
    with pytest.raises(OSError, match="disk full"):
        replace(motion, name="second").save(path)
    monkeypatch.undo()
    assert Trajectory.load(path).name == "motion"
    assert list(tmp_path.iterdir()) == [path]


def test_save_to_no_folder(motion, tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        motion.save(tmp_path / "nowhere" / "motion.npz")


class Mischief:
    def __reduce__(self):
        return (pytest.fail, ("a pickle was executed",))


def write(path, **changes):
    content = {
        "format": "armdyn-trajectory-1",
        "name": "x",
        "joint_names": np.array([], dtype=str),
        "t": T,
        "q": position(T),
        "v": velocity(T),
        "tau": torque(T),
    } | changes
    np.savez(path, **{key: value for key, value in content.items() if value is not None})


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"format": "other-1"}, "not a trajectory of format"),
        ({"format": None}, "not a trajectory of format"),
        ({"tau": None}, "not a readable npz trajectory"),
        ({"joint_names": None}, "not a readable npz trajectory"),
        ({"q": np.zeros((3, 2))}, "q has shape"),
        ({"t": T[::-1]}, "increasing"),
        ({"q": np.array([["a"] * 2] * 4)}, "not an array of numbers"),
        ({"q": np.full((4, 2), 1 + 1j)}, "not an array of numbers"),
        ({"v": np.full((4, 2), np.nan)}, "not finite"),
        ({"q": np.array([[Mischief()] * 2] * 4, dtype=object)}, "not a readable npz trajectory"),
        ({"joint_names": np.array([Mischief()], dtype=object)}, "not a readable npz trajectory"),
    ],
)
def test_load_refuses(tmp_path, changes, words):
    path = tmp_path / "bad.npz"
    write(path, **changes)
    with pytest.raises(TrajectoryError, match=words) as caught:
        Trajectory.load(path)
    assert str(caught.value).startswith(str(path))
    assert str(caught.value).count(str(path)) == 1


def test_load_of_no_npz(tmp_path):
    path = tmp_path / "x.npz"
    with pytest.raises(TrajectoryError, match="no such file"):
        Trajectory.load(path)
    with pytest.raises(TrajectoryError, match="not a readable"):
        Trajectory.load(tmp_path)
    for garbage in (b"", b"garbage", b"PK\x03\x04 cut off", b"\x80\x04N."):
        path.write_bytes(garbage)
        with pytest.raises(TrajectoryError, match="not a readable"):
            Trajectory.load(path)
    np.save(tmp_path / "x.npy", T)
    with pytest.raises(TrajectoryError, match="not a readable"):
        Trajectory.load(tmp_path / "x.npy")
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("hello.txt", "hello")
    with pytest.raises(TrajectoryError, match="not a trajectory of format"):
        Trajectory.load(path)


def test_damaged_files_raise_nothing_else(motion, tmp_path):
    """Bytes flipped at random: the checksums tell, or it is read."""
    rng = np.random.default_rng(0)
    path = motion.save(tmp_path / "motion.npz")
    good = path.read_bytes()
    for _ in range(400):
        data = bytearray(good[: rng.integers(1, len(good) + 1)] if rng.random() < 0.2 else good)
        for at in rng.integers(0, len(data), 3):
            data[at] = rng.integers(0, 256)
        path.write_bytes(data)
        try:
            Trajectory.load(path)
        except ArmdynError as error:
            assert str(path) in str(error)
