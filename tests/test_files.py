import os
import stat
from pathlib import Path

import pytest

from armdyn.files import read_sealed, write_sealed, write_whole


def test_written_and_written_again(tmp_path):
    path = tmp_path / "a.bin"
    assert write_whole(path, b"one") == path
    assert write_whole(str(path), b"two") == path
    assert path.read_bytes() == b"two"
    assert path.stat().st_mode & 0o777 == 0o644
    assert list(tmp_path.iterdir()) == [path]


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


def test_what_was_not_sealed_so_is_not_read(tmp_path):
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
