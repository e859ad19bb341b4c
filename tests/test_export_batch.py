"""Exported C on SIMD lanes: built from its folder, called from C, held against single calls."""

import json
import shutil
from pathlib import Path

import casadi as ca
import pytest
from c_compilers import needs_compiler, needs_cxx
from test_export_programs import SANITIZED, STRICT, run

import dtcasadi as dtc
from dtcasadi import cli
from dtcasadi.errors import ModelError

DRIVER = Path(__file__).with_name("export_batch.c")


def pendulum() -> ca.Function:
    """Two steps of a damped pendulum and a counter: small, as sanitized lanes compile slowly."""
    x, u, theta = ca.SX.sym("x", 3), ca.SX.sym("u"), ca.SX.sym("theta", 2)
    state = x
    for _ in range(2):
        pull = u - theta[0] * ca.sin(state[0]) - ca.fmax(theta[1], 0.1) * state[1]
        state = state + 1e-2 * ca.vertcat(state[1], pull, ca.sqrt(1 + state[2] ** 2))
    ports = ["x", "u", "theta"], ["x_next", "status"]
    return ca.Function("step", [x, u, theta], [state, 1 - (ca.sumsqr(state) <= 1e300)], *ports)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    target = tmp_path_factory.mktemp("arm")
    return dtc.export_c({"step": pendulum()}, target, name="arm", simd=True).folder


@needs_compiler
@needs_cxx
def test_many_robots_as_one_by_one(folder, tmp_path):
    place = tmp_path / "alone"
    shutil.copytree(folder, place)
    lanes = ["-std=c++17", "-O1", "-march=native", *STRICT, *SANITIZED]
    run(["g++", *lanes, "-c", "arm_simd.cpp"], place)
    plain = ["gcc", "-std=c99", "-O1", *SANITIZED]
    run([*plain, "-c", "arm.c", "arm_core.c"], place)
    run([*plain, *STRICT, "-I.", "-c", DRIVER], place)
    objects = ["export_batch.o", "arm_simd.o", "arm.o", "arm_core.o"]
    run(["g++", *SANITIZED, *objects, "-o", "program"], place)
    done = run([place / "program"], place)
    # Fused multiply-adds and another sine, states and commands up to 20.
    assert float(done.stdout) < 1e-13


@needs_compiler
@needs_cxx
def test_the_makefile_knows_the_batch(folder, tmp_path):
    place = tmp_path / "alone"
    shutil.copytree(folder, place)
    run(["make", "simd", "libarm_simd.so", "CXXFLAGS=-std=c++17 -O0"], place)
    run(["make", "clean"], place)
    assert {path.name for path in place.iterdir()} == {path.name for path in folder.iterdir()}
    assert "make simd" in (place / "README.md").read_text()


@pytest.mark.slow
@needs_cxx
@pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake")
def test_cmake_builds_the_batch(folder, tmp_path):
    run(["cmake", "-S", folder, "-B", tmp_path], tmp_path)
    run(["cmake", "--build", tmp_path, "--target", "arm_simd"], tmp_path)
    assert list(tmp_path.glob("libarm_simd.*"))


@needs_compiler
@needs_cxx
def test_the_command_tries_the_batch(tmp_path, capsys, monkeypatch):
    words = ["codegen", "seed_four_disc", "--functions", "gravity", "--simd", "-o"]
    record = tmp_path / "record.json"
    assert cli.main([*words, str(tmp_path / "a"), "--json", str(record)]) == 0
    assert json.loads(record.read_text())["lanes_compile_seconds"] > 0
    assert "SIMD lanes compile in" in capsys.readouterr().out
    monkeypatch.setenv("DTCASADI_CXX", "none")
    assert cli.main([*words, str(tmp_path / "b")]) == 0
    assert "SIMD lanes not compiled: no C++ compiler" in capsys.readouterr().out


def test_what_lanes_cannot_take_is_refused(tmp_path):
    x, n = ca.SX.sym("x"), ca.SX.sym("n")
    functions = {
        "sized": (
            ca.Function("sized", [x], [ca.sign(x)], ["x"], ["y"]),
            "simd: sized: expected functions whose code can run on SIMD lanes; leave it out, got "
            "one where sized contains sign",
        ),
        "counted": (
            ca.Function("counted", [x, n], [x + n], ["x", "n"], ["y"]),
            "simd: counted: expected port names other than n and ld_*, got 'n'",
        ),
    }
    for name, (function, message) in functions.items():
        with pytest.raises(ModelError) as caught:
            dtc.export_c({name: function}, tmp_path / "none", name="arm", simd=True)
        assert str(caught.value) == message
    plain = ca.Function("plain", [x], [x], ["x"], ["y"])
    pair = {"plain": plain, "plain_batch": plain}
    with pytest.raises(ModelError, match="plain_batch"):
        dtc.export_c(pair, tmp_path / "none", name="arm", simd=True)
    with pytest.raises(ModelError, match="double precision"):
        dtc.export_c({"plain": plain}, tmp_path / "none", name="arm", simd=True, single=True)
    assert not list(tmp_path.iterdir())
