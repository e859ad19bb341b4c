"""Calling a casadi Function on NumPy arrays through preallocated buffers."""

from collections import namedtuple
from collections.abc import Collection, Sequence
from functools import cache
from typing import Any, final

import casadi as ca
import numpy as np

from .checks import shown
from .errors import ModelError

# Ports of a model's Functions that stay matrices even with one column.
MATRICES = frozenset(
    "M R r J dtau_dq dtau_dqd F_x F_u F_theta dqdd_dq dqdd_dqd dqdd_dpressure dqdd_dtau".split()
)
_FLOAT = np.dtype(np.float64)


def densified(function: ca.Function, name: str | None = None) -> ca.Function:
    """The same function with dense ports, renamed where a name is given.

    A buffer holds the nonzeros of a port and nothing else; dense, they are the whole matrix.

    Returns:
        `function` itself where there is nothing to change.
    """
    sparsities = [function.sparsity_in(i) for i in range(function.n_in())]
    sparsities += [function.sparsity_out(i) for i in range(function.n_out())]
    if name is None and all(sparsity.is_dense() for sparsity in sparsities):
        return function
    scalar = function.is_a("SXFunction")
    symbol = ca.SX.sym if scalar else ca.MX.sym
    inputs = [symbol(port, *function.size_in(port)) for port in function.name_in()]
    # Inlined, the wrapper costs nothing: no copy of the arguments, no extra call.
    results = function.call(inputs, not scalar, False)
    dense = [ca.densify(result) for result in results]
    ports = (function.name_in(), function.name_out())
    return ca.Function(name or function.name(), inputs, dense, *ports)


@final
class Bound:
    """A casadi Function bound to buffers: arrays in, arrays out.

    `bound(*arrays)` copies in, evaluates and returns fresh arrays. Hot loops skip the copies::

        bound.inputs.q[:] = q
        bound.run()
        use(bound.outputs.qdd)      # overwritten by the next run

    A port with one column is an array of shape (n,), any other of shape (rows, columns).

    The buffers are shared by all calls: make one Bound per thread.

    Attributes:
        function: the Function evaluated, its ports dense.
        name: what errors call it.
        inputs: named tuple of views of the input buffers, writable, column-major.
        outputs: named tuple of views of the output buffers, column-major.
        run: evaluates from `inputs` to `outputs` and checks nothing.
    """

    __slots__ = ("_buffer", "_result", "function", "inputs", "name", "outputs", "run")

    def __init__(
        self, function: ca.Function, *, matrices: Collection[str] = (), name: str | None = None
    ) -> None:
        """Allocate the buffers and bind them.

        Args:
            function: an SX, MX or external Function.
            matrices: ports that keep shape (rows, columns) even where they have one column:
                a mass matrix of one coordinate, a Jacobian by one input.
            name: what errors call it; by default the name of the Function.

        Raises:
            ModelError: `matrices` names a port that the Function does not have.
        """
        self.function = densified(function)
        self.name = name or function.name()
        names_in, names_out = function.name_in(), function.name_out()
        for port in matrices:
            if port not in (*names_in, *names_out):
                known = ", ".join((*names_in, *names_out))
                raise ModelError(f"{self.name}: matrices: expected ports of {known}, got {port!r}")
        shapes_in = [function.size_in(i) for i in range(len(names_in))]
        shapes_out = [function.size_out(i) for i in range(len(names_out))]
        flat_in = [np.zeros(rows * columns) for rows, columns in shapes_in]
        flat_out = [np.zeros(rows * columns) for rows, columns in shapes_out]
        self._buffer, self.run = self.function.buffer()
        for i, flat in enumerate(flat_in):
            self._buffer.set_arg(i, flat.data)
        for i, flat in enumerate(flat_out):
            self._buffer.set_res(i, flat.data)
        # casadi keeps bare addresses: whoever holds `run` must hold what they point to.
        self.run.keeps = (self._buffer, flat_in, flat_out)
        self.inputs = named_ports(
            "Inputs", names_in, _views(names_in, flat_in, shapes_in, matrices)
        )
        views = _views(names_out, flat_out, shapes_out, matrices)
        self.outputs = named_ports("Outputs", names_out, views)
        self._result = type(self.outputs)._make

    def __call__(self, *arrays: Any) -> Any:
        """Evaluate.

        Args:
            arrays: one per input port, of the port's shape; a column is (n,) or (n, 1).

        Returns:
            The output, a fresh array; several outputs as a named tuple of fresh arrays.

        Raises:
            ModelError: wrong number of arguments, a wrong shape, something else than real
                numbers, or the Function reports that its evaluation failed.
        """
        inputs = self.inputs
        if len(arrays) != len(inputs):
            ports = ", ".join(self.function.name_in())
            expected = f"expected {len(inputs)} arguments ({ports})"
            raise ModelError(f"{self.name}: {expected}, got {len(arrays)}")
        for i, array in enumerate(arrays):
            view = inputs[i]
            # The shapes are compared because NumPy would broadcast a wrong one silently.
            if type(array) is np.ndarray and array.shape == view.shape and array.dtype == _FLOAT:
                view[...] = array
            else:
                view[...] = self._fitted(i, array)
        try:
            self.run()
        except RuntimeError as error:
            raise ModelError(f"{self.name}: evaluation failed: {error}") from error
        if self._buffer.ret() != 0:
            raise ModelError(f"{self.name}: evaluation failed, casadi returned an error code")
        if len(self.outputs) == 1:
            return self.outputs[0].copy()
        return self._result([view.copy() for view in self.outputs])

    def _fitted(self, i: int, value: object) -> np.ndarray:
        """A real array of the shape of input i, or an error naming the port."""
        port = f"{self.name}: {self.function.name_in(i)}"
        try:
            array = np.asarray(value)
        except ValueError:  # nested lists of unequal lengths
            raise ModelError(f"{port}: expected real numbers, got {shown(value)}") from None
        if array.dtype.kind not in "fiub":
            raise ModelError(f"{port}: expected real numbers, got {shown(value)}")
        shape = self.inputs[i].shape
        # As casadi reads shapes: a number is (1, 1), a vector is a column.
        if (*array.shape, 1, 1)[:2] != (*shape, 1)[:2] or array.ndim > 2:
            raise ModelError(f"{port}: expected shape {shape}, got {array.shape}")
        return array.reshape(shape)


def _views(
    names: Sequence[str],
    flats: Sequence[np.ndarray],
    shapes: Sequence[tuple[int, int]],
    matrices: Collection[str],
) -> list[np.ndarray]:
    """Column-major views of the buffers; one column is a vector unless named in `matrices`."""
    return [
        flat if columns == 1 and name not in matrices else flat.reshape(rows, columns, order="F")
        for name, flat, (rows, columns) in zip(names, flats, shapes, strict=True)
    ]


@cache
def _port_type(title: str, names: tuple[str, ...]) -> Any:
    # Port names are known at run time only, and may be Python keywords: those become _0, _1, ...
    return namedtuple(title, names, rename=True)


def named_ports(title: str, names: Sequence[str], views: Sequence[np.ndarray]) -> Any:
    """Arrays as a named tuple of the ports' names."""
    return _port_type(title, tuple(names))(*views)


__all__ = ["MATRICES", "Bound", "densified", "named_ports"]
