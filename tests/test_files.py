from pathlib import Path

import pytest

from armdyn.files import write_whole


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
