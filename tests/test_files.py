import errno
import os
import pickle
import socket
import stat
import tracemalloc
from pathlib import Path

import pytest

import armdyn as ad
from armdyn.errors import ArmdynError, DiskFullError, FileError
from armdyn.files import probe_folder, read_bounded, read_json, read_sealed, write_sealed, write_whole
from armdyn.studies.rows import row_store


def test_written_and_written_again(tmp_path):
    path = tmp_path / "a.bin"
    assert write_whole(path, b"one") == path
    assert write_whole(str(path), b"two") == path
    assert path.read_bytes() == b"two"
    assert path.stat().st_mode & 0o777 == 0o644
    assert list(tmp_path.iterdir()) == [path]


def irregular_target(folder, kind):
    """A path at which there is something that no file may take the place of; none of it is the machine's own."""
    path, file = folder / "out.lock", folder / "file.csv"
    if kind == "a named pipe":
        os.mkfifo(path)
    elif kind == "a folder":
        path.mkdir()
    elif kind == "a socket":
        path = irregular(folder, kind)
        return path.rename(folder / "out.lock")
    elif kind == "a device":
        try:
            os.mknod(path, stat.S_IFCHR | 0o600, os.makedev(1, 3))
        except PermissionError:
            pytest.skip("no device can be made")
    else:
        if kind == "a link":
            file.write_text("old")
        path.symlink_to({"a link": file, "a dangling link": file, "a link to itself": path, "a link to a device":
                         "/dev/null"}[kind])  # fmt: skip
    return path


IRREGULAR = ("a named pipe", "a folder", "a socket", "a device", "a link", "a dangling link", "a link to itself",
             "a link to a device")  # fmt: skip


@pytest.mark.parametrize("kind", IRREGULAR)
def test_only_regular_files_are_replaced(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path, rr = irregular_target(tmp_path, kind), ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    motion, before = ad.ramp(rr, [0, 0], [1, 1], 1.0), {one: one.lstat() for one in tmp_path.iterdir()}
    for write in (
        lambda: write_whole(path, b"new"), lambda: probe_folder(path.parent, path.name), lambda: motion.to_csv(path),
        lambda: motion.save(path), lambda: motion.resample(100.0).to_csv(path),
        lambda: row_store(path, dict).__enter__(), lambda: row_store(tmp_path / path.stem, dict).__enter__(),
    ):  # fmt: skip
        with pytest.raises(FileError, match=r"cannot be written .it is a(?! regular)"):
            write()
    left = {one: one.lstat() for one in tmp_path.iterdir()}
    assert {one: (at.st_mode, at.st_ino, at.st_size) for one, at in left.items()} == {
        one: (at.st_mode, at.st_ino, at.st_size) for one, at in before.items()
    }


@pytest.mark.parametrize("failing", ["os.fsync", "pathlib.Path.replace"])
def test_a_failure_leaves_the_old_file_and_no_other(failing, tmp_path, monkeypatch):
    path = write_whole(tmp_path / "a.bin", b"old")

    def fail(*_, **__):
        raise OSError("disk full")

    monkeypatch.setattr(failing, fail)
    with pytest.raises(OSError, match="disk full"):
        write_whole(path, b"new")
    monkeypatch.undo()
    assert path.read_bytes() == b"old"
    assert [Path(p) for p in tmp_path.iterdir()] == [path]


def test_no_folder(tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        write_whole(tmp_path / "nowhere" / "a.bin", b"")


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT])
@pytest.mark.parametrize("failing", ["os.fsync", "tempfile.mkstemp", "pathlib.Path.replace"])
def test_a_full_disk_is_an_error_of_its_own(failing, code, tmp_path, monkeypatch):
    path = write_whole(tmp_path / "a.bin", b"old")

    def fail(*_, **__):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(failing, fail)
    with pytest.raises(
        DiskFullError, match=r"disk full while writing .*a\.bin; what was written before is whole"
    ) as raised:
        write_whole(path, b"new")
    monkeypatch.undo()
    assert isinstance(raised.value, ArmdynError) and isinstance(raised.value, OSError)
    assert path.read_bytes() == b"old" and list(tmp_path.iterdir()) == [path]


def test_a_disk_that_is_full(tiny_disk):
    path = write_whole(tiny_disk / "a.bin", b"old")
    with pytest.raises(DiskFullError, match="disk full"):
        write_whole(path, bytes(2**20))
    assert path.read_bytes() == b"old" and list(tiny_disk.iterdir()) == [path]
    (tiny_disk / "filler").write_bytes(bytes(60 * 2**10))
    with pytest.raises(DiskFullError, match="disk full"):
        probe_folder(tiny_disk / "results")


@pytest.mark.parametrize("error", [FileError("a.bin", "no such file"), DiskFullError(Path("a.bin"))])
def test_errors_come_from_other_processes_as_they_were(error):
    same = pickle.loads(pickle.dumps(error))
    assert type(same) is type(error) and str(same) == str(error) and same.path == error.path


def test_a_file_within_the_size_limit_is_read(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(b"x" * 1000)
    assert read_bounded(path, 1000) == read_bounded(str(path), 2**40) == b"x" * 1000
    with pytest.raises(FileError, match=r"a\.bin: larger than 999 bytes"):
        read_bounded(path, 999)
    (tmp_path / "link").symlink_to(path)
    assert len(read_bounded(tmp_path / "link", 1000)) == 1000


def test_small_files_take_little_memory(tmp_path):
    (tmp_path / "a.bin").write_bytes(b"x")
    tracemalloc.start()
    read_bounded(tmp_path / "a.bin", 2**30)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2**22  # a piece of a MiB


@pytest.mark.skipif(not Path("/proc/self/mountinfo").exists(), reason="a file system that reports no sizes")
def test_a_file_that_reports_no_size_is_bounded_too():
    assert Path("/proc/self/mountinfo").stat().st_size == 0 and read_bounded("/proc/self/mountinfo", 2**20)
    with pytest.raises(FileError, match="larger than 10 bytes"):
        read_bounded("/proc/self/mountinfo", 10)


def irregular(folder, kind):
    """A path of this kind, which is no regular file."""
    path = folder / "irregular"
    if kind == "a named pipe":
        os.mkfifo(path)
    elif kind == "a folder":
        path.mkdir()
    elif kind == "a device":
        return Path("/dev/zero")
    else:
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(os.path.relpath(path))  # a socket's path must be short
    return path


@pytest.mark.parametrize("kind", ["a named pipe", "a folder", "a device", "a socket"])
def test_irregular_files_are_refused_at_once(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = irregular(tmp_path, kind)
    with pytest.raises(FileError, match=f"{path}: cannot be read .it is {kind}; give the path of a regular file"):
        read_bounded(path, 1000)


def test_a_pipe_that_takes_a_files_place_is_not_waited_for(tmp_path, monkeypatch):
    path = tmp_path / "a.bin"
    path.write_bytes(b"x")
    seen = path.stat()
    path.unlink()
    os.mkfifo(path)
    monkeypatch.setattr(Path, "stat", lambda self: seen)
    with pytest.raises(FileError, match="it is a named pipe"):
        read_bounded(path, 1000)


@pytest.mark.parametrize(
    ("path", "words"),
    [("nowhere", "no such file"), ("a" * 5000, "cannot be read .File name too long"), ("a\0b", "cannot be read"),
     (None, "cannot be read"), (0, "cannot be read")],
)  # fmt: skip
def test_paths_that_are_no_file(path, words):
    with pytest.raises(FileError, match=words):
        read_bounded(path, 10)


@pytest.mark.parametrize(
    "text",
    ["", "{", "[" * 100_000, "[NaN]", "[-Infinity]", "[1e400]", "9" * 400, "9" * 9000, '"\\ud800"', '"\xff"'],
)
def test_json_that_is_refused(text, tmp_path):
    (tmp_path / "a.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(FileError, match=r"a\.json: not JSON") as raised:
        read_json(tmp_path / "a.json", 2**20)
    assert len(str(raised.value)) < 400


def test_json_that_is_read(tmp_path):
    (tmp_path / "a.json").write_text('\ufeff{"a": [1, 1.5e308, "\\ud83e\\uddbe", null]}', "utf-8")
    assert read_json(tmp_path / "a.json", 2**20) == {"a": [1, 1.5e308, "\U0001f9be", None]}


def test_a_probe_leaves_nothing(tmp_path):
    assert probe_folder(tmp_path / "a/b/c", "x.npz") == tmp_path / "a/b/c"
    assert not list(tmp_path.iterdir())
    (tmp_path / "a").mkdir()
    probe_folder(str(tmp_path / "a/b"))
    assert list(tmp_path.iterdir()) == [tmp_path / "a"] and not list((tmp_path / "a").iterdir())


def test_folders_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("x")
    (tmp_path / "run" / "x.npz").mkdir(parents=True)
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere" / "else")
    for folder, words in {
        "file": "a file is in the way",
        "file/inside/of": "a file is in the way",
        "dangling": "a file is in the way",
        "x" * 300: "File name too long",
        "/proc/self/results": "cannot be written to",
        "run": "x.npz: cannot be written .it is a folder",
        "a\0b": "cannot be written to",
    }.items():
        with pytest.raises(FileError, match=words):
            probe_folder(tmp_path / folder, "x.npz")
    assert {path.name for path in tmp_path.iterdir()} == {"file", "run", "dangling"}


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_folder_without_permission(tmp_path):
    (tmp_path / "closed").mkdir(mode=0o500)
    with pytest.raises(FileError, match="Permission denied"):
        probe_folder(tmp_path / "closed" / "run")


def test_a_folder_whose_disk_is_read_only(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr("tempfile.NamedTemporaryFile", refuse)
    with pytest.raises(FileError, match="Read-only file system"):
        probe_folder(tmp_path / "run")
    assert not list(tmp_path.iterdir())


def test_file_and_folder_reach_the_disk(tmp_path, monkeypatch):
    synced = []
    path = tmp_path / "a.bin"
    monkeypatch.setattr(os, "fsync", lambda it: synced.append((stat.S_ISDIR(os.fstat(it).st_mode), path.exists())))
    write_whole(path, b"one")
    assert synced == [(False, False), (True, True)]  # the file before it has its name, the folder after


def test_sealed_and_read(tmp_path):
    path = tmp_path / "a.bin"
    for data in (b"", b"one", bytes(100)):
        write_sealed(path, data)
        assert read_sealed(path, limit=100) == data
    assert read_sealed(path, limit=99) is None
    assert list(tmp_path.iterdir()) == [path]


def test_a_damaged_seal_is_not_read(tmp_path):
    path = write_sealed(tmp_path / "a.bin", b"one")
    whole = path.read_bytes()
    assert read_sealed(tmp_path / "nowhere.bin", 100) is None
    for damaged in (b"", b"one", whole[:-1], whole[1:], whole + b"x", b"0" + whole[1:], bytes(len(whole))):
        path.write_bytes(damaged)
        assert read_sealed(path, 100) is None
    path.write_bytes(whole)
    assert read_sealed(path, 100) == b"one"
    path.chmod(0o664)
    assert read_sealed(path, 100) is None
    path.chmod(0o644)
    assert read_sealed(path.rename(tmp_path / "b.bin"), 100) is None  # written under another name
    (tmp_path / "folder").mkdir()
    path.symlink_to(write_sealed(tmp_path / "folder" / "a.bin", b"one"))
    assert read_sealed(path, 100) is None
    assert read_sealed(write_sealed(path, b"two"), 100) == b"two"  # the link is replaced, not the file behind it
    assert read_sealed(tmp_path / "folder" / "a.bin", 100) == b"one"
