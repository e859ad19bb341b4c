"""dtcasadi.cli: what each command does, prints and writes."""

import os
import sys
import warnings
from importlib import import_module
from pathlib import Path

import drawn_runs
import numpy as np
import pytest
from printed import assert_json_holds, read
from scene_texts import SMALL

from dtcasadi import cli

PLANAR = SMALL + '\n[model]\nchart = "planar"\n'


@pytest.fixture
def scene(tmp_path) -> str:
    """A file with a small scene in the plane."""
    file = tmp_path / "small.toml"
    file.write_text(PLANAR)
    return str(file)


@pytest.fixture
def quick(monkeypatch):
    """SciPy's solver in place of the method that takes longest to compile."""
    from dtcasadi.integrators import METHODS

    monkeypatch.setitem(METHODS, "auto", METHODS["LSODA"])


def test_simulate_writes_what_it_is_asked_for(scene, tmp_path, capsys):
    words = ["simulate", scene, "--method", "LSODA", "--t-end", "0.5", "--view", "3d"]
    words += ["-o", str(tmp_path / "run"), "--plots", str(tmp_path / "new" / "pictures")]
    words += ["--animate", str(tmp_path / "film.gif"), "--json", str(tmp_path / "run.json")]
    assert cli.main(words) == 0
    text = capsys.readouterr().out
    record = read(tmp_path / "run.json")
    assert_json_holds(text.partition("\nfiles\n")[0], record)
    assert record["schema"] == 1 and record["command"] == "simulate"
    assert record["health"]["success"] and record["health"]["method"] == "LSODA"
    assert record["scene"]["n_discs"] == 3 and record["scene"]["chart"] == "planar"
    assert set(record["phases"]) >= {"build", "compile", "integrate", "pictures", "animation"}
    names = [Path(file).name for file in record["files"]]
    pictures = ["filmstrip.png", "coordinates.png", "energy_and_pressure.png"]
    assert names == ["run.npz", *pictures, "film.gif"]
    assert all(Path(file).stat().st_size > 1000 for file in record["files"])
    with np.load(tmp_path / "run.npz") as run:
        assert run["t"][-1] == 0.5 and run["x"].shape == (8, len(run["t"]))
        assert record["health"]["steps"] == len(run["t"]) - 1


def test_simulate_in_another_chart(scene, capsys):
    words = ["simulate", scene, "--method", "RK45", "--t-end", "0.1", "--chart", "cardan"]
    assert cli.main(words) == 0
    assert "chart cardan, coordinates 10, states 20" in capsys.readouterr().out


def test_a_failed_run_is_reported_and_exit_code_1(scene, monkeypatch, tmp_path, capsys):
    failed = drawn_runs.swinging(
        drawn_runs.seed().model, success=False, message="the state was not finite after t = 1.2 s"
    )
    # `dtcasadi.simulate` is the function; the module of that name is found here only.
    monkeypatch.setattr(sys.modules["dtcasadi.simulate"], "simulate", lambda *_, **__: failed)
    words = ["simulate", scene, "--method", "RK45", "--json", str(tmp_path / "run.json")]
    assert cli.main(words) == 1
    assert "FAILED: the state was not finite after t = 1.2 s" in capsys.readouterr().out
    assert read(tmp_path / "run.json")["health"]["success"] is False


def test_demo(tmp_path, monkeypatch, quick, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["demo", "--json", "demo.json"]) == 0
    text = capsys.readouterr().out
    record = read(tmp_path / "demo.json")
    assert_json_holds(text.partition("\nfiles\n")[0], record)
    assert sorted(os.listdir("dtcasadi_demo")) == [
        "animation.gif",
        "coordinates.png",
        "energy_and_pressure.png",
        "filmstrip.png",
        "seed_four_disc.npz",
    ]
    assert sorted(record["files"]) == sorted(
        f"dtcasadi_demo/{name}" for name in os.listdir("dtcasadi_demo")
    )
    motion = record["motion"]
    # What formulas.md says is safe to assert of this scene.
    assert motion["start_m"] - motion["lowest_m"] > 2 and 1.5 < motion["lowest_s"] < 2.5
    assert motion["rise_m"] > 1 and motion["highest_s"] < 5.5
    assert -0.3 < motion["tilt_min_rad"] and motion["tilt_max_rad"] < 1.3
    assert motion["lowest_m"] == pytest.approx(-3.197, abs=1e-3)
    assert record["health"]["residual_J"] < 1e-2


def test_doctor_names_what_is_there(tmp_path, capsys):
    assert cli.main(["doctor", "--json", str(tmp_path / "d.json")]) == 0
    text, record = capsys.readouterr().out, read(tmp_path / "d.json")
    assert set(record) == {
        *("schema", "command", "versions", "compiler", "lanes", "cache"),
        *("programs", "plugins", "advice"),
    }
    assert (record["lanes"]["robots"] > 1) == (record["lanes"]["why"] is None)
    assert all(f"{k} {v}" in text for k, v in record["versions"].items() if k == "casadi")
    assert record["cache"]["folder"] in text
    assert all(advice in text for advice in record["advice"]["advice"])


def test_doctor_works_without_a_compiler(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("DTCASADI_CC", "none")
    monkeypatch.setenv("DTCASADI_CACHE", str(tmp_path / "cache"))
    assert cli.main(["doctor", "--json", str(tmp_path / "d.json")]) == 0
    record = read(tmp_path / "d.json")
    assert record["compiler"] == {"path": None, "version": None, "flags": None, "seconds": None}
    assert record["lanes"]["why"] == "compilation is switched off by DTCASADI_CC=none"
    assert any("DTCASADI_CC=none" in advice for advice in record["advice"]["advice"])


def test_doctor_reports_a_compiler_that_does_not_work(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("DTCASADI_CC", "no-such-compiler")
    assert cli.main(["doctor"]) == 0
    text = capsys.readouterr().out
    assert "does not work: DTCASADI_CC: expected" in text
    assert "make the compiler work, or name another in DTCASADI_CC" in text


def test_bench_dynamics(tmp_path, monkeypatch, capsys):
    from dtcasadi.bench import dynamics

    monkeypatch.setattr(dynamics, "_TIMING_S", 1e-4)
    words = ["bench", "dynamics", "--sizes", "3", "2", "--flat-up-to", "2", "--jacobian-up-to", "2"]
    monkeypatch.setenv("DTCASADI_CC", "none")  # the same report, nothing to wait for
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert cli.main([*words, "--json", str(tmp_path / "b.json")]) == 0
    record, text = read(tmp_path / "b.json"), capsys.readouterr().out
    assert_json_holds(text, record)
    rows = record["dynamics"]["timings"]
    assert [(row["function"], row["assembly"], row["n_discs"]) for row in rows] == [
        ("ode", "flat", 2),
        ("ode_jacobian", "flat", 2),
        ("ode", "graph", 2),
        ("ode_jacobian", "graph", 2),
        ("ode", "flat", 3),
        ("ode", "graph", 3),
    ]
    assert [row["median_us"] is None for row in rows] == [False, True, False, False, True, False]
    assert record["batch"]["lanes"] == 1 and "DTCASADI_CC=none" in record["batch"]["why"]
    assert all(row["operations"] > 100 and row["n_q"] == 5 * (row["n_discs"] - 1) for row in rows)


def benched(name, tmp_path, monkeypatch, capsys) -> list[dict]:
    """Rows of a benchmark of variants, in the virtual machine: nothing to wait for."""
    from dtcasadi.bench import dynamics, variants

    monkeypatch.setattr(dynamics, "_TIMING_S", 1e-4)
    monkeypatch.setattr(variants, "ROUNDS", 1)
    monkeypatch.setenv("DTCASADI_CC", "none")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        words = ["bench", name, "--sizes", "3", "--json", str(tmp_path / "b.json")]
        assert cli.main(words) == 0
    record = read(tmp_path / "b.json")
    assert_json_holds(capsys.readouterr().out, record)
    return record[name]["timings"]


def test_bench_actuators(tmp_path, monkeypatch, capsys):
    rows = benched("actuators", tmp_path, monkeypatch, capsys)
    ratios = {(row["chart"], row["actuator"]): row["operations_ratio"] for row in rows}
    assert len(rows) == 10 and all(ratios[chart, "direct"] == 1 for chart in ("planar", "cardan"))
    # The limit set for time in space; the plane has fewer operations of its own.
    assert ratios["cardan", "gas, hysteresis"] < 1.3 and ratios["planar", "gas, hysteresis"] < 1.6


def test_bench_inflation(tmp_path, monkeypatch, capsys):
    rows = benched("inflation", tmp_path, monkeypatch, capsys)
    assert [(row["chart"], row["n_discs"]) for row in rows] == [("planar", 3), ("cardan", 3)]
    # The limit set for time; operations are what no other load of the machine disturbs.
    assert all(1.0 < row["operations_ratio"] < 1.5 for row in rows)


def test_operations_count_called_functions_at_every_call():
    import casadi as ca

    from dtcasadi.bench.dynamics import operations

    x = ca.SX.sym("x", 2)
    inner = ca.Function("inner", [x], [ca.sin(x)])
    y = ca.MX.sym("y", 2)
    outer = ca.Function("outer", [y], [inner(inner(inner(y)))])
    calls = operations(outer) - 3 * operations(inner)
    assert operations(inner) == 6 and 2 <= calls <= 4  # what is left reads and writes ports


def test_operations_count_those_inside_c_kernels():
    import casadi as ca

    from dtcasadi.bench.dynamics import operations
    from dtcasadi.linear import Factored, solve_spd

    def solved(native):
        A, b = ca.MX.sym("A", 30, 30), ca.MX.sym("b", 30, 2)
        parts = [Factored(A, native=native).solve(b), solve_spd(A, b, native=native)]
        return ca.Function("solved", [A, b], parts)

    # LU by 2/3 n^3 and Cholesky by 1/3 n^3, then 2 n^2 for each of two right-hand sides, twice.
    assert operations(solved(True)) == pytest.approx(30**3 + 8 * 30**2, abs=10)


def test_time_per_call_is_less_overhead_and_never_negative(monkeypatch):
    import casadi as ca

    from dtcasadi.bench import dynamics

    ports = ("x", "u", "theta")
    x, u, theta = (ca.SX.sym(port, n) for port, n in zip(ports, (2, 1, 3), strict=True))
    function = ca.Function("f", [x, u, theta], [x * u + theta[2]], list(ports), ["y"])
    seen = []

    def timings(function, columns):
        seen.append(columns)
        return [3.0, 1.0, 2.0] if len(columns) == 3 else [1.5]

    monkeypatch.setattr(dynamics, "_timings", timings)
    assert dynamics.time_per_call(function, np.array([1.0, 2.0, 3.0])) == (0.5, 0.0)
    assert [column.shape for column in seen[0]] == [(2, 64), (1, 64), (3, 64)]
    assert np.all(seen[0][2] == [[1.0], [2.0], [3.0]])


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_every_command_is_a_module(name):
    module = import_module(f"dtcasadi.cli.{name}")
    assert callable(module.run) and callable(module.add_arguments)
