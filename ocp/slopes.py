"""Functions whose derivatives are given, so that second derivatives are those of Gauss-Newton."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca


def first_order(
    name: str, value: ca.Function, slopes: ca.Function, blocks: Sequence[int | None]
) -> ca.Function:
    r"""A Function with a derivative of its own that itself has none.

    The Hessian of :math:`|r(w)|_W^2 + \lambda^T g(w)` that CasADi makes of such Functions is
    :math:`2 r_w^T W r_w`: the matrix of Gauss and Newton, positive semidefinite, for any solver
    (Nocedal and Wright, Numerical Optimization, section 10.3).

    Args:
        name: of the Function.
        value: with one output.
        slopes: of the same inputs.
        blocks: for each input, which output of `slopes` is the derivative; None: zero.
    """
    inputs, ports = value.mx_in(), value.name_in()
    n, port = value.size1_out(0), value.name_out(0)
    unused = ca.MX.sym("value", ca.Sparsity(n, 1))
    found = slopes.call(inputs)
    columns = [
        ca.MX(n, i.shape[0]) if k is None else ca.densify(found[k])
        for i, k in zip(inputs, blocks, strict=True)
    ]
    names = [f"jac_{port}_{given}" for given in ports]
    flat = {"is_diff_in": [False] * (len(inputs) + 1), "never_inline": True}
    options = {**flat, "is_diff_out": [False] * len(columns)}
    jacobian = ca.Function(
        f"jac_{name}", [*inputs, unused], columns, [*ports, f"out_{port}"], names, options
    )
    return ca.Function(
        name,
        inputs,
        value.call(inputs),
        ports,
        [port],
        {"custom_jacobian": jacobian, "jac_penalty": 0.0, "never_inline": True},
    )
