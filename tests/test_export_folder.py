"""The exported folder: names, foreign files, hostile texts, and that it stands alone."""

import json
import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from c_compilers import needs_compiler, script
from scene_texts import SMALL

import dtcasadi as dtc
from dtcasadi import codegen
from dtcasadi.codegen import names, texts
from dtcasadi.codegen.build import cortex_sizes
from dtcasadi.codegen.description import Label
from dtcasadi.errors import ModelError
from dtcasadi.scene import parse_scene

x = ca.SX.sym("x", 2)
SQUARE = ca.Function("square", [x], [x * x], ["x"], ["y"])
WAVE = """
[[robot.chambers]]
discs = "all"
[robot.damping]
c_a = 5
c_b = 5
[pressure]
times = [0, 0.1, 0.3]
values = [0, 4, 1]
kind = "linear"
"""


def small_scene(chart: str = "planar", initial: str = "") -> dtc.Scene:
    """A disc that falls under a pressure that changes."""
    text = SMALL.replace("t_end = 3", "t_end = 0.5\nstep = 0.05\nmethod = 'heun'")
    text = text.replace("count = 3", "count = 2").replace("count = 2\nlength", "length")
    return parse_scene(
        (text + WAVE + f'[model]\nchart = "{chart}"\n{initial}').encode(), name="small"
    )


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("name", ["arm", "arm_2", "a1_b2", "o" * 60])
def test_names_that_are_taken(name):
    assert names.checked_export(name) == name


@pytest.mark.parametrize(
    "name",
    [
        "",
        "A",
        "arm_",
        "_arm",
        "a__b",
        "1a",
        "a-b",
        "a b",
        "a\nb",
        "../a",
        "a/b",
        "o" * 61,
        "é",
        None,
        3,
    ],
)
def test_names_of_another_form(name):
    with pytest.raises(
        ModelError, match="^name: expected lower-case words joined by _, at most 60"
    ):
        names.checked_export(name)


@pytest.mark.parametrize(
    "name", ["int", "sin", "sinf", "y0", "null", "jac", "class", "main", "casadi"]
)
def test_words_of_the_languages(name):
    with pytest.raises(ModelError, match="^name: expected no word of C, C[+][+], math.h or CasADi"):
        names.checked_export(name)


@pytest.mark.parametrize("name", ["math", "string", "all", "clean", "aux"])
def test_names_of_other_files_and_targets(name, tmp_path):
    with pytest.raises(
        ModelError, match="^name: expected no name of a standard header or a target"
    ):
        dtc.export_c({"square": SQUARE}, tmp_path / "c", name=name)
    assert not (tmp_path / "c").exists()


def test_functions_whose_c_names_would_meet(tmp_path):
    for function in ("real", "status", "work", "theta0"):
        with pytest.raises(
            ModelError, match=f"^functions: expected different C names, got '{function}"
        ):
            dtc.export_c({function: SQUARE}, tmp_path, name="arm")
    with pytest.raises(
        ModelError, match="^functions: expected different C names, got 'a_work' twice"
    ):
        dtc.export_c({"a": SQUARE, "a_work": SQUARE}, tmp_path, name="arm")
    with pytest.raises(ModelError, match="begin with raw or internal"):
        dtc.export_c({"raw_a": SQUARE}, tmp_path, name="arm")
    with pytest.raises(ModelError, match="^functions: expected at least one, got none"):
        dtc.export_c({}, tmp_path, name="arm")


def test_ports_that_c_cannot_take(tmp_path):
    for port in ("int", "work", "I"):
        function = ca.Function("f", [x], [x], [port], ["y"])
        with pytest.raises(ModelError, match=f"^f: port name: expected .* got '{port}'"):
            dtc.export_c({"f": function}, tmp_path, name="arm")
    same = ca.Function("f", [x], [x], ["a"], ["a"], {"allow_duplicate_io_names": True})
    with pytest.raises(ModelError, match="^f: expected ports with different names, got a, a"):
        dtc.export_c({"f": same}, tmp_path, name="arm")


def test_options_that_do_not_go_together(tmp_path):
    model = small_scene().build()
    cases = [
        ({"format": "cobol"}, "^format: expected one of .*, got 'cobol'"),
        ({"format": "text", "single": True}, "^format: expected "),
        ({"functions": ("sinus",)}, "^functions: expected names of mass_matrix, .*, got 'sinus'"),
        ({"functions": ("step",), "method": "rk9"}, "^method: expected one of "),
        ({"functions": ("step",), "step_s": -1.0}, "^step_s: expected a .*positive"),
        ({"name": None}, "^name: expected lower-case words"),
    ]
    for options, message in cases:
        with pytest.raises(ModelError, match=message):
            dtc.export_c(model, tmp_path, **{"name": "arm", **options})
    with pytest.raises(ModelError, match="^functions, method, step_s: expected a model"):
        dtc.export_c({"a": SQUARE}, tmp_path, name="arm", functions=("a",))
    with pytest.raises(
        ModelError, match="^functions_or_model: expected a Model, a Scene or a mapp"
    ):
        dtc.export_c(3, tmp_path, name="arm")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "bad", ["*/ int evil; /*", 'a\n#error "no"', "\\", "??/", "<b>`x`</b>", "\x00\x1b[0m", "é"]
)
def test_texts_that_would_leave_their_comment(bad):
    line = texts.comment(bad)
    assert line.isascii() and line.isprintable() and "*/" not in line and "/*" not in line
    assert not re.search(r"[\\\n`<>]|\?\?", line)


@needs_compiler
def test_hostile_titles_and_labels_compile(tmp_path):
    """What a scene file can hold reaches comments only."""
    bad = '*/ int evil = 1; /* "\\'
    export = codegen.described({"square": codegen.exposed("square", SQUARE, None, bad)}, name="arm")
    export = replace(export, title=bad, facts=(bad,), labels={"x": (Label("a", bad),)})
    dtc.export_c(export, tmp_path)
    for name in ("arm_core.c", "main.c", "arm.c"):
        words = ["gcc", "-std=c99", "-Wall", "-Werror", "-c", "-o", "x.o", name]
        subprocess.run(words, cwd=tmp_path, check=True)
    assert b"evil" not in subprocess.run(["nm", "x.o"], cwd=tmp_path, capture_output=True).stdout


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
        with pytest.raises(ModelError, match=r"main\.c: not written by this package"):
            dtc.export_c({"square": SQUARE}, tmp_path, name="arm")


def test_a_folder_that_is_a_file(tmp_path):
    (tmp_path / "c").write_text("mine")
    with pytest.raises(FileExistsError):
        dtc.export_c({"square": SQUARE}, tmp_path / "c", name="arm")


def expected_tip(scene: dtc.Scene) -> np.ndarray:
    """Where the example ends, by the model's own Functions."""
    model = scene.build()
    assert scene.step_s is not None
    discrete = model.discrete(scene.step_s, method=scene.method)
    x, theta = scene.x0(model), model.theta0
    moves = 0
    for k in range(round(scene.t_end / scene.step_s)):
        x = discrete.step(x, scene.pressure(k * scene.step_s), theta)[0].full()[:, 0]
        x, theta, T = model.recentre(x, theta)
        moves += not np.array_equal(T, np.eye(model.n_x))
    assert moves or not model.recentres
    R, r = (np.array(part) for part in model.poses(x[: model.n_q], theta))
    return r[:, -1] + R[:, -3:] @ model.robot.discs[-1].centre_of_mass


def build_with_make(folder: Path, scene: dtc.Scene, *settings: str) -> str:
    subprocess.run(["make", "-s", *settings, "all"], cwd=folder, check=True)
    done = subprocess.run(
        ["./small_example"], cwd=folder, capture_output=True, text=True, check=True, env={}
    )
    *_, t, px, py, pz = done.stdout.split()
    assert float(t) == pytest.approx(scene.t_end)
    # The example prints six decimals.
    np.testing.assert_allclose(np.array([px, py, pz], float), expected_tip(scene), atol=1e-6)
    return done.stdout


@needs_compiler
@pytest.mark.skipif(shutil.which("make") is None, reason="no make")
@pytest.mark.parametrize(
    "settings",
    [
        ["CC=gcc"],
        ["CC=g++", "CFLAGS=-O0"],
        ["CFLAGS=-O0 -fsanitize=address,undefined", "LDFLAGS=-fsanitize=address,undefined"],
    ],
)
def test_the_folder_alone_builds_and_runs(tmp_path, settings):
    scene = small_scene()
    dtc.export_c(scene, tmp_path / "made", functions=("step", "poses"))
    (tmp_path / "made").rename(tmp_path / "moved")
    build_with_make(tmp_path / "moved", scene, *settings)


@needs_compiler
@pytest.mark.skipif(shutil.which("make") is None, reason="no make")
def test_the_example_recentres(tmp_path):
    """A robot beyond 45 degrees; the same steps and maps in Python."""
    scene = small_scene("cardan", "[initial]\nq = [0.2, 0.9, 0, 0.9, 0]\n")
    dtc.export_c(scene, tmp_path, functions=("step", "poses", "recentre"))
    build_with_make(tmp_path, scene, "CFLAGS=-std=c99 -O0")


@needs_compiler
@pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake")
def test_cmake_builds_a_library_that_casadi_loads(tmp_path):
    dtc.export_c({"square": SQUARE}, tmp_path, name="arm")
    for words in (["-S", ".", "-B", "b", "-DBUILD_SHARED_LIBS=ON"], ["--build", "b"]):
        subprocess.run(["cmake", *words], cwd=tmp_path, check=True, capture_output=True)
    twin = ca.external("arm_raw_square", str(tmp_path / "b" / "libarm.so"))
    np.testing.assert_array_equal(twin([2.0, 3.0]).full()[:, 0], [4.0, 9.0])
    example = subprocess.run([str(tmp_path / "b" / "arm_example")], capture_output=True, check=True)
    assert example.stdout == b"y: 0.01 0.01\n"


def test_cortex_size_is_reported_or_its_absence_said(tmp_path, monkeypatch):
    def sizes(**programs: str) -> object:
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        for name, text in programs.items():
            script(folder, f"arm-none-eabi-{name}", text)
        monkeypatch.setenv("PATH", str(folder))
        return cortex_sizes({"a.h": "", "a.c": ""})

    assert sizes() == "not measured: arm-none-eabi-gcc is not installed"
    said = "not measured: arm-none-eabi-size: cannot be run: No such file or directory"
    assert sizes(gcc="echo gcc 12") == said
    table = "echo 'text data bss dec hex filename'; echo '120 4 8 132 84 out.o'"
    assert sizes(gcc="echo gcc 12", size=table) == {"a.c": {"text": 120, "data": 4, "bss": 8}}
    assert str(sizes(gcc="echo gcc 12", size="echo no")).endswith("expected three sizes, got 'no'")
    broken = sizes(gcc='[ "$1" = --version ] && echo 12 && exit; exit 1', size=table)
    assert str(broken).startswith("not measured: C compiler failed with exit code 1")


@needs_compiler
def test_single_precision_states_its_error(tmp_path, monkeypatch):
    scene = small_scene()
    dtc.export_c(scene, tmp_path / "c", functions=("ode", "step"), single=True)
    page = (tmp_path / "c" / "README.md").read_text()
    for name in ("ode", "step"):
        row = re.search(rf"^\| `{name}` \| (\S+) \| (\S+) \| (\d+) \|$", page, re.MULTILINE)
        assert row
        median, largest, failed = row.groups()
        # Round-off of single precision, 6e-8, and up to some hundred times that at random states.
        assert 1e-9 < float(median) < 1e-5 and float(median) <= float(largest) < 1e-4
        assert failed == "0"
    assert "arm-none-eabi-gcc" in page
    monkeypatch.setenv("DTCASADI_CC", "none")
    dtc.export_c(scene, tmp_path / "d", functions=("ode",), single=True)
    assert "not measured: no C compiler" in (tmp_path / "d" / "README.md").read_text()
    assert os.path.exists(tmp_path / "d" / "small_core.c")


@needs_compiler
def test_the_snippet_in_the_readme(tmp_path):
    scene = dtc.load_scene("seed_four_disc")
    dtc.export_c(scene, tmp_path, name="robot", functions=("step",), method="heun", step_s=1e-3)
    page = (Path(__file__).parent.parent / "README.md").read_text()
    snippet = re.search(r"^```c\n(.+?)^```$", page, re.MULTILINE | re.DOTALL)
    assert snippet
    include, body = snippet[1].split("\n\n", 1)
    program = f"#include <stdio.h>\n{include}\nint main(void) {{\n{body}return (int)status;\n}}\n"
    (tmp_path / "main.c").write_text(program)
    subprocess.run(["make", "-s", "run"], cwd=tmp_path, check=True)
