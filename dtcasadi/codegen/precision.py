"""What single precision costs: the exported code against double precision on random states."""

import ctypes
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..compiler import (
    DEFAULT_TIMEOUT_S,
    LIBRARY_SUFFIX,
    build_library,
    find_compiler,
    target_of,
)
from .description import Export, Exposed, Port

N_STATES = 100
ANGLE, RATE = 1.0, 1.0


class Error(NamedTuple):
    """Relative error of a function over random states: median, maximum, and calls that failed.

    Of each result |difference| / |double|, largest entries; of several results the worst.
    """

    median: float
    largest: float
    failed: int


def measured(
    export: Export, core: str, symbol: Callable[[Exposed], str], flags: tuple[str, ...]
) -> dict[str, Error] | str:
    """Errors of single-precision C by function name, or why they are not known.

    States are random (angles within ANGLE rad, rates within RATE, pressures within the command's),
    rounded to single precision; theta is the robot's own.

    Args:
        export: what is exported.
        core: its single-precision C.
        symbol: CasADi's symbol of a function in it.
        flags: compiler flags.

    Raises:
        CompileError: the compiler fails.
    """
    compiler = find_compiler()
    if compiler is None:
        return "not measured: no C compiler"
    target = target_of(compiler, ("-std=c99", *flags, "-fPIC", "-shared"))
    with tempfile.TemporaryDirectory(prefix="dtcasadi-") as folder:
        library = Path(folder) / f"single{LIBRARY_SUFFIX}"
        build_library(compiler, target, core, library, DEFAULT_TIMEOUT_S)
        loaded = ctypes.CDLL(str(library))
        return {
            each.name: _error(export, each, _Single(loaded, symbol(each), each))
            for each in export.functions
        }


class _Single:
    """A function of a single-precision library on arrays."""

    def __init__(self, library: ctypes.CDLL, symbol: str, function: Exposed):
        self._call, self._outputs = getattr(library, symbol), function.outputs
        sizes = [ctypes.c_int() for _ in range(4)]
        getattr(library, f"{symbol}_work")(*map(ctypes.byref, sizes))
        arg, res, iw, w = (max(1, size.value) for size in sizes)
        self._arg, self._res = (ctypes.c_void_p * arg)(), (ctypes.c_void_p * res)()
        self._iw, self._w = (ctypes.c_int * iw)(), (ctypes.c_float * w)()

    def __call__(self, arrays: list[np.ndarray]) -> list[np.ndarray]:
        """Results, column-major and flat."""
        inputs = [np.ascontiguousarray(array, dtype=np.float32) for array in arrays]
        results = [np.zeros(port.size, dtype=np.float32) for port in self._outputs]
        for pointers, values in ((self._arg, inputs), (self._res, results)):
            for i, value in enumerate(values):
                pointers[i] = value.ctypes.data
        self._call(self._arg, self._res, self._iw, self._w, 0)
        return results


def _error(export: Export, function: Exposed, single: _Single) -> Error:
    rng = np.random.default_rng(1)
    errors, failed = [], 0
    for _ in range(N_STATES):
        arrays = [random_port(export, port, rng) for port in function.inputs]
        shaped = [
            array.reshape((port.rows, port.columns), order="F")
            for array, port in zip(arrays, function.inputs, strict=True)
        ]
        exact = [np.ravel(value.full(), order="F") for value in function.function.call(shaped)]
        worst = 0.0
        for port, value, rounded in zip(function.outputs, exact, single(arrays), strict=True):
            if port.name == "status":
                failed += int(rounded[0] != 0)
            elif port.size:
                scale = float(np.max(np.abs(value))) or 1.0
                worst = max(worst, float(np.max(np.abs(rounded - value))) / scale)
        errors.append(worst)
    return Error(float(np.median(errors)), float(np.max(errors)), failed)


def random_port(export: Export, port: Port, rng: np.random.Generator) -> np.ndarray:
    """A random argument in single precision, flat; theta as it is.

    A square matrix is drawn symmetric positive definite, as covariances and weights are.
    """
    if port.rows == port.columns > 1:
        root = rng.normal(size=(port.rows, port.rows))
        square = np.eye(port.rows) + root @ root.T / port.rows
        return square.ravel().astype(np.float32).astype(float)
    if port.name == "theta" and export.theta0 is not None:
        return export.theta0
    command = 1.0 if export.motion is None else float(np.max(np.abs(export.motion.command.values)))
    scales = {"rad": ANGLE, "rad/s": RATE, "Pa": command or 1.0}
    units = [label.unit for label in export.labels.get(port.name, ())] or [port.unit] * port.size
    scale = np.array([scales.get(unit, 1.0) for unit in units])
    value = rng.uniform(-scale, scale)
    if port.name == "x" and export.motion is not None:  # there is always some air in a chamber
        air = np.array([unit == "J" for unit in units])
        value[air] = export.motion.x0[air] * (1 + value[air] / 2)
    return value.astype(np.float32).astype(float)
