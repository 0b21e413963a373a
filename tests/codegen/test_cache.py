"""The folders of machine code: owned by this user, and not writable by others."""

import os
import tempfile
from pathlib import Path

import pytest

from armdyn.codegen.cache import cache_directory, private_folder, protected
from armdyn.errors import SettingError


def test_folder_is_made_for_this_user_alone(tmp_path):
    old = os.umask(0)
    try:
        made = protected(tmp_path / "a" / "b")
    finally:
        os.umask(old)
    assert [folder.stat().st_mode & 0o777 for folder in (made, made.parent)] == [0o700, 0o700]


def test_sticky_folder_above_will_do_but_not_as_the_cache(tmp_path):
    sticky = tmp_path / "sticky"
    sticky.mkdir()
    sticky.chmod(0o1777)
    assert protected(sticky / "mine") == sticky / "mine"
    with pytest.raises(PermissionError, match="others can write in"):
        protected(sticky)


def test_links_are_followed_once(tmp_path):
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    (tmp_path / "link").symlink_to(tmp_path / "real")
    (tmp_path / "elsewhere").symlink_to(tmp_path / "open")
    assert protected(tmp_path / "link" / "cache") == tmp_path / "real" / "cache"
    with pytest.raises(PermissionError, match="open"):
        protected(tmp_path / "elsewhere" / "cache")
    assert not any((tmp_path / "open").iterdir())


@pytest.mark.parametrize("value", ["cache", "./cache", "~/cache", ".."])
def test_relative_path_is_refused(value, monkeypatch):
    monkeypatch.setenv("ARMDYN_CACHE", value)
    with pytest.raises(SettingError, match=f"^ARMDYN_CACHE='{value}': must be an absolute path$") as caught:
        cache_directory()
    assert (caught.value.variable, caught.value.value) == ("ARMDYN_CACHE", value)


def test_the_users_own_where_nothing_is_set(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    for unset in ("", None):
        monkeypatch.setenv("ARMDYN_CACHE", unset) if unset is not None else monkeypatch.delenv("ARMDYN_CACHE")
        assert cache_directory() == tmp_path / ".cache" / "armdyn"


def test_file_in_a_folders_place(tmp_path):
    (tmp_path / "file").touch()
    for path in ("file", "file/cache"):
        with pytest.raises(NotADirectoryError):
            protected(tmp_path / path)


@pytest.mark.parametrize("where", [".", "cache"])
def test_folders_of_another_user(where, tmp_path, monkeypatch):
    cache = protected(tmp_path / "cache")
    if os.geteuid() == 0:
        os.chown(tmp_path / where, 12345, -1)
    else:
        monkeypatch.setattr("os.geteuid", lambda: 12345)
    with pytest.raises(PermissionError, match="belongs to another user"):
        protected(cache)


def test_private_folder_is_of_this_user_and_goes(monkeypatch, tmp_path):
    with private_folder() as folder:
        assert (folder.stat().st_mode & 0o777, folder.stat().st_uid) == (0o700, os.geteuid())
        (folder / "something").touch()
    assert not folder.exists()
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)  # others who can write here can replace the private folder
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "open"))
    with pytest.raises(PermissionError, match="others can write in"), private_folder():
        pass
    assert not any(Path(tmp_path, "open").iterdir())
