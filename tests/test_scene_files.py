"""Tests of dtcasadi.scene.load_scene and of what is no TOML (dtcasadi.scene_file)."""

import os
from pathlib import Path

import pytest
from scene_texts import SMALL, errors_of

from dtcasadi.errors import SceneError
from dtcasadi.scene import load_scene
from dtcasadi.scene_file import MAX_BYTES


def test_a_path_is_a_string_or_a_path_object(tmp_path):
    file = tmp_path / "My scene-2.toml"
    file.write_text(SMALL)
    for path in (file, str(file)):
        assert load_scene(path).name == "my_scene_2"
    file = tmp_path / "22.toml"
    file.write_bytes(b"\xef\xbb\xbf" + SMALL.replace("\n", "\r\n").encode())  # as Windows writes
    assert load_scene(file).name == "scene"


def test_a_name_is_never_a_path(tmp_path, monkeypatch):
    (tmp_path / "mine").write_text(SMALL)
    (tmp_path / "seed_four_disc").write_text("nonsense")
    monkeypatch.chdir(tmp_path)
    assert load_scene("seed_four_disc").t_end == 10.0
    assert load_scene("./mine").name == "mine"
    with pytest.raises(
        SceneError, match=r"^scene: expected a path such as ./mine.toml, or one of "
    ):
        load_scene("mine")
    with pytest.raises(
        SceneError, match=r"\(did you mean seed_four_disc\?\), got 'seed_for_disc'$"
    ):
        load_scene("seed_for_disc")
    with pytest.raises(SceneError, match=r"no such file"):
        load_scene("../scenes/seed_four_disc")


def no_file(tmp_path: Path) -> Path:
    return tmp_path / "none.toml"


def folder(tmp_path: Path) -> Path:
    return tmp_path


def pipe(tmp_path: Path) -> Path:
    os.mkfifo(tmp_path / "pipe.toml")
    return tmp_path / "pipe.toml"


def binary(tmp_path: Path) -> Path:
    (tmp_path / "x.toml").write_bytes(b"\x89PNG\r\n\x1a\n\x00")
    return tmp_path / "x.toml"


def large(tmp_path: Path) -> Path:
    (tmp_path / "x.toml").write_bytes(b"#" * (MAX_BYTES + 1))
    return tmp_path / "x.toml"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (no_file, "expected a readable scene file, got no such file or directory"),
        (folder, "expected a readable scene file, got a folder or a device"),
        (pipe, "expected a readable scene file, got a folder or a device"),
        (binary, "expected a TOML file in UTF-8, got the byte 0x89 at position 0"),
        (large, "expected a scene file of at most 1_000_000 bytes, got more"),
    ],
)
def test_a_file_that_cannot_be_read(tmp_path, make, message):
    path = make(tmp_path)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert str(caught.value) == f"{path}: {message}"


@pytest.mark.parametrize("path", ["a\0b", "\udc80/\ud800", "x" * 5000 + ".toml", 3, None, b"x", ""])
def test_what_cannot_be_a_path(path):
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    (line,) = caught.value.errors
    assert line.isprintable()


@pytest.mark.parametrize(
    ("text", "got"),
    [
        ("a = ", "expected a TOML file, got an error: "),
        ("a = 1\na = 2", "expected a TOML file, got an error: "),
        ("a = " + "[" * 9999, "expected a TOML file, got tables or lists nested too deeply"),
        ("a = " + "9" * 9999, "expected a TOML file, got an integer of thousands of digits"),
        (".".join("a" * 9999) + " = 1", "expected keys of at most 16 parts, got a longer one"),
        (
            '\'a\' . "\\"" . ' * 9999 + "a = 1",
            "expected keys of at most 16 parts, got a longer one",
        ),
    ],
)
def test_what_is_no_toml(text, got):
    (line,) = errors_of(text)
    assert line.startswith(got)
