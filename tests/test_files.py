"""`dtcasadi.files`: a file appears whole or not at all."""

import os
import stat
from pathlib import Path

import pytest

from dtcasadi.files import written

OLD, NEW = b"old content", b"new"


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


@pytest.mark.parametrize("existing", [False, True])
def test_it_appears_at_the_end(tmp_path, existing):
    target = tmp_path / "result.npz"
    if existing:
        target.write_bytes(OLD)
    with written(target) as file:
        file.write(NEW)
        file.flush()
        # A reader meanwhile finds the old one, or none.
        assert target.exists() == existing
        assert not existing or target.read_bytes() == OLD
    assert target.read_bytes() == NEW
    assert names(tmp_path) == ["result.npz"]


@pytest.mark.parametrize("existing", [False, True])
@pytest.mark.parametrize("fault", [ValueError, KeyboardInterrupt, SystemExit])
def test_a_fault_leaves_things_as_they_were(tmp_path, existing, fault):
    target = tmp_path / "result.npz"
    if existing:
        target.write_bytes(OLD)
    with pytest.raises(fault), written(target) as file:
        file.write(NEW)
        raise fault
    assert names(tmp_path) == (["result.npz"] if existing else [])
    assert not existing or target.read_bytes() == OLD


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_permissions_are_those_of_any_new_file(tmp_path, mask):
    before = os.umask(mask)
    try:
        with written(tmp_path / "result") as file:
            file.write(NEW)
        (tmp_path / "other").write_bytes(NEW)
        assert os.umask(mask) == mask
    finally:
        os.umask(before)
    modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("result", "other")]
    assert modes[0] == modes[1] == 0o666 & ~mask


def test_a_relative_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with written(Path("result")) as file:
        file.write(NEW)
    assert (tmp_path / "result").read_bytes() == NEW


@pytest.mark.parametrize("letter", ["x", "\N{GREEK SMALL LETTER ALPHA}"])
def test_the_longest_name_a_file_can_have(tmp_path, letter):
    """The temporary one beside it must not be longer."""
    target = tmp_path / (letter * (os.pathconf(tmp_path, "PC_NAME_MAX") // len(letter.encode())))
    with written(target) as file:
        file.write(NEW)
    assert target.read_bytes() == NEW and names(tmp_path) == [target.name]


def test_two_writers_at_once(tmp_path):
    """The last to finish wins, whole."""
    target = tmp_path / "result"
    with written(target) as first:
        first.write(OLD)
        with written(target) as second:
            second.write(NEW)
        assert target.read_bytes() == NEW
        first.write(b" and more")
    assert target.read_bytes() == OLD + b" and more"
    assert names(tmp_path) == ["result"]


def test_a_folder_that_is_not_there(tmp_path):
    target = tmp_path / "nowhere" / "result"
    with pytest.raises(FileNotFoundError) as caught, written(target) as file:
        file.write(NEW)
    assert caught.value.filename == str(target)  # not the temporary one


def test_a_folder_in_its_place(tmp_path):
    (tmp_path / "result").mkdir()
    with pytest.raises(IsADirectoryError, match="result"), written(tmp_path / "result") as file:
        file.write(NEW)
    assert names(tmp_path) == ["result"]


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write anywhere")
def test_a_folder_that_cannot_be_written(tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(PermissionError), written(tmp_path / "result") as file:
            file.write(NEW)
    finally:
        tmp_path.chmod(0o700)
    assert names(tmp_path) == []
