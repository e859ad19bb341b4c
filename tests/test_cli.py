"""dtcasadi.cli: exit codes, one line for each error, the report and its JSON."""

import argparse
import math
import os
import re
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from printed import read
from scene_texts import SMALL

from dtcasadi import cli, errors
from dtcasadi.cli import common
from dtcasadi.cli.common import Report, guarded, write_json

ROOT = Path(__file__).resolve().parent.parent
PLANAR = SMALL + '\n[model]\nchart = "planar"\n'


@pytest.fixture
def scene(tmp_path) -> str:
    """A file with a small scene in the plane."""
    file = tmp_path / "small.toml"
    file.write_text(PLANAR)
    return str(file)


def complaints(capsys) -> list[str]:
    """Lines on stderr, after checking that they are for people."""
    text = capsys.readouterr().err
    assert "Traceback" not in text
    return text.splitlines()


# The parser


def test_help_lists_every_command(capsys):
    assert cli.main(["--help"]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in cli.COMMANDS)
    assert cli.main(["--version"]) == 0


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_every_command_has_help_and_json(command, capsys):
    words = [command, "dynamics"] if command == "bench" else [command]
    assert cli.main([*words, "--help"]) == 0
    assert "--json F" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["dance"],
        ["--fast"],
        ["simulate"],
        ["simulate", "a", "b"],
        ["simulate", "seed_four_disc", "--t-end", "soon"],
        ["simulate", "seed_four_disc", "--t"],
        ["bench"],
        ["bench", "everything"],
        ["bench", "dynamics", "--sizes", "1"],
        ["bench", "dynamics", "--sizes", "many"],
        ["doctor", "--cure"],
    ],
)
def test_bad_words_are_one_line_and_exit_code_2(words, capsys):
    assert cli.main(words) == 2
    lines = complaints(capsys)
    assert len(lines) == 1 and lines[0].startswith("dtcasadi") and lines[0].endswith("--help)")


def test_it_runs_as_a_module_from_another_folder(tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "dtcasadi", "simulate", "nothing"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith("dtcasadi: scene: expected a path such as ./nothing.toml, or one")


# Errors


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["no_such_scene"], "scene: expected a path such as .+, got 'no_such_scene'"),
        (["missing.toml"], r"missing\.toml: expected a readable scene file, got .+"),
        (["SCENE", "--t-end", "-1"], "scene.t_end: expected .+"),
        (["SCENE", "--t-end", "nan"], "scene.t_end: expected .+"),
        (["SCENE", "--method", "guess"], "method: expected .+, got 'guess'"),
        (["SCENE", "--chart", "map"], "chart: expected .+, got 'map'"),
        (["SCENE", "--rtol", "0"], "scene.rtol: expected .+"),
        (["SCENE", "-o", "nowhere/run.npz"], "nowhere: no such folder"),
        (["SCENE", "--json", "nowhere/run.json"], "nowhere: no such folder"),
        (["SCENE", "--plots", "SCENE"], "SCENE: expected a folder, got a file"),
        (["SCENE", "--animate", "film.avi"], r"film\.avi: expected a name ending in .+"),
        (["SCENE", "--animate", "."], r"\.: expected a name ending in .+"),
        (["SCENE", "-o", "folder.npz"], r"folder\.npz: expected a file, got a folder"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    scene, tmp_path, monkeypatch, capsys, words, message
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.npz").mkdir()
    words = [scene if word == "SCENE" else word for word in words]
    before = sorted(os.listdir(tmp_path))
    assert cli.main(["simulate", *words]) == 2
    (line,) = complaints(capsys)
    assert re.fullmatch("dtcasadi: " + message.replace("SCENE", re.escape(scene)), line)
    assert sorted(os.listdir(tmp_path)) == before


def test_every_error_of_a_scene_has_its_line(tmp_path, capsys):
    file = tmp_path / "bad.toml"
    file.write_text(SMALL.replace("mass = 2", "mass = -2").replace("t_end = 3", "t_end = 0"))
    assert cli.main(["simulate", str(file)]) == 2
    lines = complaints(capsys)
    assert len(lines) == 2
    assert all(line.startswith(f"dtcasadi: {file}: ") and "expected" in line for line in lines)


def test_an_unwritable_folder_is_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(common.os, "access", lambda *_: False)  # root may write everywhere
    assert cli.main(["demo", "-o", str(tmp_path / "out")]) == 2
    assert complaints(capsys) == [f"dtcasadi: {tmp_path / 'out'}: the folder is not writable"]


def run_with(action, capsys, **report) -> tuple[int, list[str]]:
    """Exit code and stderr of a command that does one thing."""
    code = guarded(lambda options, report: action(report), argparse.Namespace(), Report("x"))
    return code, complaints(capsys)


def test_errors_become_lines(capsys):
    def scene_error(report):
        raise errors.SceneError(["a: one", "b: two"])

    def disk_full(report):
        raise OSError(28, "No space left on device", "/there/run.npz")

    def nameless(report):
        raise OSError("strange")

    assert run_with(scene_error, capsys) == (2, ["dtcasadi: a: one", "dtcasadi: b: two"])
    line = "dtcasadi: /there/run.npz: no space left on device"
    assert run_with(disk_full, capsys) == (2, [line])
    assert run_with(nameless, capsys) == (2, ["dtcasadi: strange"])


def test_an_interrupt_says_what_was_kept(capsys):
    def after_one_file(report):
        report.wrote(Path("out/a.png"))
        raise KeyboardInterrupt

    def at_once(report):
        raise KeyboardInterrupt

    assert run_with(after_one_file, capsys) == (130, ["dtcasadi: interrupted; kept: out/a.png"])
    line = "dtcasadi: interrupted; kept: nothing was written"
    assert run_with(at_once, capsys) == (130, [line])


def test_warnings_are_lines_too(capsys):
    def warn(report):
        warnings.warn("one thing\n  to know", UserWarning, stacklevel=1)

    with warnings.catch_warnings():
        warnings.simplefilter("default")
        assert run_with(warn, capsys) == (0, ["dtcasadi: one thing to know"])


def test_bugs_are_not_hidden(capsys):
    def bug(report):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run_with(bug, capsys)


# The report and its JSON


def test_what_is_printed_is_recorded(capsys):
    report = Report("x")
    report.section("part", "a title")
    report.line("falls to {low_m:.2f} m, {word}", low_m=-3.14159, word="fast")
    report.row("rows", "{n:>4} {us:>8}", n=4, us=None)
    report.row("rows", "{n:>4} {us:>8}", n=8, us=1234.5678)
    assert capsys.readouterr().out.splitlines() == [
        "",
        "a title",
        "  falls to -3.14 m, fast",
        "     4        -",
        "     8     1235",
    ]
    rows = [{"n": 4, "us": None}, {"n": 8, "us": 1234.5678}]
    part = {"low_m": -3.14159, "word": "fast", "rows": rows}
    assert report.record == {"schema": 1, "command": "x", "part": part}


def test_json_has_null_for_what_it_has_no_number_for(tmp_path):
    record = {
        "a": [float("nan"), np.inf, -math.inf, 1.5],
        "b": np.array([[1.0, np.nan]]),
        "c": np.float64(2.0),
        "d": np.bool_(True),
        "e": (np.int64(3), None, "é"),
        "f": Path("x"),
    }
    write_json(tmp_path / "r.json", record)
    assert read(tmp_path / "r.json") == {
        "a": [None, None, None, 1.5],
        "b": [[1.0, None]],
        "c": 2.0,
        "d": True,
        "e": [3, None, "é"],
        "f": "x",
    }
    assert os.listdir(tmp_path) == ["r.json"]


def test_an_older_json_survives_a_failure(tmp_path, capsys):
    file = tmp_path / "r.json"
    file.write_text("older")

    def fail(options, report):
        raise errors.ModelError("no")

    assert guarded(fail, argparse.Namespace(), Report("x", str(file))) == 2
    assert file.read_text() == "older"
