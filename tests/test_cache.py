"""dtcasadi.cache: entries are built once, checked, and only kept where nobody else can write."""

import errno
import os
import stat
from pathlib import Path

import pytest

from dtcasadi import cache
from dtcasadi.errors import CompileError


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """An empty cache of the test's own, and messages not yet said."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("DTCASADI_CACHE", str(folder))
    cache._say_once.cache_clear()
    return folder


class Build:
    """Writes a library of the given bytes and counts its calls."""

    def __init__(self, content: bytes = b"library"):
        self.content, self.calls = content, 0

    def __call__(self, path: Path) -> None:
        self.calls += 1
        path.write_bytes(self.content)


def entries(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def test_an_entry_is_built_once_and_checked(own_cache):
    build = Build()
    library = cache.cached_library("k1", build)
    assert library == cache.cached_library("k1", build)
    assert build.calls == 1
    assert library.parent == own_cache and library.read_bytes() == b"library"
    assert entries(own_cache) == [library.name, f"{library.name}.sha256"]
    assert stat.S_IMODE(own_cache.stat().st_mode) == 0o700


@pytest.mark.parametrize("fault", ["changed", "empty", "no digest", "strange digest"])
def test_a_damaged_entry_is_rebuilt(fault):
    build = Build()
    library = cache.cached_library("k1", build)
    digest = library.with_name(f"{library.name}.sha256")
    if fault == "no digest":
        digest.unlink()
    elif fault == "strange digest":
        digest.write_bytes(b"\xff\xfe")
    else:
        library.unlink()
        library.write_bytes(b"lib*ary" if fault == "changed" else b"")
    assert cache.cached_library("k1", build).read_bytes() == b"library"
    assert build.calls == 2
    cache.cached_library("k1", build)
    assert build.calls == 2


def test_a_failed_build_leaves_nothing(own_cache):
    def build(path: Path) -> None:
        path.write_bytes(b"half")
        raise CompileError("no")

    with pytest.raises(CompileError, match="^no$"):
        cache.cached_library("k1", build)
    assert entries(own_cache) == []


def test_the_least_recently_used_entries_go_first(own_cache, monkeypatch):
    monkeypatch.setattr(cache, "MAX_ENTRIES", 2)
    abandoned = own_cache / "build-killed"
    for age, key in enumerate(("k1", "k2")):
        library = cache.cached_library(key, Build(key.encode()))
        os.utime(library, (age, age))
    abandoned.mkdir()
    os.utime(abandoned, (0, 0))
    cache.cached_library("k1", Build(b"not built again"))
    cache.cached_library("k3", Build(b"k3"))
    assert [name.split(".")[0] for name in entries(own_cache)] == ["k1", "k1", "k3", "k3"]


def test_a_full_disk_falls_back_to_a_temporary_folder(own_cache):
    def build(path: Path) -> None:
        if own_cache in path.parents:
            raise OSError(errno.ENOSPC, "No space left on device")
        path.write_bytes(b"library")

    said = "^compiled libraries are not kept between runs: .*cache: the disk is full$"
    with pytest.warns(cache.CacheWarning, match=said):
        library = cache.cached_library("full", build)
    assert own_cache not in library.parents and library.read_bytes() == b"library"
    assert entries(own_cache) == []


def test_no_room_anywhere_is_an_error():
    def build(path: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.warns(cache.CacheWarning), pytest.raises(CompileError) as caught:
        cache.cached_library("nowhere", build)
    assert str(caught.value).startswith("no place for a compiled library: ")
    assert str(caught.value).count("the disk is full") == 2


@pytest.mark.parametrize("case", ["wide mode", "other owner", "other's link", "file", "dangling"])
def test_a_folder_that_cannot_be_trusted_is_not_used(case, own_cache, tmp_path, monkeypatch):
    if case == "wide mode":
        own_cache.mkdir()
        own_cache.chmod(0o770)
        problem = "expected mode 0700, got 0770 (chmod 700 it)"
    elif case == "other owner":
        own_cache.mkdir(mode=0o700)
        problem = f"expected a folder owned by user id {os.geteuid() + 1}, got another owner"
        user = os.geteuid()
        monkeypatch.setattr(os, "geteuid", lambda: user + 1)
    elif case == "other's link":
        (tmp_path / "real").mkdir(mode=0o700)
        own_cache.symlink_to(tmp_path / "real")
        real_lstat = Path.lstat

        def foreign(path):
            fields = list(real_lstat(path))
            fields[4] += 1  # st_uid
            return os.stat_result(fields)

        monkeypatch.setattr(Path, "lstat", foreign)
        problem = f"expected a folder owned by user id {os.geteuid()}, got another owner"
    elif case == "file":
        own_cache.write_text("")
        problem = f"{own_cache}: cannot be created: File exists"
    else:
        own_cache.symlink_to(tmp_path / "nowhere")
        problem = f"{own_cache}: cannot be created: File exists"
    place = cache.cache_folder()
    assert place.problem.endswith(problem)
    assert place.path != own_cache and stat.S_IMODE(place.path.stat().st_mode) == 0o700
    with pytest.warns(cache.CacheWarning) as messages:
        library = cache.cached_library(f"key-{case}", Build())
        cache.cached_library(f"key-{case}", Build())
    assert [str(message.message) for message in messages] == [
        f"compiled libraries are not kept between runs: {place.problem}"
    ]
    assert library.parent == place.path


def test_a_link_and_a_folder_of_one_s_own_are_used(own_cache, tmp_path):
    (tmp_path / "real").mkdir(mode=0o700)
    own_cache.symlink_to(tmp_path / "real")
    assert cache.cache_folder() == cache.CacheFolder(own_cache)


def test_where_the_folder_is(tmp_path, monkeypatch):
    monkeypatch.delenv("DTCASADI_CACHE")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("USERPROFILE", str(tmp_path / "home"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache.cache_folder() == cache.CacheFolder(tmp_path / "xdg" / "dtcasadi")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert cache.cache_folder() == cache.CacheFolder(tmp_path / "home" / ".cache" / "dtcasadi")


def test_a_read_only_cache_serves_but_does_not_store(own_cache):
    kept = cache.cached_library("k1", Build(b"k1"))
    own_cache.chmod(0o500)
    try:
        if os.access(own_cache, os.W_OK):
            pytest.skip("this user writes anywhere")
        assert cache.cached_library("k1", Build(b"not built")) == kept
        with pytest.warns(cache.CacheWarning, match="Permission denied$"):
            assert cache.cached_library("k2", Build(b"k2")).parent != own_cache
    finally:
        own_cache.chmod(0o700)
