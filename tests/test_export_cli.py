"""`dtcasadi codegen`: what it writes, prints, and says when something is wrong."""

import json
from pathlib import Path

import pytest
from c_compilers import needs_compiler, script
from printed import assert_json_holds, read
from test_cli_commands import PLANAR

from dtcasadi import cli

FEW = ["--functions", "ode", "poses"]


@pytest.fixture
def scene(tmp_path) -> str:
    """A file with a small scene in the plane."""
    file = tmp_path / "small.toml"
    file.write_text(PLANAR)
    return str(file)


@needs_compiler
def test_codegen_writes_a_folder_and_tells_all_as_json(scene, tmp_path, capsys):
    folder, record_file = tmp_path / "c", tmp_path / "record.json"
    words = ["codegen", scene, "-o", str(folder), "--json", str(record_file), "--name", "arm"]
    assert cli.main([*words, *FEW]) == 0
    text = capsys.readouterr().out
    record = read(record_file)
    assert record["schema"] == 1 and record["command"] == "codegen"
    names = [Path(file).name for file in record["files"]]
    assert names[:4] == ["arm.h", "arm.c", "arm_core.c", "main.c"]
    assert sorted(names) == sorted(path.name for path in folder.iterdir())
    assert record["bytes"] == sum(path.stat().st_size for path in folder.iterdir())
    assert record["compile_seconds"] > 0 and record["compiler"] in text
    ode, poses = record["functions"]
    assert ode["name"] == "ode" and poses["name"] == "poses"
    assert [port["name"] for port in ode["inputs"]] == ["x", "u", "theta"]
    assert [port["rows"] for port in ode["outputs"]] == [8]
    assert set(ode["work"]) == {"sz_arg", "sz_res", "sz_iw", "sz_w"}
    assert_json_holds(text.partition("\nfiles\n")[0].partition("compiles in")[0], record)


def test_the_name_is_the_scenes(scene, tmp_path):
    assert cli.main(["codegen", scene, "-o", str(tmp_path / "c"), *FEW]) == 0
    assert (tmp_path / "c" / "small.h").is_file()


def test_without_a_compiler(scene, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("DTCASADI_CC", "none")
    words = ["codegen", scene, "-o", str(tmp_path / "c"), "--json", str(tmp_path / "j"), *FEW]
    assert cli.main(words) == 0
    record = json.loads((tmp_path / "j").read_text())
    assert record["compile_seconds"] is None and record["compiler"] is None
    assert "not compiled: no C compiler" in capsys.readouterr().out


def test_a_compiler_that_fails_gives_its_first_lines_and_the_command(
    scene, tmp_path, capsys, monkeypatch
):
    says = 'echo "x.c:3: error: no"; exit 1'
    text = f'case " $* " in *" --version "*) echo bad 1;; *" -dM "*) ;; *) {says};; esac'
    monkeypatch.setenv("DTCASADI_CC", script(tmp_path, "badcc", text))
    assert cli.main(["codegen", scene, "-o", str(tmp_path / "c"), *FEW]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[:2] == [
        "dtcasadi: C compiler failed with exit code 1:",
        "dtcasadi: x.c:3: error: no",
    ]
    assert said[2].startswith("dtcasadi: command: ") and "badcc -std=c99" in said[2]
    # The files are good all the same.
    assert (tmp_path / "c" / "small_core.c").is_file()


@pytest.mark.parametrize(
    "words, message",
    [
        (["--name", "int"], "name: expected no word of C, C++, math.h or CasADi, got 'int'"),
        (
            ["--name", "../x"],
            "name: expected lower-case words joined by _, at most 60 characters, ",
        ),
        (["--functions", "sinus"], "functions: expected names of "),
        (["--format", "cobol"], "format: expected one of "),
        (["--step", "-1"], "step_s: expected "),
        (["--method", "rk9", "--functions", "step"], "method: expected one of "),
        (["--step", "1", *FEW], "method, step_s: expected step or linearize among the functions"),
    ],
)
def test_bad_input_is_one_line(scene, tmp_path, capsys, words, message):
    assert cli.main(["codegen", scene, "-o", str(tmp_path / "c"), *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"dtcasadi: {message}")
    assert not (tmp_path / "c").exists()


def test_foreign_files_need_force(scene, tmp_path, capsys):
    folder = tmp_path / "c"
    folder.mkdir()
    (folder / "main.c").write_text("mine")
    words = ["codegen", scene, "-o", str(folder), *FEW]
    assert cli.main(words) == 2
    assert "main.c: not written by this package" in capsys.readouterr().err
    assert cli.main([*words, "--force"]) == 0
    assert (folder / "main.c").read_text() != "mine"
