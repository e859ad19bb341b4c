"""Operations of MX graphs on SX values: those that move entries, and those that compute."""

import casadi as ca

from ..kernels.axes import lu, lu_solve
from .expression import elementwise, unnamed

_SPLITS = {ca.OP_VERTSPLIT: ca.vertsplit, ca.OP_HORZSPLIT: ca.horzsplit}
_JOINS = {ca.OP_VERTCAT: ca.vertcat, ca.OP_HORZCAT: ca.horzcat, ca.OP_DIAGCAT: ca.diagcat}
_RECAST = (ca.OP_PROJECT,)
_MATRIX = {
    ca.OP_MTIMES: lambda z, x, y: z + ca.mtimes(x, y),
    ca.OP_DOT: ca.dot,
    ca.OP_NORM1: ca.norm_1,
    ca.OP_NORM2: ca.norm_2,
    ca.OP_NORMF: ca.norm_fro,
    ca.OP_NORMINF: ca.norm_inf,
    ca.OP_MMIN: ca.mmin,
    ca.OP_MMAX: ca.mmax,
    ca.OP_BILIN: ca.bilin,
    ca.OP_RANK1: ca.rank1,
}


def moved(operation: int, expression: ca.MX, given: list[ca.SX]) -> list[ca.SX] | None:
    """Results of an MX operation that only moves entries; None for any other."""
    if operation == ca.OP_CONST:
        return [ca.SX(expression.to_DM())]
    if operation in _SPLITS:
        axis = 0 if operation == ca.OP_VERTSPLIT else 1
        sizes = [expression.get_output(k).shape[axis] for k in range(expression.n_out())]
        offsets = [sum(sizes[:k]) for k in range(len(sizes) + 1)]
        return _SPLITS[operation](given[0], offsets)
    if operation in _JOINS:
        return [_JOINS[operation](*given)]
    if operation == ca.OP_TRANSPOSE:
        return [given[0].T]
    if operation == ca.OP_RESHAPE:
        return [ca.reshape(given[0], *expression.shape)]
    if operation in _RECAST:
        return [ca.project(given[0], expression.sparsity())]
    if operation == ca.OP_GETNONZEROS:
        places = [int(place) for place in expression.mapping().nonzeros()]
        entries = given[0].nz[places] if places else ca.SX(0, 1)
        return [ca.SX(expression.sparsity(), entries)]
    if operation == ca.OP_SETNONZEROS:
        value = ca.SX(given[0])
        value.nz[[int(place) for place in expression.mapping().nonzeros()]] = given[1].nz[:]
        return [value]
    return None


def computed(operation: int, expression: ca.MX, given: list[ca.SX]) -> ca.SX:
    """The result of an MX operation; linear systems by elimination without exchange of rows.

    Raises:
        ModelError: an operation without an expression.
    """
    if operation == ca.OP_SOLVE:
        rhs, matrix = given
        matrix = matrix.T if expression.info()["tr"] else matrix
        return lu_solve(lu(ca.densify(matrix)), ca.densify(rhs))
    if operation in _MATRIX:
        value = _MATRIX[operation](*given)
    elif not elementwise(operation):
        raise unnamed(operation)
    elif len(given) == 1:
        value = ca.SX.unary(operation, given[0])
    else:
        value = ca.SX.binary(operation, *given)
    return ca.project(value, expression.sparsity())
