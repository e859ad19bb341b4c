"""The exported folder by itself: example, build files, README, single precision."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from c_compilers import needs_compiler, script
from exported import SQUARE, small_scene

import dtcasadi as dtc
from dtcasadi.codegen.build import cortex_sizes


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
