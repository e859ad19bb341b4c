"""The target folder of an export: foreign and edited files, links, interruptions."""

import json
import os
from pathlib import Path

import pytest
from exported import SQUARE

import dtcasadi as dtc
from dtcasadi.errors import ModelError


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_writing_again_changes_nothing_and_keeps_what_others_wrote(tmp_path):
    first = dtc.export_c({"square": SQUARE}, tmp_path / "new" / "c", name="arm")
    before = contents(first.folder)
    assert sorted(before) == sorted(path.name for path in first.files)
    assert first.bytes == sum(map(len, before.values()))
    (first.folder / "notes.txt").write_text("mine")
    dtc.export_c({"square": SQUARE}, first.folder, name="arm")
    assert contents(first.folder) == before | {"notes.txt": b"mine"}
    # Another graph takes the place of the first.
    dtc.export_c({"cube": SQUARE}, first.folder, name="arm")
    assert b"cube" in contents(first.folder)["arm.h"]
    hashes = [json.loads(text["export.json"])["graph"] for text in (before, contents(first.folder))]
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize("name", ["main.c", "README.md"])
def test_foreign_and_edited_files_are_kept(tmp_path, name):
    (tmp_path / name).write_text("mine")
    said = rf"{name}: not written by this package, or edited since; .* overwrite with force"
    with pytest.raises(ModelError, match=said):
        dtc.export_c({"square": SQUARE}, tmp_path, name="arm")
    assert contents(tmp_path) == {name: b"mine"}
    dtc.export_c({"square": SQUARE}, tmp_path, name="arm", force=True)
    assert contents(tmp_path)[name] != b"mine"
    (tmp_path / name).write_text("edited")
    with pytest.raises(ModelError, match=said):
        dtc.export_c({"cube": SQUARE}, tmp_path, name="arm")
    assert (tmp_path / name).read_text() == "edited"


def test_nothing_is_written_through_a_link(tmp_path):
    outside = tmp_path / "outside.txt"
    outside.write_text("mine")
    folder = tmp_path / "c"
    folder.mkdir()
    (folder / "main.c").symlink_to(outside)
    with pytest.raises(ModelError, match=r"main\.c: not written by this package"):
        dtc.export_c({"square": SQUARE}, folder, name="arm")
    dtc.export_c({"square": SQUARE}, folder, name="arm", force=True)
    assert outside.read_text() == "mine" and not (folder / "main.c").is_symlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c", "outside.txt"]


def test_a_manifest_of_other_hands_protects_nothing(tmp_path):
    for text in ("[]", "{", '{"files": 3}', '{"files": {"main.c": 3}}'):
        (tmp_path / "export.json").write_text(text)
        (tmp_path / "main.c").write_text("mine")
        with pytest.raises(ModelError, match=r"export\.json, main\.c: not written by this pack"):
            dtc.export_c({"square": SQUARE}, tmp_path, name="arm")


def test_two_exports_do_not_share_a_folder(tmp_path):
    dtc.export_c({"square": SQUARE}, tmp_path, name="arm")
    before = contents(tmp_path)
    with pytest.raises(ModelError, match="holds the export 'arm'; choose another folder, or over"):
        dtc.export_c({"square": SQUARE}, tmp_path, name="leg")
    assert contents(tmp_path) == before
    dtc.export_c({"square": SQUARE}, tmp_path, name="leg", force=True)


def test_an_interrupted_export_can_be_written_again(tmp_path, monkeypatch):
    dtc.export_c({"square": SQUARE}, tmp_path, name="arm")
    moves = []

    def replaced(source: object, target: object) -> None:
        moves.append(target)
        if len(moves) == 4:
            raise OSError(28, "No space left on device")
        os.rename(source, target)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr("dtcasadi.files.os.replace", replaced)
        with pytest.raises(OSError, match="No space left"):
            dtc.export_c({"cube": SQUARE}, tmp_path, name="arm")
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]
    exported = dtc.export_c({"cube": SQUARE}, tmp_path, name="arm")
    assert sorted(path.name for path in exported.files) == sorted(contents(tmp_path))
    assert b"cube" in contents(tmp_path)["arm.h"]


def test_a_folder_that_is_a_file(tmp_path):
    (tmp_path / "c").write_text("mine")
    with pytest.raises(FileExistsError):
        dtc.export_c({"square": SQUARE}, tmp_path / "c", name="arm")
