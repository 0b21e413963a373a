import io
import os
import subprocess
import sys
import tracemalloc
import warnings
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


@pytest.mark.parametrize("switch", [-3.5, -1e9, 2e-8, 1e9])
def test_a_jump_is_one_before_zero_too(switch):
    t = [switch - 1, switch, np.nextafter(switch, np.inf), switch + 1]
    rest = np.zeros((4, 1))
    motion = Trajectory(t, rest, rest, [[1.0], [1.0], [-1.0], [-1.0]])
    assert motion.jumps.tolist() == [False, True, False]
    assert motion.switch_times == ((switch,),)
    assert motion.resample().t.size == 3


@pytest.fixture
def motion():
    return Trajectory(
        t=T, q=position(T), v=velocity(T), tau=torque(T), joint_names=("one", "zwei"), name="motion", model_hash="ab"
    )


def test_cubics_and_linear_torques_are_met_exactly(motion):
    times = np.linspace(0.0, 1.1, 57)
    sample = motion(times)
    # Some ten roundings of numbers of order one; the velocity divides a difference by steps of 0.1.
    assert np.allclose(sample.q, position(times), rtol=0, atol=1e-14)
    assert np.allclose(sample.v, velocity(times), rtol=0, atol=1e-13)
    assert np.allclose(sample.tau, torque(times), rtol=0, atol=1e-14)


def test_a_held_torque_is_that_of_the_sample_before(motion):
    held = replace(motion, hold="zero-order")
    times = np.array([0.0, 1e-9, 0.2999, 0.3, 1.05, 1.1, 5.0])
    expected = held.tau[np.minimum(np.searchsorted(T, times, side="right") - 1, T.size - 2)]
    np.testing.assert_array_equal(held(times).tau, expected)
    np.testing.assert_array_equal(held(times).q, motion(times).q)
    np.testing.assert_array_equal(held.tau_end, held.tau[:-1])
    np.testing.assert_array_equal(motion.tau_end, motion.tau[1:])
    rate = 1 / (T[1] - T[0])
    assert held.resample().tau[:-1] == pytest.approx(held.tau[:-1], abs=1e-12)
    assert held.resample(rate).tau[0] == pytest.approx(held.tau[0], abs=1e-12)


def test_the_hold_is_saved_and_an_old_file_is_linear(motion, tmp_path):
    held = replace(motion, hold="zero-order")
    assert Trajectory.load(held.save(tmp_path / "held.npz")).hold == "zero-order"
    assert Trajectory.load(motion.save(tmp_path / "linear.npz")).hold == "linear"
    write(tmp_path / "before.npz")
    assert Trajectory.load(tmp_path / "before.npz").hold == "linear"
    write(tmp_path / "other.npz", hold="spline")
    with pytest.raises(TrajectoryError, match="hold is 'spline'; it is one of 'linear', 'zero-order'"):
        Trajectory.load(tmp_path / "other.npz")


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
    """A torque that switches from +3 to -3 at once, as two samples one ulp apart."""
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


def test_jumps_and_switch_times():
    """Both torques jump at 0.5 s, only the second one at 2 s; at 3 s samples lie close for nothing."""
    t = [0.0, 0.5, np.nextafter(0.5, 1), 2.0, 2.0 + 2 * np.spacing(2.0), 3.0, np.nextafter(3.0, 4), 4.0]
    tau = np.array([[1, 2], [1, 2], [-1, -2], [-1, -2], [-1, 2], [-1, 2], [-1, 2], [0, 0]])
    motion = Trajectory(t, np.zeros((8, 2)), np.zeros((8, 2)), tau)
    assert motion.jumps.tolist() == [False, True, False, True, False, True, False]
    assert motion.switch_times == ((0.5,), (0.5, 2.0))


def test_close_samples_are_no_jump():
    t = np.array([0.0, 1.0, 1.0 + 3 * np.spacing(1.0)])
    motion = Trajectory(t, np.zeros((3, 1)), np.zeros((3, 1)), [[0.0], [1.0], [2.0]])
    assert not motion.jumps.any()
    assert motion.switch_times == ((),)


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
        ({"t": [0.0, 0.3, 0.3, 1.0]}, "does not rise above"),
        ({"t": [0.0, 1.0, 0.5, 2.0]}, "does not rise above"),
        ({"t": [0.0, 0.5, 1.0]}, r"q has shape \(4, 2\); expected \(3, joints\)"),
        ({"t": [0.0, 0.5, np.nan, 1.0]}, "t has a value that is not finite"),
        ({"q": np.full((4, 2), np.inf)}, "q has a value that is not finite"),
        ({"q": np.zeros(4)}, "q has shape"),
        ({"v": np.zeros((3, 2))}, "v has shape"),
        ({"tau": np.zeros((4, 3))}, r"v has shape \(4, 2\) but tau \(4, 3\)"),
        ({"tau": np.full((4, 2), np.nan)}, "tau has a value"),
        ({"joint_names": ("one",)}, "1 joint names for 2 joints"),
        ({"q": "up"}, "q is .up.; expected an array of numbers"),
        ({"v": [[1.0, 2.0], [3.0]]}, "v is .*; expected an array of numbers"),
    ],
)
def test_arrays_must_fit(motion, changes, words):
    with pytest.raises(TrajectoryError, match=words):
        replace(motion, **changes)


def same(a, b):
    arrays = all(np.array_equal(getattr(a, x), getattr(b, x)) for x in ("t", "q", "v", "tau"))
    return arrays and (a.name, a.joint_names, a.model_hash) == (b.name, b.joint_names, b.model_hash)


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


UNITS = "t s; q rad or m; v rad/s or m/s; tau N m or N"


def content(**changes):
    good = {
        "format": "armdyn-trajectory-3",
        "units": UNITS,
        "name": "x",
        "model_hash": "abc",
        "hold": "linear",
        "pieces": "[]",
        "joint_names": np.array([], dtype=str),
        "t": T,
        "q": position(T),
        "v": velocity(T),
        "tau": torque(T),
    } | changes
    return {key: value for key, value in good.items() if value is not None}


def write(path, **changes):
    np.savez(path, **content(**changes))


def test_a_file_written_by_hand_is_read(tmp_path):
    write(tmp_path / "x.npz")
    assert Trajectory.load(tmp_path / "x.npz").model_hash == "abc"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"format": "other-1"}, "not a trajectory of format"),
        ({"format": None}, "not a trajectory of format"),
        ({"format": "armdyn-trajectory-4"}, "'armdyn-trajectory-4'; a newer armdyn may read it"),
        ({"format": np.array(["armdyn-trajectory-3"])}, "format has shape"),
        ({"hold": None}, "not a readable npz trajectory"),
        ({"pieces": None}, "not a readable npz trajectory"),
        ({"format": 2.0}, "format is of type"),
        ({"units": "t ms; q deg; v deg/s; tau N cm"}, "in units 't ms;"),
        ({"units": None}, "not a readable npz trajectory"),
        ({"more": T}, "not a readable npz trajectory: it holds"),
        ({"joint_names": np.array("one")}, "joint_names has shape"),
        ({"tau": None}, "not a readable npz trajectory"),
        ({"joint_names": None}, "not a readable npz trajectory"),
        ({"q": np.zeros((3, 2))}, "q has shape"),
        ({"t": T[::-1]}, "does not rise above"),
        ({"q": np.array([["a"] * 2] * 4)}, "expected an array of numbers"),
        ({"q": np.full((4, 2), 1 + 1j)}, "expected an array of numbers"),
        ({"v": np.full((4, 2), np.nan)}, "not finite"),
        ({"name": "\ud800"}, "not a readable npz trajectory"),
        ({"joint_names": np.array(["a", "\ud800"])}, "not a readable npz trajectory"),
        ({"x" * 60_000: T}, "not a readable npz trajectory: it holds"),
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
    assert str(caught.value).count(str(path)) == 1 and len(str(caught.value)) < 1000


def test_load_of_no_npz(tmp_path):
    path = tmp_path / "x.npz"
    with pytest.raises(TrajectoryError, match="no such file"):
        Trajectory.load(path)
    with pytest.raises(TrajectoryError, match=r"cannot be read \(it is a folder"):
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


@pytest.mark.parametrize("kind", ["a named pipe", "a device", "a folder"])
def test_irregular_files_are_neither_waited_for_nor_read(kind, tmp_path):
    path = Path("/dev/zero") if kind == "a device" else tmp_path / "motion.npz"
    if kind != "a device":
        os.mkfifo(path) if kind == "a named pipe" else path.mkdir()
    with pytest.raises(TrajectoryError, match=f"{path}: cannot be read .it is {kind}; give the path of a regular file"):
        Trajectory.load(path)


def test_a_file_larger_than_any_trajectory_is_not_read(tmp_path):
    path = tmp_path / "motion.npz"
    with path.open("wb") as file:
        file.truncate(2**40)  # a hole: it takes no room
    with pytest.raises(TrajectoryError, match="larger than"):
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


@pytest.mark.slow
def test_zip_bomb_is_refused_unread(tmp_path):
    """300 MiB of zeros in a third of a MiB of file."""
    path = tmp_path / "bomb.npz"
    write(path)
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (2**27, 1)})
    with zipfile.ZipFile(path) as good:
        parts = {name: good.read(name) for name in good.namelist() if name != "q.npy"}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as bomb:
        for name, data in parts.items():
            bomb.writestr(name, data)
        with bomb.open("q.npy", "w") as stream:
            stream.write(header.getvalue())
            for _ in range(300):
                stream.write(bytes(2**20))
    assert path.stat().st_size < 2**20
    tracemalloc.start()
    with pytest.raises(TrajectoryError, match="larger than"):
        Trajectory.load(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10 * 2**20  # the lists of the file and no array


@pytest.mark.parametrize(
    ("name", "descr", "shape", "words"),
    [
        ("joint_names", "<U1", (2**25,), "joint_names is larger than"),  # each a string of 50 bytes
        ("joint_names", "<U0", (10**12,), "is cut off"),
        ("format", f"<U{2**25}", (), "format is larger than"),
        ("q", "|u1", (2**26, 1), "larger than"),  # eight times as large as floats
    ],
)
def test_small_files_that_grow_in_memory_are_refused(tmp_path, name, descr, shape, words):
    path = tmp_path / "grows.npz"
    write(path, **{name: None})
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": descr, "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as file, file.open(f"{name}.npy", "w") as stream:
        stream.write(header.getvalue())
        for _ in range(int(np.dtype(descr).itemsize * np.prod(shape, dtype=object)) // 2**20):
            stream.write(bytes(2**20))
    tracemalloc.start()
    with pytest.raises(TrajectoryError, match=words):
        Trajectory.load(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10 * 2**20


def test_other_compression_is_refused(motion, tmp_path):
    path = motion.save(tmp_path / "motion.npz")
    with zipfile.ZipFile(path) as file:
        members = {name: file.read(name) for name in file.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_LZMA) as file:  # whose head may ask for 4 GiB
        for name, data in members.items():
            file.writestr(name, data)
    with pytest.raises(TrajectoryError, match="another method than deflate"):
        Trajectory.load(path)


@pytest.mark.parametrize("shape", [(10**12, 2), (2**62, 2**62), (4, 3)])
def test_array_that_promises_more_than_the_file_holds(tmp_path, shape):
    path = tmp_path / "promise.npz"
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": shape})
    write(path, q=None)
    with zipfile.ZipFile(path, "a") as file:
        file.writestr("q.npy", header.getvalue() + bytes(64))
    with pytest.raises(TrajectoryError, match=r"q of shape .* is cut off|expected 96 bytes got 64"):
        Trajectory.load(path)


def test_a_member_twice_is_refused(tmp_path):
    path = tmp_path / "twice.npz"
    write(path)
    with zipfile.ZipFile(path, "a") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # zipfile warns of the duplicate
        file.writestr("q.npy", b"")
    with pytest.raises(TrajectoryError, match="not a readable"):
        Trajectory.load(path)


def test_too_large_is_not_saved(tmp_path, monkeypatch, motion):
    monkeypatch.setattr("armdyn.trajectory.npz.MAX_BYTES", 100)
    with pytest.raises(TrajectoryError, match="4 samples are more than 100 bytes"):
        motion.save(tmp_path / "x.npz")
    assert not list(tmp_path.iterdir())


def test_killed_while_saving_leaves_the_old_file(motion, tmp_path):
    """A process that saves again and again is killed at some moment: the file is one of those it wrote."""
    path = motion.save(tmp_path / "motion.npz")
    code = (
        "import sys; from armdyn.trajectory import Trajectory as T; from dataclasses import replace\n"
        "m = T.load(sys.argv[1]); i = 0\n"
        "while True:\n    i += 1; replace(m, name=str(i)).save(sys.argv[1]); print(i, flush=True)"
    )
    process = subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE, text=True)
    written = [process.stdout.readline() for _ in range(20)]
    process.kill()
    process.wait()
    assert len(written) == 20
    loaded = Trajectory.load(path)
    assert int(loaded.name) >= 20 and same(replace(loaded, name="motion"), motion)
