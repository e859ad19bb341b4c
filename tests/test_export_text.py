"""Exported text and Python modules, read back and evaluated against CasADi's virtual machine."""

import importlib.util
import json
import math
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np
import pytest
from exported import difference, evaluated, random_arguments, robot_model

import dtcasadi as dtc
from dtcasadi.builders import FUNCTIONS
from dtcasadi.cli import main
from dtcasadi.codegen import Export, Exported, Exposed, text
from dtcasadi.codegen.describe import DEFAULT, described
from dtcasadi.codegen.description import Settings
from dtcasadi.codegen.kernel_notes import NOTES
from dtcasadi.codegen.listing import KERNEL
from dtcasadi.errors import ModelError
from dtcasadi.recentring import recentre_function

# Another order of operations in another assembly changes a result by round-off times the condition
# of M, below 3e3 in the regular charts.
TOLERANCE = 1e-12
# The paper's chart, away from its singularity at the straight pose: condition 1e6.
SINGULAR = 1e-8
N_CALLS = 5
FUNCTION = re.compile(r"function ([a-z][a-z0-9_]*)")
PORT = re.compile(r"(input|output) (\w+)\[(\d+)(?:, (\d+))?\]")
ASSIGNED = re.compile(r"(\w+)(?:\[(\d+)(?:, (\d+))?\])? = (.+)")
TOKEN = re.compile(
    r"\s*(?:(\d+\.?\d*(?:e[+-]?\d+)?)|([A-Za-z]\w*(?:\[\d+(?:, \d+)?\])?)|(\*\*|[-+*/(),]))"
)
CALLABLE = {
    name: getattr(math, name)
    for name in "sqrt exp log sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh "
    "floor ceil fmod copysign hypot log1p expm1".split()
} | {
    "abs": abs,
    "min": min,
    "max": max,
    "sign": np.sign,
    "lt": lambda a, b: float(a < b),
    "le": lambda a, b: float(a <= b),
    "eq": lambda a, b: float(a == b),
    "ne": lambda a, b: float(a != b),
    "logic_not": lambda a: float(a == 0),
    "logic_and": lambda a, b: float(a != 0 and b != 0),
    "logic_or": lambda a, b: float(a != 0 or b != 0),
    "where": lambda c, x: x if c != 0 else 0.0,
}


class Entries:
    """Numbers counted from 1."""

    def __init__(self, values: np.ndarray):
        self.values = values

    def __getitem__(self, at):
        at = at if isinstance(at, tuple) else (at, 1)
        return float(self.values[at[0] - 1, at[1] - 1])


def read(content: str) -> Callable[..., list[np.ndarray]]:
    """A reader of the text format: every line has one of five forms, every name comes first."""
    inputs: list[tuple[str, tuple[int, int]]] = []
    outputs: dict[str, tuple[int, int]] = {}
    program: list[tuple] = []
    known: set[str] = set()
    lines = [line.split("#")[0].strip() for line in content.splitlines()]
    lines = [line for line in lines if line]
    assert FUNCTION.fullmatch(lines[0]) and lines[-1] == "end"
    for line in lines[1:-1]:
        if port := PORT.fullmatch(line):
            way, name, rows, columns = port.groups()
            shape = int(rows), int(columns or 1)
            if way == "input":
                inputs.append((name, shape))
                known.add(name)
            else:
                outputs[name] = shape
            continue
        assigned = ASSIGNED.fullmatch(line)
        assert assigned, line
        name, row, column, expression = assigned.groups()
        end, taken = 0, []
        while end < len(expression):
            token = TOKEN.match(expression, end)
            assert token, line
            end = token.end()
            taken += [token[2].split("[")[0]] if token[2] else []
        assert known.union(CALLABLE).issuperset(taken), line
        assert (name in outputs) == (row is not None), line
        if row is None:
            assert name not in known, f"{name} twice"
            known.add(name)
        at = (int(row) - 1, int(column or 1) - 1) if row else None
        program.append((name, at, compile(expression, "text", "eval")))

    def evaluate(*arrays: np.ndarray) -> list[np.ndarray]:
        values: dict = dict(CALLABLE)
        for (name, shape), array in zip(inputs, arrays, strict=True):
            values[name] = Entries(np.asarray(array, dtype=float).reshape(shape, order="F"))
        results = {name: np.full(shape, np.nan) for name, shape in outputs.items()}
        for name, at, code in program:
            value = float(eval(code, {"__builtins__": {}}, values))
            if at is None:
                values[name] = value
            else:
                results[name][at] = value
        return list(results.values())

    return evaluate


def load(exported: Exported) -> ModuleType:
    (path,) = (path for path in exported.files if path.suffix == ".py")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def plain(model: dtc.Model, export: Export, name: str) -> ca.Function:
    """What the model itself evaluates, assembled in the other way where it can be."""
    if name in FUNCTIONS:
        return model.plain(name)
    if name == "recentre":
        return recentre_function(model)
    found = export.get(name)
    assert found is not None
    return found.function


@cache
def of_robot(n_discs: int, chart: str, names: tuple[str, ...]) -> Export:
    model = robot_model(n_discs, chart)
    method, step_s = ("ros2", 1e-3) if "step" in names else (None, None)
    return described(model, name="arm", functions=names, method=method, step_s=step_s, calls=True)


def assert_reads_back(n_discs: int, chart: str, names: tuple[str, ...], folder: Path) -> None:
    """Text call by call, the module for all calls at once."""
    model, export = robot_model(n_discs, chart), of_robot(n_discs, chart, names)
    texts = dtc.export_c(export, folder / "text", format="text")
    module = load(dtc.export_c(export, folder / "python", format="python"))
    tolerance = SINGULAR if chart == "paper" else TOLERANCE
    for name in names:
        function = plain(model, export, name)
        arguments = random_arguments(model, function, N_CALLS)
        expected = evaluated(function, arguments)
        reader = read((texts.folder / f"arm_{name}.txt").read_text("ascii"))
        calls = [reader(*(array[:, k] for array in arguments)) for k in range(N_CALLS)]
        together = getattr(module, name)(*arguments)
        together = together if isinstance(together, tuple) else (together,)
        for i, wanted in enumerate(expected):
            got = np.array([call[i].ravel(order="F") for call in calls])
            assert difference(got, wanted) <= tolerance, (name, i)
            if together[i].shape[-1] != N_CALLS:  # depends on no argument that has robots
                continue
            got = np.moveaxis(together[i], -1, 0)
            got = np.array([one.ravel(order="F") for one in got])
            assert difference(got, wanted) <= tolerance, (name, i)


SHORT = tuple(name for name in DEFAULT if name not in ("step", "linearize", "recentre", "forces"))


@pytest.mark.parametrize(
    ("n_discs", "chart", "names"),
    [
        (2, "cardan", SHORT),
        (3, "hinge", SHORT),
        (2, "paper", ("forward_dynamics", "mass_matrix")),
        (2, "planar", ("step",)),
    ],
)
def test_functions_read_back(n_discs, chart, names, tmp_path):
    assert_reads_back(n_discs, chart, names, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("chart", ["cardan", "paper", "planar"])
def test_four_discs_read_back(chart, tmp_path):
    assert_reads_back(2, chart, SHORT, tmp_path)
    extra = {"cardan": ("recentre",), "planar": ("step",)}.get(chart, ())
    assert_reads_back(4, chart, (*FUNCTIONS, *extra), tmp_path)


@pytest.mark.slow
def test_a_linearized_step_reads_back(tmp_path):
    assert_reads_back(2, "planar", ("step", "linearize"), tmp_path)


def test_lines_are_grouped_by_disc_with_equations_and_units():
    (content,) = text.write(of_robot(3, "planar", ("gravity",)), Settings()).values()
    for disc in (2, 3):
        assert f"# disc {disc}: cosines and sines of the coordinates" in content
        assert f"# disc {disc}: Newton-Euler, wrench of the disc's motion, its frame" in content
    assert "moment_3 [N m], force_3 [N]" in content
    assert "input q[4]  # generalized coordinates [rad]" in content
    assert "#   q[1]  beta_1 [rad]" in content
    (content,) = text.write(of_robot(3, "planar", ("mass_matrix",)), Settings()).values()
    assert "eq (6), block of the mass matrix" in content and "Table I" in content
    assert max(map(len, content.splitlines())) <= 120


def kernels(function: ca.Function) -> set[str]:
    """Names of all per-segment kernels a Function calls."""
    found: set[str] = set()
    if function.is_a("MXFunction"):
        for k in range(function.n_instructions()):
            if function.instruction_id(k) == ca.OP_CALL:
                called = function.instruction_MX(k).which_function()
                matched = KERNEL.fullmatch(called.name())
                found |= {matched[1]} if matched else kernels(called)
    return found


def test_every_kernel_has_a_title_and_units():
    options: list[dict[str, Any]] = [{"inflation": "volume", "wrenches": (2,)}]
    options.append({"velocity_terms": "paper"})
    found: set[str] = set()
    for each in options:
        model = robot_model(2, "hinge", assembly="graph", **each)
        found |= set().union(*(kernels(model.plain(name)) for name in FUNCTIONS))
    found |= kernels(robot_model(2, assembly="graph").plain("forward_dynamics"))
    assert found - set(NOTES) == set(), "give them an entry in codegen/kernel_notes.py"


def functions_of_every_kind() -> dict[str, ca.Function]:
    x, A, b = ca.MX.sym("x", 3), ca.MX.sym("A", 3, 3), ca.MX.sym("b", 3, 2)
    s, t = ca.SX.sym("s"), ca.SX.sym("t")
    inner = ca.Function("inner", [s, t], [ca.atan2(s, t) + ca.fmin(s, t), -s / -(t * -2)])
    first, second = inner(x[0], x[2])
    moved = ca.MX(ca.horzcat(x, 2 * x))
    moved[1, :] = x[:2]
    names = "sin cos tan asin acos atan sinh cosh tanh asinh atanh exp log sqrt fabs floor ceil"
    unary = [getattr(ca, name)(s) for name in f"{names} sign log1p expm1".split()]
    binary = [s - (t - 1), s / (t / 3), (s**t) ** 2, 2 ** (-s), (-s) ** 2, -(s**2), s * (t * 3)]
    binary += [ca.fmax(s, t), ca.fmod(t, s), ca.hypot(s, t), ca.copysign(s, -t), ca.acosh(1 + t)]
    binary += [s < t, s <= t, ca.eq(s, t), ca.ne(s, t), t / (s < 2), (s < t) ** 2]
    binary += [ca.logic_and(s, t), ca.logic_or(s, 0 * t), ca.logic_not(s), ca.if_else(s > t, s, t)]
    return {
        "matrices": ca.Function(
            "matrices",
            [x, A, b],
            [
                ca.solve(A + 3 * ca.MX.eye(3), b),
                ca.jtimes(ca.solve(A + 3 * ca.MX.eye(3), x), x, x, True),  # transposed
                ca.mtimes(A.T, b) + ca.dot(x, x) * b,
                ca.vertcat(first, second, ca.norm_2(x), ca.mmax(x), ca.norm_inf(A)),
                moved,
                ca.MX(2, 2),
                ca.diagcat(x, A[:, 1]),
            ],
            ["x", "A", "b"],
            ["solved", "turned", "product", "mixed", "moved", "none", "joined"],
        ),
        "scalars": ca.Function(
            "scalars", [s, t], [ca.vertcat(*unary), ca.vertcat(*binary)], ["s", "t"], ["y", "y_1"]
        ),
    }


def test_any_functions_can_be_written(tmp_path, rng):
    functions = functions_of_every_kind()
    texts = dtc.export_c(functions, tmp_path / "text", name="mine", format="text")
    module = load(dtc.export_c(functions, tmp_path / "python", name="mine", format="python"))
    for name, function in functions.items():
        arrays = [rng.uniform(0.1, 0.9, function.size_in(i)) for i in range(function.n_in())]
        expected = [value.full() for value in function.call([ca.DM(a) for a in arrays])]
        reader = read((texts.folder / f"mine_{name}.txt").read_text("ascii"))
        shaped = [a[:, 0] if a.shape[1] == 1 else a for a in arrays]
        for got in (reader(*arrays), getattr(module, name)(*shaped)):
            for mine, one in zip(got, expected, strict=True):
                # The same operations in the same order; libraries differ in the last place.
                np.testing.assert_allclose(mine.reshape(one.shape), one, rtol=1e-14, atol=1e-15)


def test_what_has_no_expression_is_refused(tmp_path):
    from dtcasadi.linear import solve_spd

    A, b = ca.MX.sym("A", 2, 2), ca.MX.sym("b", 2)
    native = ca.Function("native", [A, b], [solve_spd(A, b, native=True)], ["A", "b"], ["x"])
    with pytest.raises(ModelError, match="native: expected functions with expressions, got solve"):
        dtc.export_c({"native": native}, tmp_path / "a", name="mine", format="text")
    x = ca.SX.sym("x")
    inverse = ca.Function("inverse", [x], [ca.erfinv(x)], ["x"], ["y"])
    with pytest.raises(ModelError, match="expected operations with a name"):
        dtc.export_c({"inverse": inverse}, tmp_path / "a", name="mine", format="text")
    A = ca.MX.sym("A", 2, 2)
    inverse = ca.Function("inverse", [A], [ca.det(A)], ["A"], ["y"])
    with pytest.raises(ModelError, match="got CasADi's OP_DETERMINANT"):
        dtc.export_c({"inverse": inverse}, tmp_path / "a", name="mine", format="text")
    endless = ca.Function("endless", [x], [x + ca.inf], ["x"], ["y"])
    with pytest.raises(ModelError, match="expected finite constants, got inf"):
        dtc.export_c({"endless": endless}, tmp_path / "a", name="mine", format="text")
    same = ca.Function("same", [x], [x], ["in"], ["y"])
    with pytest.raises(ModelError, match="no word of Python"):
        dtc.export_c({"same": same}, tmp_path / "a", name="mine", format="python")
    same = ca.Function("same", [x], [x], ["x"], ["y"])
    with pytest.raises(ModelError, match="rows: expected no word of Python or of the module"):
        dtc.export_c({"rows": same}, tmp_path / "a", name="mine", format="python")
    assert not list(tmp_path.iterdir())


def test_the_module_checks_its_arguments(tmp_path):
    export = of_robot(2, "planar", ("gravity",))
    module = load(dtc.export_c(export, tmp_path, format="python"))
    model = robot_model(2, "planar")
    np.testing.assert_array_equal(module.theta0, model.theta0)
    assert module.rows["q"] == ["beta_1", "psi_1"]
    assert module.gravity([0.1, 0.2], module.theta0).shape == (2,)
    for wrong in ([0.1], np.zeros((2, 3, 4)), np.zeros((3, 2))):
        with pytest.raises(ValueError, match=r"q: expected shape \(2,\) or \(2, 'n'\), got"):
            module.gravity(wrong, module.theta0)


def test_titles_stay_in_their_comments(tmp_path):
    x = ca.SX.sym("x")
    function = ca.Function("same", [x], [2 * x], ["x"], ["y"])
    title = 'a"""b\nimport os # \\ \u00e9'
    exposed = Exposed("same", function, function, title)
    texts = dtc.export_c({"same": exposed}, tmp_path / "text", name="mine", format="text")
    assert read((texts.folder / "mine_same.txt").read_text("ascii"))(3.0)[0] == 6.0
    module = load(dtc.export_c({"same": exposed}, tmp_path / "py", name="mine", format="python"))
    assert module.same([3.0]) == 6.0 and not hasattr(module, "os")


@pytest.mark.parametrize(("form", "suffix"), [("text", ".txt"), ("python", ".py")])
def test_the_command_writes_both(form, suffix, tmp_path, capsys):
    arguments = ["codegen", "seed_four_disc", "-o", str(tmp_path / "out"), "--format", form]
    record = tmp_path / "record.json"
    assert main([*arguments, "--functions", "poses", "--json", str(record)]) == 0
    files = [Path(name) for name in json.loads(record.read_text())["files"]]
    assert any(path.suffix == suffix and path.exists() for path in files)
