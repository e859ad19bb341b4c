"""Derivatives of accelerations under constraints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from ..linear import solve_spd
from .system import minimum_norm

if TYPE_CHECKING:
    from ..graphs import Graphs


def constraint_part(g: Graphs) -> ca.Function:
    """A, d(A^T lambda)/dq and d(A qdd + bias)/d(q, qd) at (q, qd, qdd, lambda, theta)."""
    _, A, bias = g.constraint_terms(g.q, g.qd, g.theta)
    multipliers = g.chain.asm.sym("multipliers", A.shape[0])
    held = ca.mtimes(A, g.qdd) + bias
    blocks = [A, ca.jacobian(ca.mtimes(A.T, multipliers), g.q)]
    blocks += [ca.jacobian(held, by) for by in (g.q, g.qd)]
    ports = [g.q, g.qd, g.qdd, multipliers, g.theta]
    return ca.Function("constraint_part", ports, blocks, {"cse": True})


def multipliers_of(g: Graphs) -> ca.Function:
    """Multipliers at (q, qd, pressure, tau, theta)."""
    _, value = g.motion_of(g.q, g.qd, g.pressure, g.tau)
    ports = [g.q, g.qd, g.pressure, g.tau, g.theta]
    return ca.Function("multipliers_of", ports, [value], {"cse": True})


def constrained_columns(g: Graphs, M: ca.SX, rhs: list[ca.SX], at: list[ca.SX]) -> list[ca.SX]:
    r"""Derivatives of qdd from those of the free balance.

    .. math:: M\,dq̈ + A^T d\lambda = rhs - d(A^T \lambda), \qquad A\,dq̈ = -d(A q̈ + bias)

    at fixed qdd and lambda on the right side.

    Args:
        g: the model's graphs.
        M: the mass matrix.
        rhs: columns for q, qd and what else there is.
        at: q, qd, qdd, lambda, theta.
    """
    A, pull, held_q, held_qd = constraint_part(g).call(at)
    rhs = [rhs[0] - pull, *rhs[1:]]
    held = ca.horzcat(held_q, held_qd, *(type(A)(A.shape[0], r.shape[1]) for r in rhs[2:]))
    both = solve_spd(M, ca.horzcat(*rhs, A.T), native=g.native)
    n = held.shape[1]
    free, Y = ca.horzsplit(both, [0, n, n + A.shape[0]])
    change = minimum_norm(ca.mtimes(A, Y), ca.mtimes(A, free) + held, native=g.native)
    sizes = np.cumsum([0, *(r.shape[1] for r in rhs)]).tolist()
    return ca.horzsplit(free - ca.mtimes(Y, change), sizes)
