"""Dense linear solves inside graphs."""

import re
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import Any

import casadi as ca

from .kernels.axes import ldl, ldl_solve, lu, lu_solve

# Unrolled up to this size; beyond it the C code of an unrolled solve outgrows its gain in speed.
UNROLLED = 8
# Operations of C kernels by their sizes, to the leading terms (Golub, Van Loan, chapters 3 and 4).
_OPERATIONS: dict[str, Callable[..., int]] = {
    "lu_factor": lambda n: 2 * n**3 // 3,
    "lu_solve": lambda n, m: 2 * n**2 * m,
    "solve_spd": lambda n, m: n**3 // 3 + 2 * n**2 * m,
    "multiply": lambda n, k, m: 2 * n * k * m,
}


def solve_spd(matrix: ca.SX | ca.MX, rhs: ca.SX | ca.MX, *, native: bool) -> ca.SX | ca.MX:
    """X with matrix X = rhs, matrix (n, n) symmetric positive definite.

    SX is unrolled. MX calls CasADi's LDL^T solver, or with `native` the C kernel
    `native/solve_spd.c`, which only generated code can run.
    """
    n, m = matrix.shape[0], rhs.shape[1]
    if n == 0 or m == 0:
        return rhs
    if isinstance(matrix, ca.SX):
        return ldl_solve(ldl(matrix), rhs)
    rhs = ca.densify(rhs)
    if not native:
        return ca.solve(matrix, rhs, "ldl")
    sizes = {"A": (n, n), "B": (n, m), "X": (n, m)}
    return native_function("solve_spd", ("A", "B"), ("X",), sizes, N=n, M=m)(matrix, rhs)


def product(left: ca.SX | ca.MX, right: ca.SX | ca.MX, *, native: bool) -> ca.SX | ca.MX:
    """The product; with `native`, MX calls the C kernel `native/multiply.c`, for generated code."""
    n, k, m = left.shape[0], left.shape[1], right.shape[1]
    if not native or isinstance(left, ca.SX) or not n * k * m:
        return ca.mtimes(left, right)
    sizes = {"A": (n, k), "B": (k, m), "C": (n, m)}
    kernel = native_function("multiply", ("A", "B"), ("C",), sizes, N=n, K=k, M=m)
    return kernel(ca.densify(left), ca.densify(right))


class Factored:
    """A square matrix factored once for several solves.

    MX, native: LU with partial pivoting by `native/lu_factor.c` and `native/lu_solve.c`; otherwise
    CasADi's QR, which the virtual machine can run and differentiate. SX: unrolled LU without
    pivoting, for matrices close to a mass matrix; what it loses otherwise shows in the step's own
    residual or error estimate.

    Attributes:
        matrix: what was factored, shape (n, n).
        size: n.
        native: whether the factors are those of `lu_factor.c`: LU (n, n) and pivots (n, 1).
        factors: unrolled, or native; else there are none.
    """

    def __init__(self, matrix: ca.SX | ca.MX, *, native: bool):
        self.matrix, self.size = ca.densify(matrix), matrix.shape[0]
        self._unrolled = isinstance(matrix, ca.SX)
        self.native = native and not self._unrolled
        self.factors: Any = None
        if self._unrolled:
            self.factors = lu(self.matrix)
        elif native and self.size:
            n = self.size
            sizes = {"A": (n, n), "LU": (n, n), "P": (n, 1)}
            factor = native_function("lu_factor", ("A",), ("LU", "P"), sizes, N=n)
            self.factors = factor.call([self.matrix])

    def solve(self, rhs: ca.SX | ca.MX) -> ca.SX | ca.MX:
        """X with matrix X = rhs, shape (n, m)."""
        n, m = self.size, rhs.shape[1]
        if n == 0 or m == 0:
            return rhs
        if self._unrolled:
            return lu_solve(self.factors, rhs)
        rhs = ca.densify(rhs)
        if not self.native:
            return ca.solve(self.matrix, rhs, "qr")
        sizes = {"LU": (n, n), "P": (n, 1), "B": (n, m), "X": (n, m)}
        kernel = native_function("lu_solve", ("LU", "P", "B"), ("X",), sizes, N=n, M=m)
        return kernel(*self.factors, rhs)


def native_function(
    name: str,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    sizes: dict[str, tuple[int, int]],
    **constants: int,
) -> ca.Function:
    """A hand-written C kernel as a Function whose body code generation embeds.

    Args:
        name: file in `dtcasadi/native` without its ending; it uses the ports as arrays.
        inputs: names of the input ports.
        outputs: names of the output ports.
        sizes: shape of every port.
        constants: integers the file names by capital letters.
    """
    body = _source(name)
    for symbol, value in constants.items():
        body = re.sub(rf"\b{symbol}\b", str(value), body)
    shapes = [[ca.Sparsity.dense(*sizes[port]) for port in ports] for ports in (inputs, outputs)]
    label = "_".join([name, *map(str, constants.values())])
    # Without jit=False, CasADi would compile the body at once, in the current folder.
    options = {"jit": False}
    return ca.Function.jit(label, body, list(inputs), list(outputs), *shapes, options)


def kernel_operations(kernel: ca.Function) -> int:
    """Additions and multiplications of one call of a `native_function`.

    For kernels without a formula here, whose number depends on the data: the numbers they read.
    """
    label, constants = kernel.name(), list[int]()
    while (parts := label.rpartition("_"))[2].isdigit():
        label, constants = parts[0], [int(parts[2]), *constants]
    count = _OPERATIONS.get(label)
    return count(*constants) if count else int(kernel.nnz_in())


@cache
def _source(name: str) -> str:
    return (files(__package__) / "native" / f"{name}.c").read_text(encoding="utf-8")
