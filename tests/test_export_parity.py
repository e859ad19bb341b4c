"""Exported C equals the virtual machine: charts, sizes, optimization levels, single precision."""

from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from c_compilers import needs_compiler
from exported import built, difference, evaluated, everything, random_arguments, robot_model

import dtcasadi as dtc
from dtcasadi.codegen import Exposed
from dtcasadi.codegen.describe import DEFAULT, described

pytestmark = needs_compiler

N_CALLS = 1000
LEVELS = {
    "-O0": ["-O0"],
    "-O3": ["-O3", "-march=native", "-ffp-contract=fast"],
    "-ffast-math": ["-O3", "-march=native", "-ffast-math"],
}
# Another order of operations, or fused ones, changes a sum by round-off; fast math also
# reassociates, and divides by multiplying.
TOLERANCE = {"-O0": 1e-12, "-O3": 1e-12, "-ffast-math": 1e-9}
# What solves with M multiplies round-off by its condition: below 2e3 up to four discs, which leaves
# 1e-12; 3e4 with eight and 3e6 with 32, where no two solvers agree to 1e-12.
SOLVED = ("forward_dynamics", "ode", "ode_jacobian", "step", "linearize")
STEPPED = ("step", "linearize")
# Of a robot that touches nothing and is held nowhere.
FREE = tuple(name for name in DEFAULT if name not in ("multipliers", "contacts"))
DYNAMICS = tuple(name for name in FREE if name not in (*STEPPED, "recentre"))


@cache
def functions_of(chart: str, n_discs: int, names: tuple[str, ...]) -> dict[str, Exposed]:
    """Graphs, built once for all levels."""
    export = described(robot_model(n_discs, chart), name="robot", functions=names)
    return {each.name: each for each in export.functions}


def compiled(functions: dict[str, Exposed], level: str, folder: Path) -> dict[str, ca.Function]:
    """The exported library's functions, by casadi.external."""
    exported = dtc.export_c(functions, folder / "c", name="robot")
    importer = ca.Importer(str(built(exported, LEVELS[level], folder)), "dll")
    return {name: ca.external(f"robot_raw_{name}", importer) for name in functions}


def assert_equal(chart: str, n_discs: int, names: tuple[str, ...], level: str, folder: Path):
    functions = functions_of(chart, n_discs, names)
    twins = compiled(functions, level, folder)
    compare(robot_model(n_discs, chart), functions, twins, TOLERANCE[level])


def condition(model: dtc.Model) -> float:
    """The largest one of M over some random states."""
    n = 100
    M = evaluated(model.mass_matrix, random_arguments(model, model.mass_matrix, n))[0]
    return float(np.max(np.linalg.cond(M.reshape(n, model.n_q, model.n_q))))


def compare(model: dtc.Model, functions: dict[str, Exposed], twins: dict, tolerance: float):
    solved = max(tolerance, np.finfo(float).eps * condition(model))
    for name, twin in twins.items():
        allowed = solved if name in SOLVED else tolerance
        arguments = random_arguments(model, functions[name].function, N_CALLS)
        expected = evaluated(functions[name].function, arguments)
        results = evaluated(twin, arguments)
        for port, got, wanted in zip(functions[name].outputs, results, expected, strict=True):
            error = difference(got, wanted)
            assert error <= allowed, f"{name} {port.name}: {error:.1e}"


@pytest.mark.parametrize(
    "chart, n_discs, names, level",
    [
        ("cardan", 2, ("ode", "inverse_dynamics", "ode_jacobian"), "-O3"),
        # The hand-written C kernels enter from nine coordinates on.
        ("cardan", 3, ("ode_jacobian",), "-O0"),
        ("planar", 2, DYNAMICS, "-ffast-math"),
    ],
)
def test_dynamics_and_jacobians(chart, n_discs, names, level, tmp_path):
    assert_equal(chart, n_discs, names, level, tmp_path)


def test_all_that_is_exported_by_default():
    importer = ca.Importer(str(everything().library), "dll")
    functions = {each.name: each for each in everything().export.functions}
    assert tuple(functions) == FREE
    twins = {name: ca.external(f"robot_raw_{name}", importer) for name in functions}
    compare(everything().model, functions, twins, TOLERANCE["-O0"])


@pytest.mark.slow
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("n_discs", [2, 4, 8])
@pytest.mark.parametrize("chart", ["cardan", "planar"])
def test_everything(chart, n_discs, level, tmp_path):
    assert_equal(chart, n_discs, FREE, level, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("level", ["-O0", "-O3"])
@pytest.mark.parametrize("chart", ["cardan", "planar"])
def test_a_long_chain(chart, level, tmp_path):
    assert_equal(chart, 32, DYNAMICS, level, tmp_path)


@pytest.mark.parametrize("level", ["-O3"])
def test_paper_chart_solves_its_own_equations(level, tmp_path):
    """Near beta = 0 its M is singular: qdd itself has few digits, the equations are met."""
    model = robot_model(3, "paper")
    functions = functions_of("paper", 3, ("forward_dynamics", "inverse_dynamics", "mass_matrix"))
    twin = compiled(functions, level, tmp_path)["forward_dynamics"]
    arguments = random_arguments(model, functions["forward_dynamics"].function, N_CALLS)
    q, qd, pressure, tau, theta = arguments
    q[1::5, ::2] *= 1e-3  # beta
    (qdd,) = (result.T for result in evaluated(twin, arguments))
    (back,) = evaluated(functions["inverse_dynamics"].function, [q, qd, qdd, pressure, theta])
    M = evaluated(functions["mass_matrix"].function, [q, theta])[0].reshape(N_CALLS, 10, 10)
    scale = np.max(np.einsum("kij,jk->ki", np.abs(M), np.abs(qdd)), axis=1)
    residual = np.max(np.abs(back - tau.T), axis=1) / scale
    # Round-off of the recursion, 2e-16, times some tens of operations a row, in both directions.
    assert np.max(residual) <= 1e-12
