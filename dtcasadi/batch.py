"""Many robots in one call: the same equations for a column of states and parameters each.

Where there is a C++ compiler, 8 robots (AVX-512), 4 (AVX) or 2 share every instruction
(`dtcasadi.lanes`); elsewhere CasADi's `map` calls the C twin, or the virtual machine, for one
after the other.
"""

import ctypes
import threading
import warnings
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from typing import Any, NamedTuple, Protocol

import casadi as ca
import numpy as np

from .bound import MATRICES, Bound, densified, named_ports
from .checks import shown
from .compile import CXX, CXX_FLAGS, PREFIX, c_source, library_of, twin
from .discrete import DiscreteModel
from .errors import CompileError, ModelError
from .lanes import lanes_source, obstacle
from .model import Model

_FAILED = 5  # of native/batch.hpp


class OneByOneWarning(UserWarning):
    """The robots of a batch are computed one after the other, not on SIMD lanes."""


class Engine(Protocol):
    """Evaluates arrays of shape (entries, n), or (entries,) for the same in all robots."""

    def __call__(self, arrays: Sequence[np.ndarray], n: int) -> list[np.ndarray]:
        """Results of shape (entries, n), fresh arrays."""


@dataclass(frozen=True, eq=False)
class Batch:
    """A Function for many robots at once: `batch(*arrays)`.

    A vector argument is of shape (rows, n), a column for each robot, or (rows,), the same for all;
    a matrix (rows, columns, n) or (rows, columns). One of them must say how many robots there are.
    Results have the robots last. Arrays whose rows are contiguous, as NumPy makes them, are not
    copied. Calls from several threads may run at the same time.

    Attributes:
        function: what is evaluated, its ports dense.
        lanes: robots that are computed at a time.
        why: why it is one at a time; empty on SIMD lanes.
        matrices: ports that keep shape (rows, columns, n) even with one column.
    """

    function: ca.Function
    lanes: int
    why: str
    matrices: frozenset[str]
    _engine: Engine

    def __call__(self, *arrays: Any) -> Any:
        """Evaluate.

        Args:
            arrays: one per argument of the Function.

        Returns:
            The result, or several as a named tuple.

        Raises:
            ModelError: wrong number of arguments, a wrong shape, something else than real numbers,
                or the evaluation itself fails.
        """
        ports = self._ports_in
        if len(arrays) != len(ports):
            expected = f"expected {len(ports)} arguments ({', '.join(port.name for port in ports)})"
            raise ModelError(f"{self.function.name()}: {expected}, got {len(arrays)}")
        fitted = [self._fitted(*pair) for pair in zip(ports, arrays, strict=True)]
        counts = {array.shape[1] for array in fitted if array.ndim == 2}
        if len(counts) != 1:
            expected = f"{self.function.name()}: expected arguments with a column for each robot"
            found = f"{sorted(counts)} columns" if counts else "none with columns"
            raise ModelError(f"{expected}, got {found}")
        columns = self._engine(fitted, next(iter(counts)))
        results = [_shaped(*pair) for pair in zip(self._ports_out, columns, strict=True)]
        names = [port.name for port in self._ports_out]
        return results[0] if len(results) == 1 else named_ports("Outputs", names, results)

    def _fitted(self, port: "_Port", value: object) -> np.ndarray:
        """An argument as (entries, n) or (entries,), entries in column-major order."""
        try:
            array = np.asarray(value)
        except ValueError:  # nested lists of unequal lengths
            array = np.array(None)
        if array.dtype.kind not in "fiub":
            raise self._misfit(port, "real numbers", shown(value))
        array = array.astype(np.float64, copy=False)
        one = port.shape
        if array.ndim == 0 and one == (1,):
            array = array.reshape(1)
        if array.shape[: len(one)] != one or array.ndim > len(one) + 1:
            raise self._misfit(port, f"shape {one} or {(*one, 'n')}", array.shape)
        if len(one) == 1:
            return array
        return array.swapaxes(0, 1).reshape(one[0] * one[1], *array.shape[2:])

    def _misfit(self, port: "_Port", expected: str, got: object) -> ModelError:
        return ModelError(f"{self.function.name()}: {port.name}: expected {expected}, got {got}")

    # Asking CasADi takes as long as some robots do.
    @cached_property
    def _ports_in(self) -> "list[_Port]":
        f = self.function
        return [self._port(f.name_in(i), f.size_in(i)) for i in range(f.n_in())]

    @cached_property
    def _ports_out(self) -> "list[_Port]":
        f = self.function
        return [self._port(f.name_out(i), f.size_out(i)) for i in range(f.n_out())]

    def _port(self, name: str, size: tuple[int, int]) -> "_Port":
        return _Port(name, size if size[1] != 1 or name in self.matrices else size[:1])


class _Port(NamedTuple):
    name: str
    shape: tuple[int, ...]  # of one robot's


def _shaped(port: _Port, result: np.ndarray) -> np.ndarray:
    if len(port.shape) == 1:
        return result
    rows, columns = port.shape
    return result.reshape(columns, rows, result.shape[1]).swapaxes(0, 1)


def batch(
    source: Model | DiscreteModel | ca.Function,
    name: str | None = None,
    *,
    native: ca.Function | None = None,
    matrices: Collection[str] = (),
    flags: Sequence[str] = CXX_FLAGS,
) -> Batch:
    """A Function for many robots at once, each with its own state and, by `theta`, its own numbers.

    Robots differ in what `dtcasadi.build(parameters=...)` left free in theta. They advance together
    with `batch(model.discrete(step_s, method="rk4"))`.

    Args:
        source: a model, a discrete model or any casadi Function.
        name: which Function of a model; default `ode`, of a discrete model `step`.
        native: a casadi Function again with hand-written C kernels inside, which only generated
            code can run; models know their own.
        matrices: ports of a casadi Function that stay matrices even with one column.
        flags: compiler flags.

    Returns:
        A `Batch`. Where it cannot use SIMD lanes, its `why` and a OneByOneWarning tell the reason.

    Raises:
        ModelError: an unknown name.
    """
    if isinstance(source, ca.Function):
        if name is not None:
            raise ModelError(f"name: expected none with a casadi Function, got {name!r}")
        text, one = native or source, source
    elif isinstance(source, Model | DiscreteModel):
        name = name or ("ode" if isinstance(source, Model) else "step")
        one, text = source.plain(name), source.native(name)
        matrices = MATRICES
    else:
        expected = "expected a Model, a DiscreteModel or a casadi Function"
        raise ModelError(f"source: {expected}, got {shown(source)}")
    function = densified(one)
    kept = frozenset(matrices).intersection((*function.name_in(), *function.name_out()))
    try:
        engine = _on_lanes(text, flags)
    except CompileError as error:
        why = str(error)
        warnings.warn(f"{function.name()}: one robot at a time: {why}", OneByOneWarning, 2)
        return Batch(function, 1, why, kept, _Mapped(twin(one, source=text)))
    return Batch(function, engine.lanes, "", kept, engine)


def _on_lanes(function: ca.Function, flags: Sequence[str]) -> "_Lanes":
    """The Function compiled for SIMD lanes.

    Raises:
        CompileError: it branches on numbers, or there is no compiler that takes it.
    """
    why = obstacle(function)
    if why:
        raise CompileError(why)
    symbol = PREFIX + function.name()
    source = lanes_source(c_source([function]), {symbol: densified(function)})
    try:
        library = ctypes.CDLL(str(library_of(source, CXX, flags=flags)))
    except OSError as error:
        raise CompileError(f"its library does not load: {error}") from error
    return _Lanes(library, symbol, [function.numel_out(i) for i in range(function.n_out())])


class _Lanes:
    """The compiled `<symbol>_batch` of a library."""

    def __init__(self, library: ctypes.CDLL, symbol: str, rows_out: Sequence[int]):
        self._run = library[f"{symbol}_batch"]
        pointers = [ctypes.c_void_p] * 5
        self._run.argtypes = [ctypes.c_size_t, *pointers, ctypes.c_size_t]
        size = library[f"{symbol}_batch_bytes"]
        size.restype = ctypes.c_size_t
        self._bytes = size()
        self.lanes = library[f"{symbol}_batch_lanes"]()
        self._ends = list(accumulate(rows_out, initial=0))
        self._local = threading.local()

    def __call__(self, arrays: Sequence[np.ndarray], n: int) -> list[np.ndarray]:
        given = [_rows_contiguous(array, n) for array in arrays]
        block = np.empty((self._ends[-1], n))
        if not hasattr(self._local, "work"):
            self._local.work = np.empty(self._bytes, dtype=np.uint8)
            self._local.at = _address(self._local.work)
        first, row = _address(block), n * block.itemsize
        # Tables of ctypes' own: NumPy's take as long to make as some robots do.
        tables = (
            [_address(array) for array, _ in given],
            [ld for _, ld in given],
            [first + row * start for start in self._ends[:-1]],
            [n] * (len(self._ends) - 1),
        )
        sizes = [(ctypes.c_size_t * len(table))(*table) for table in tables]
        code = self._run(n, *sizes, self._local.at, self._bytes)
        if code == _FAILED:
            raise ModelError("evaluation failed, casadi returned an error code")
        return [block[start:stop] for start, stop in pairwise(self._ends)]


def _rows_contiguous(array: np.ndarray, n: int) -> tuple[np.ndarray, int]:
    """An array whose rows are contiguous, and the distance of their starts, 0 for one column."""
    if array.ndim == 1:
        return np.ascontiguousarray(array), 0
    apart, step = array.strides
    if n > 1 and step == 0:
        return np.ascontiguousarray(array[:, 0]), 0
    if step != array.itemsize or apart < n * step or apart % step:
        return np.ascontiguousarray(array), max(n, 1)
    return array, apart // step


def _address(array: np.ndarray) -> int:
    # A fifth of the time that `array.ctypes.data` takes.
    return int(array.__array_interface__["data"][0])


class _Mapped:
    """CasADi's map of a Function, made again where the number of robots changes."""

    def __init__(self, function: ca.Function):
        self._function = function
        self._local = threading.local()

    def __call__(self, arrays: Sequence[np.ndarray], n: int) -> list[np.ndarray]:
        if n == 0:
            return [
                np.empty((self._function.numel_out(i), 0)) for i in range(self._function.n_out())
            ]
        if getattr(self._local, "n", None) != n:
            self._local.n, self._local.bound = n, Bound(self._function.map(n))
        bound = self._local.bound
        for view, array in zip(bound.inputs, arrays, strict=True):
            _robots(view, n)[...] = array.T
        bound.run()
        return [np.ascontiguousarray(_robots(view, n).T) for view in bound.outputs]


def _robots(view: np.ndarray, n: int) -> np.ndarray:
    """A mapped port's buffer as (n, entries), a row for each robot."""
    return view.reshape(-1, order="F").reshape(n, -1) if view.size else np.empty((n, 0))
