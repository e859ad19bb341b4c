"""dtcasadi.compile: C twins equal the virtual machine, or say why there are none."""

import gc
import os
import subprocess
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from c_compilers import QUICK, needs_compiler, script

from dtcasadi import compile as compilation
from dtcasadi import compiler
from dtcasadi.bound import Bound
from dtcasadi.errors import CompileError, ModelError


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """An empty cache of the test's own, and messages not yet said."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("DTCASADI_CACHE", str(folder))
    monkeypatch.setattr(compilation, "_said", [])
    return folder


def pendulum(name: str = "pendulum", length: float = 2.0) -> ca.Function:
    q, qd, theta = ca.SX.sym("q", 3), ca.SX.sym("qd", 3), ca.SX.sym("theta", 0)
    qdd = -9.81 / length * ca.sin(q) - 0.1 * qd
    jacobian = ca.jacobian(qdd, q)  # diagonal, hence sparse
    ports = (["q", "qd", "theta"], ["qdd", "dqdd_dq", "energy"])
    return ca.Function(name, [q, qd, theta], [qdd, jacobian, ca.sumsqr(qd) / 2], *ports)


def nested(name: str = "nested") -> ca.Function:
    """An MX graph that calls a kernel twice and takes a sparse argument."""
    x = ca.SX.sym("x", 2)
    kernel = ca.Function("kernel", [x], [ca.vertcat(ca.cos(x[1]), x[0] * x[1])])
    y, K = ca.MX.sym("y", 2), ca.MX.sym("K", ca.Sparsity.lower(2))
    return ca.Function(name, [y, K], [K @ kernel(kernel(y))], ["y", "K"], ["z"])


def arguments(function: ca.Function, seed: int) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [rng.normal(size=function.size_in(i)) for i in range(function.n_in())]


@needs_compiler
@pytest.mark.parametrize("flags", [QUICK, compilation.DEFAULT_FLAGS])
def test_twins_of_one_library_equal_the_virtual_machine(flags):
    functions = [pendulum(), nested()]
    twins = compilation.compile_functions(functions, flags=flags)
    for function in functions:
        twin = twins[function.name()]
        assert twin.class_name().endswith("External")
        assert twin.name_in() == function.name_in() and twin.name_out() == function.name_out()
        for seed in range(5):
            values = arguments(function, seed)
            # a sparse port reads its own pattern only
            expected = function.call([ca.DM(value) for value in values])
            got = Bound(twin)(*values)
            for e, g in zip(expected, got if len(expected) > 1 else [got], strict=True):
                e = np.asarray(e.full()).reshape(g.shape)
                np.testing.assert_allclose(g, e, rtol=1e-12, atol=1e-14)


@needs_compiler
def test_bind_uses_the_compiler_and_keeps_ports_dense():
    bound = compilation.bind(pendulum(), flags=QUICK)
    assert bound.function.class_name().endswith("External")
    result = bound(np.full(3, np.pi / 2), np.ones(3), [])
    np.testing.assert_allclose(result.qdd, -9.81 / 2 - 0.1)
    assert result.dqdd_dq.shape == (3, 3)
    assert np.count_nonzero(result.dqdd_dq - np.diag(np.diag(result.dqdd_dq))) == 0
    assert result.energy == pytest.approx(1.5)
    with pytest.raises(ModelError, match="^pendulum: expected 3 arguments"):
        bound()


@needs_compiler
def test_functions_of_one_name_in_two_libraries_do_not_mix():
    short = compilation.bind(pendulum(length=1.0), flags=QUICK)
    long = compilation.bind(pendulum(length=4.0), flags=QUICK)
    state = (np.full(3, np.pi / 2), np.zeros(3), [])
    np.testing.assert_allclose(short(*state).qdd, 4 * long(*state).qdd)


@needs_compiler
def test_a_function_named_like_a_c_function_does_not_replace_it():
    x = ca.SX.sym("x")
    twins = compilation.compile_functions(
        [ca.Function("sin", [x], [ca.sin(x)]), ca.Function("int", [x], [2 * x])], flags=QUICK
    )
    assert float(twins["sin"](0.5)) == pytest.approx(np.sin(0.5))
    assert float(twins["int"](0.5)) == 1.0


@needs_compiler
def test_matrix_products_and_linear_solves_compile():
    A, b = ca.MX.sym("A", 3, 3), ca.MX.sym("b", 3)
    solve = ca.Function("solve_ldl", [A, b], [ca.solve(A @ A.T + ca.MX.eye(3), b, "ldl")])
    A_value, b_value = arguments(solve, 1)
    expected = np.linalg.solve(A_value @ A_value.T + np.eye(3), b_value)
    got = compilation.bind(solve, flags=QUICK)(A_value, b_value)
    np.testing.assert_allclose(got, expected[:, 0], rtol=1e-11)


def test_nothing_to_compile_is_an_empty_dict():
    assert compilation.compile_functions([]) == {}


@pytest.mark.parametrize("name", ["M", "massMatrix", "a1_B", "_ode", "o" * 61])
def test_names_that_are_refused(name):
    x = ca.SX.sym("x")
    with pytest.raises(ModelError) as caught:
        compilation.c_source([ca.Function(name, [x], [x])] if name != "_ode" else [_Named("_ode")])
    expected = "expected lower-case words joined by _, at most 60 characters"
    assert str(caught.value) == f"function name: {expected}, got {name!r}"


class _Named:
    """Stands in for a Function whose name casadi itself would refuse."""

    def __init__(self, name: str):
        self._name = name

    def name(self) -> str:
        return self._name


def test_a_name_used_twice_is_refused():
    with pytest.raises(ModelError, match="^function name: expected different names, got 'pend"):
        compilation.c_source([pendulum(), pendulum()])


def test_without_a_compiler_one_message_and_the_virtual_machine(monkeypatch):
    monkeypatch.setenv("DTCASADI_CC", "none")
    off = "compilation is switched off by DTCASADI_CC=none"
    with pytest.raises(CompileError, match=f"^{off}$"):
        compilation.compile_functions([pendulum()])
    said = f"^models run in CasADi's virtual machine, more slowly than compiled: {off}$"
    with pytest.warns(compilation.NoCompilerWarning, match=said) as messages:
        bound = compilation.bind(pendulum())
        function = nested()
        assert compilation.twin(function) is function
    assert len(messages) == 1
    assert messages[0].filename == __file__
    assert bound.function.class_name() == "SXFunction"
    np.testing.assert_allclose(bound(np.full(3, np.pi / 2), np.ones(3), []).qdd, -9.81 / 2 - 0.1)


@needs_compiler
def test_flags_that_the_compiler_refuses():
    with pytest.raises(CompileError, match=r"(?s)^C compiler failed .*no-such-flag.*\ncommand: "):
        compilation.compile_functions([pendulum()], flags=[*QUICK, "-fno-such-flag-here"])


def test_missing_headers_are_reported_once_and_the_virtual_machine_runs(tmp_path, monkeypatch):
    text = '[ "$1" = --version ] && echo bare && exit; echo "fatal error: math.h: missing"; exit 1'
    monkeypatch.setenv("DTCASADI_CC", script(tmp_path, "barecc", text))
    said = "fatal error: math.h: missing"
    with pytest.warns(compilation.NoCompilerWarning, match=said) as messages:
        assert compilation.bind(pendulum()).function.class_name() == "SXFunction"
    assert len(messages) == 1


def test_a_library_that_does_not_load(tmp_path, monkeypatch):
    text = 'while [ $# -gt 0 ]; do [ "$1" = -o ] && echo garbage > "$2"; shift; done; echo fake 1'
    monkeypatch.setenv("DTCASADI_CC", script(tmp_path, "fakecc", text))
    with pytest.raises(CompileError, match=r"\.(so|dylib): does not load \(DTCASADI_CACHE may"):
        compilation.compile_functions([pendulum()])


@needs_compiler
def test_a_damaged_library_is_never_loaded(own_cache):
    compilation.compile_functions([pendulum()], flags=QUICK)
    (library,) = own_cache.glob(f"*{compiler.LIBRARY_SUFFIX}")
    good = library.read_bytes()
    library.unlink()
    library.write_bytes(good[: len(good) // 2])
    gc.collect()
    twin = compilation.compile_functions([pendulum()], flags=QUICK)["pendulum"]
    assert twin.class_name().endswith("External")
    assert len(library.read_bytes()) == len(good)


@needs_compiler
def test_the_key_names_text_flags_compiler_and_features():
    found = compiler.find_compiler()
    target = compiler.target_of(found, QUICK)
    source = compilation.c_source([pendulum()])
    keys = [
        compilation._key(source, found, target),
        compilation._key(compilation.c_source([pendulum(length=3.0)]), found, target),
        compilation._key(source, replace(found, version="2"), target),
        compilation._key(source, replace(found, path="/x"), target),
        compilation._key(source, replace(found, arguments=("-m64",)), target),
        compilation._key(source, found, replace(target, flags=("-O1",))),
        compilation._key(source, found, replace(target, features="other")),
    ]
    assert len(set(keys)) == len(keys)
    assert keys[0] == compilation._key(compilation.c_source([pendulum()]), found, target)


@needs_compiler
def test_two_processes_build_one_library(own_cache, tmp_path):
    log = tmp_path / "calls"
    found = compiler.find_compiler()
    counting = script(
        tmp_path,
        "countcc",
        f'case " $* " in *" -o "*) echo x >> {log}; sleep 0.5;; esac; exec {found.path} "$@"',
    )
    program = """
        import sys
        import casadi as ca
        from dtcasadi.compile import compile_functions
        print("ready", flush=True)
        sys.stdin.readline()
        x = ca.SX.sym("x")
        print(compile_functions([ca.Function("square", [x], [x * x])])["square"](3))
    """
    root = Path(__file__).resolve().parent.parent
    environment = dict(os.environ, DTCASADI_CC=counting, PYTHONPATH=str(root))
    processes = [
        subprocess.Popen(
            [sys.executable, "-W", "error", "-c", textwrap.dedent(program)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        for _ in range(2)
    ]
    for process in processes:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
    results = [process.communicate("go\n", timeout=60)[0] for process in processes]
    assert results == ["9\n", "9\n"]
    assert log.read_text() == "x\n"
    assert len(list(own_cache.iterdir())) == 2
