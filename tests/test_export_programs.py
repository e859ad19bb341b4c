"""Exported C in programs: compilers, warnings, sanitizers, valgrind, threads, two at once."""

import os
import shutil
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from c_compilers import needs_compiler
from exported import evaluated, everything, random_arguments, robot_model

import dtcasadi as dtc
from dtcasadi.codegen import Export, Exported, Settings, c
from dtcasadi.codegen.describe import described

pytestmark = needs_compiler

DRIVER = Path(__file__).with_name("export_driver.c")
STRICT = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]
COMPILERS = {
    "gcc": ["gcc", "-std=c99"],
    "clang": ["clang", "-std=c99"],
    "g++": ["g++", "-x", "c++"],
}
SANITIZED = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
SHORT = ("ode", "poses", "ode_jacobian")


def command(name: str) -> list[str]:
    """The words that start a compiler; the test is skipped where it is absent."""
    if shutil.which(COMPILERS[name][0]) is None:
        pytest.skip(f"no {name}")
    return COMPILERS[name]


def run(words: Sequence[object], folder: Path, **options) -> subprocess.CompletedProcess:
    done = subprocess.run(
        [str(word) for word in words], cwd=folder, capture_output=True, timeout=600, **options
    )
    assert done.returncode == 0, done.stderr.decode()[:2000]
    return done


@cache
def small(name: str, n_discs: int, chart: str) -> tuple[Export, dtc.Model]:
    """A few functions of a random robot, described once."""
    model = robot_model(n_discs, chart)
    return described(model, name=name, functions=SHORT), model


def first() -> tuple[Export, dtc.Model]:
    """One flat graph for each function."""
    return small("arm", 2, "planar")


def second() -> tuple[Export, dtc.Model]:
    """Large enough for calls of per-segment functions and for the hand-written C kernels."""
    return small("other_arm", 3, "cardan")


def written(pair: tuple[Export, dtc.Model], folder: Path) -> Exported:
    export = pair[0]
    return dtc.export_c(export, folder / export.name)


def driver_table(exports: Sequence[Exported]) -> str:
    """`functions.inc` of the driver."""
    lines = [f'#include "{each.name}.h"' for each in exports]
    rows = []
    for each in exports:
        for function in each.functions:
            ins = function["inputs"]
            outs = [port for port in function["outputs"] if port["name"] != "status"]
            name, n = f"{each.name}_{function['name']}", len(ins) + len(outs)
            ports = ", ".join(f"p[{k}]" for k in range(n))
            head = f"static int call_{name}(void *work, size_t bytes, double **p)"
            lines.append(f"{head} {{ return (int){name}(work, bytes, {ports}); }}")
            sizes = ", ".join(str(port["rows"] * port["columns"]) for port in (*ins, *outs))
            fields = f'"{name}", call_{name}, sizeof({name}_work), {len(ins)}, {len(outs)}'
            rows.append(f"  {{{fields}, {{{sizes}}}}}")
    return "\n".join([*lines, "static const entry entries[] = {", ",\n".join(rows), "};\n"])


def sources(exports: Sequence[Exported]) -> list[Path]:
    return [p for e in exports for p in e.files if p.suffix == ".c" and p.name != "main.c"]


def driver(
    exports: Sequence[Exported], compiler: list[str], flags: Sequence[str], folder: Path
) -> Path:
    """The program that calls everything."""
    (folder / "functions.inc").write_text(driver_table(exports))
    includes = [f"-I{each.folder}" for each in exports]
    files = ["-o", "driver", DRIVER, *sources(exports), "-lm"]
    run([*compiler, "-Wall", "-Werror", *flags, "-I.", *includes, *files], folder)
    return folder / "driver"


def numbers(export: Export, model: dtc.Model) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """One random call of each function: what goes in, and what must come out."""
    taken, given = [], []
    for each in export.functions:
        arguments = random_arguments(model, each.function, 1)
        taken += [a[:, 0] for a in arguments]
        results = evaluated(each.function, arguments)
        kept = zip(each.outputs, results, strict=True)
        given += [result[0] for port, result in kept if port.name != "status"]
    return taken, given


def assert_driver_agrees(words: Sequence[object], pairs, folder: Path, **options) -> None:
    columns = [numbers(export, model) for export, model in pairs]
    taken = np.concatenate([a for column in columns for a in column[0]])
    given = [a for column in columns for a in column[1]]
    done = run(words, folder, input=taken.tobytes(), **options)
    result = np.split(np.frombuffer(done.stdout), np.cumsum([len(a) for a in given])[:-1])
    for got, wanted in zip(result, given, strict=True):
        # As in the parity tests: round-off times the condition of M.
        np.testing.assert_allclose(
            got, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max(initial=1.0)
        )


def test_two_exports_in_one_program_under_sanitizers(tmp_path):
    pairs = [first(), second()]
    exports = [written(pair, tmp_path) for pair in pairs]
    program = driver(exports, command("gcc"), ["-O0", *SANITIZED], tmp_path)
    assert_driver_agrees([program], pairs, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gcc", "clang", "g++"])
def test_everything_under_sanitizers(name, tmp_path):
    program = driver([everything().exported], command(name), ["-O1", *SANITIZED], tmp_path)
    assert_driver_agrees([program], [(everything().export, everything().model)], tmp_path)


def test_eight_threads(tmp_path):
    flags = ["-O1", "-g", "-fsanitize=thread", "-DTHREADS=8", "-pthread"]
    program = driver([written(first(), tmp_path)], ["gcc", "-std=gnu99"], flags, tmp_path)
    # Address randomisation may leave the sanitizer no room for its own tables.
    words = ["setarch", "-R", program] if shutil.which("setarch") else [program]
    assert_driver_agrees(words, [first()], tmp_path)


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="no valgrind")
def test_valgrind(tmp_path):
    program = driver([written(second(), tmp_path)], command("gcc"), ["-O0", "-g"], tmp_path)
    words = ["valgrind", "-q", "--error-exitcode=9", "--leak-check=full", program]
    assert_driver_agrees(words, [second()], tmp_path)


@pytest.mark.parametrize("name", COMPILERS)
def test_no_warnings(name, tmp_path):
    """The programs above are compiled with -Wall -Werror too."""
    compiler = command(name)
    for exported in (everything().exported, written(second(), tmp_path)):
        for path in (path for path in exported.files if path.suffix == ".c"):
            if not path.name.endswith("_core.c"):
                run([*compiler, *STRICT, "-O2", "-c", "-o", os.devnull, path], tmp_path)
            elif name != "gcc":
                run([*compiler, "-Wall", "-Werror", "-fsyntax-only", path], tmp_path)


def test_single_precision_promotes_nothing(tmp_path):
    (tmp_path / "core.c").write_text(c.core_body(second()[0], Settings(single=True)))
    warnings = ["-Wdouble-promotion", "-Wfloat-conversion", "-Wall", "-Werror"]
    run(["gcc", "-std=c99", *warnings, "-fsyntax-only", "core.c"], tmp_path)


def test_only_math_and_string_and_prefixed_symbols(tmp_path):
    """What the objects define begins with the prefix; what they need is in libm or is memcpy."""
    exported = written(second(), tmp_path)
    known = "sin cos sincos sqrt fmax fmin fabs tan atan2 asin acos exp pow memcpy memmove memset"
    for path in sources([exported]):
        run(["gcc", "-std=c99", "-O0", "-c", "-o", "x.o", path], tmp_path)
        for line in run(["nm", "x.o"], tmp_path).stdout.decode().splitlines():
            kind, symbol = line.split()[-2:]
            if kind == "U":
                assert symbol.startswith("other_arm_") or symbol in known.split(), symbol
            elif kind.isupper():
                assert symbol.startswith("other_arm_"), symbol
            # No global state: nothing in the data or bss sections, nor common.
            assert kind not in "dDbBC", line
        text = path.read_text()
        included = [line for line in text.splitlines() if line.startswith("#include")]
        assert set(included) <= {"#include <math.h>", '#include "other_arm.h"'}


def test_casadi_loads_the_function_and_its_ports():
    twin = ca.external("robot_raw_ode", str(everything().library))
    assert twin.name_in() == ["x", "u", "theta"] and twin.name_out() == ["xdot"]
    assert twin.size_in("x") == (everything().model.n_x, 1)
