"""Shared by the tests of exported C: exports of small robots, their library called from Python."""

import atexit
import ctypes
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from oracles.robots import random_robot
from scene_texts import SMALL

import dtcasadi as dtc
from dtcasadi.codegen import Export, Exported
from dtcasadi.codegen.describe import described
from dtcasadi.compiler import LIBRARY_SUFFIX, Compiler, build_files, find_compiler
from dtcasadi.scene import parse_scene

GUARD = 64  # bytes of canary on either side of a buffer
CANARY = 0xA5
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
OK, NULL_POINTER, TOO_SMALL, MISALIGNED, OVERLAP, FAILED, NOT_FINITE, NOT_CONVERGED = range(8)


def small_scene(chart: str = "planar", initial: str = "") -> dtc.Scene:
    """A disc that falls under a pressure that changes."""
    text = SMALL.replace("t_end = 3", "t_end = 0.5\nstep = 0.05\nmethod = 'heun'")
    text = text.replace("count = 3", "count = 2").replace("count = 2\nlength", "length")
    return parse_scene(
        (text + WAVE + f'[model]\nchart = "{chart}"\n{initial}').encode(), name="small"
    )


@cache
def robot_model(n_discs: int, chart: str = "cardan", **options: Any) -> dtc.Model:
    """A random robot with every kind of force."""
    return dtc.build(random_robot(np.random.default_rng(n_discs), n_discs), chart=chart, **options)


def gcc() -> Compiler:
    """The C compiler; the tests that need one are skipped without."""
    compiler = find_compiler()
    assert compiler is not None
    return compiler


@dataclass(frozen=True)
class Everything:
    """All that is exported of two discs in space: model, description, folder, library.

    The second disc carries a free wrench, so that every function of the default has a use.
    """

    model: dtc.Model
    export: Export
    exported: Exported
    library: Path


@cache
def everything() -> Everything:
    """Built once in a session."""
    folder = Path(tempfile.mkdtemp(prefix="dtcasadi-tests-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    model = robot_model(2, wrenches=(2,))
    export = described(model, name="robot")
    exported = dtc.export_c(export, folder / "c")
    return Everything(model, export, exported, built(exported, ["-O0", "-Wall", "-Werror"], folder))


def built(exported: Exported, flags: Sequence[str], folder: Path) -> Path:
    """The export as a shared library in a folder of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    sources = [str(path) for path in exported.files if path.suffix == ".c" and path.stem != "main"]
    library = folder / f"lib{exported.name}{LIBRARY_SUFFIX}"
    # GCC's start files for -ffast-math would flush this whole process's small numbers to zero.
    whole = ["-std=c99", *flags, "-fPIC", "-shared", "-nostartfiles"]
    build_files(gcc(), whole, sources, library, 600.0)
    return library


class Guarded:
    """Memory with canaries on either side."""

    def __init__(self, size: int, fill: bytes = b""):
        self._size = size
        self._raw = np.full(size + 2 * GUARD + 16, CANARY, dtype=np.uint8)
        start = self._raw.ctypes.data + GUARD
        self._start = GUARD + (-start) % 16
        self.address = self._raw.ctypes.data + self._start
        self.bytes = self._raw[self._start : self._start + size]
        if fill:
            self.bytes[:] = np.frombuffer(fill, dtype=np.uint8)

    def intact(self) -> bool:
        """Whether nothing around it was written."""
        before, after = self._raw[: self._start], self._raw[self._start + self._size :]
        return bool(np.all(before == CANARY) and np.all(after == CANARY))


def work_bytes(function: Any, real: int = 8, integer: int = 8) -> int:
    """Size of a function's work-space struct, its arrays one entry long at least."""
    arg, res, iw, w = (
        max(1, function["work"][key]) for key in ("sz_arg", "sz_res", "sz_iw", "sz_w")
    )
    return -(-(8 * (arg + res) + integer * iw + real * w) // 8) * 8  # aligned as its pointers are


class Library:
    """An exported library whose wrappers take and return arrays, in its own precision."""

    def __init__(self, exported: Exported, path: Path, *, single: bool = False):
        self._real: Any = np.float32 if single else np.float64
        self._sizes = (4, 4) if single else (8, 8)
        self.name, self.folder = exported.name, exported.folder
        self.library = ctypes.CDLL(str(path))
        self.functions = {each["name"]: each for each in exported.functions}

    def ports(self, name: str) -> tuple[list[dict], list[dict]]:
        """Inputs, and outputs without the status."""
        function = self.functions[name]
        return function["inputs"], [p for p in function["outputs"] if p["name"] != "status"]

    def raw(self, name: str, addresses: Sequence[int | None], work: int, n_bytes: int) -> int:
        """The wrapper on bare addresses; its status."""
        pointers = [ctypes.c_void_p(address) for address in addresses]
        call = getattr(self.library, f"{self.name}_{name}")
        return call(ctypes.c_void_p(work), ctypes.c_size_t(n_bytes), *pointers)

    def call(self, name: str, arrays: Sequence[np.ndarray]) -> tuple[int, list[np.ndarray]]:
        """Status and results; every buffer exactly as large as needed and guarded."""
        inputs, outputs = self.ports(name)
        handed = [flat(array).astype(self._real) for array in arrays]
        taken = [Guarded(a.nbytes, a.tobytes()) for a in handed]
        given = [Guarded(self._sizes[0] * p["rows"] * p["columns"]) for p in outputs]
        work = Guarded(work_bytes(self.functions[name], *self._sizes))
        addresses = [buffer.address for buffer in (*taken, *given)]
        status = self.raw(name, addresses, work.address, len(work.bytes))
        assert all(buffer.intact() for buffer in (*taken, *given, work)), name
        for buffer, array in zip(taken, handed, strict=True):
            assert buffer.bytes.tobytes() == array.tobytes(), f"{name} wrote to an argument"
        return status, [buffer.bytes.view(self._real).copy() for buffer in given]


def flat(array: Any) -> np.ndarray:
    """Column-major numbers."""
    return np.ravel(np.asarray(array, dtype=float), order="F")


def random_arguments(model: dtc.Model, function: ca.Function, n: int, seed: int = 1) -> list:
    """Arguments within 0.5 rad, 1 rad/s and so on, one column for each of n calls.

    theta is the model's own with the wrenches, where there are any, random.
    """
    rng = np.random.default_rng(seed)
    arguments = []
    for i, port in enumerate(function.name_in()):
        size = function.size1_in(i)
        scale = 0.5 if port == "q" else 1.0
        values = rng.uniform(-scale, scale, (size, n))
        if port == "x":
            values[: model.n_q] *= 0.5
        if port == "theta":
            values = np.repeat(model.theta0[:, np.newaxis], n, axis=1)
            loads = model.theta_blocks.get("wrench", slice(0, 0))
            values[loads] = rng.uniform(-scale, scale, values[loads].shape)
        arguments.append(values)
    return arguments


def evaluated(function: ca.Function, arguments: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Results for all columns of the arguments, each call's flat, shape (n, size)."""
    n = arguments[0].shape[1]
    # More columns than a port has: CasADi evaluates once for each.
    results = [value.full() for value in function.call([ca.DM(a) for a in arguments])]
    shapes = [function.size_out(i) for i in range(function.n_out())]
    return [
        value.reshape(rows, n, columns).transpose(1, 2, 0).reshape(n, -1)
        for value, (rows, columns) in zip(results, shapes, strict=True)
    ]


def difference(values: np.ndarray, reference: np.ndarray) -> float:
    """Largest entry of the difference over the largest of the reference, the worst row."""
    if not reference.size:
        return 0.0
    scale = np.max(np.abs(reference), axis=1)
    worst = np.max(np.abs(values - reference), axis=1) / np.where(scale > 0, scale, 1.0)
    return float(np.max(worst))
