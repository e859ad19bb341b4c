"""Slopes that solvers use: Gauss-Newton's second derivatives, and the model's at its limits."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from .stages import Stages

# How far from the limits the model is linearized, in shares of a command's range.
_INSIDE = 1e-9


def ranges(stages: Stages) -> np.ndarray:
    """Range of each command, 1 where it has none, shape (n_u,) [Pa]."""
    span = stages.upper.max(axis=0) - stages.lower.min(axis=0)
    return np.where(np.isfinite(span) & (span > 0), span, 1.0)


def inside(stages: Stages, u: ca.MX | np.ndarray) -> ca.MX:
    """Commands (n_u, n) as the model is linearized at them: a little within the widest limits.

    An actuator that cuts commands off at the same limits has a kink there, of which CasADi's
    derivative is half the slope that holds within.
    """
    margin = _INSIDE * ranges(stages)
    lower = np.clip(stages.lower.min(axis=0) + margin, -1e300, 1e300)
    upper = np.clip(stages.upper.max(axis=0) - margin, -1e300, 1e300)
    n = u.shape[1] if len(u.shape) > 1 else 1
    low, high = (ca.repmat(ca.DM(side), 1, n) for side in (lower, upper))
    return ca.fmin(ca.fmax(u, low), high)


def inner_slopes(stages: Stages, linearize: ca.Function) -> ca.Function:
    """A Function x, u, theta -> value, slopes ... with the slopes of `inside` commands.

    Args:
        stages: with the limits.
        linearize: Function of the same ports.
    """
    x, u, theta = ports = linearize.mx_in()
    values = linearize.call([x, inside(stages, u), theta])
    return ca.Function("inner_slopes", ports, values, linearize.name_in(), linearize.name_out())


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
