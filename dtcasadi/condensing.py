r"""Linear dynamics over a horizon inside graphs: condensing, response, the Riccati recursion.

.. math:: dx_{k+1} = A_k dx_k + B_k du_k + c_k,\quad k = 0 \dots N-1

Blocks of all k lie side by side: A (n_x, n_x N), B (n_x, n_u N). Each is a C kernel for generated
code, and a graph of CasADi's own operations by another formula for the virtual machine.
"""

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca

from .linear import native_function


class Condensed(NamedTuple):
    """A problem in its commands v alone, shapes (n_v, n_v), (n_v, n_r N), (n_v, n_g N), (n_x, n_v).

    H is the Hessian of half the weighted squares, J and C the derivatives of residuals and limits
    for v, transposed, S = d x_N / d v.
    """

    H: ca.MX
    J: ca.MX
    C: ca.MX
    S: ca.MX


def condensed(
    A: ca.MX,
    B: ca.MX,
    R: ca.MX,
    G: ca.MX,
    weight: ca.MX,
    P: ca.MX,
    block_of: Sequence[int],
    *,
    native: bool,
) -> Condensed:
    r"""Eliminate the states (Bock, Plitt 1984; Frison, 2016, section 6.2).

    .. math:: H = \sum_{k=1}^N (R_k S_k)^T W_k (R_k S_k) + [S_N; e]^T P [S_N; e]

    Here v holds the commands of each block, S_k = dx_k/dv, and e selects those of the last block.

    Args:
        A: shape (n_x, n_x N).
        B: shape (n_x, n_u N).
        R: derivatives of the residuals of states 1 ... N, shape (n_r, n_x N).
        G: of the limits of the same states, shape (n_g, n_x N).
        weight: W, shape (n_r, N).
        P: weight of (x_N; u_{N-1}), shape (n_x + n_u, n_x + n_u).
        block_of: block of each interval, rising from 0 by at most 1.
        native: whether the C kernel may be embedded (generated code only).
    """
    n_x, N = A.shape[0], len(block_of)
    n_u, n_r, n_g = B.shape[1] // N, R.shape[0], G.shape[0]
    n_v = n_u * (block_of[-1] + 1)
    if native:
        # CasADi passes no pointer for a port without entries; a row of zeros stands for none.
        R, weight = (R, weight) if n_r else (ca.MX.zeros(1, n_x * N), ca.MX.zeros(1, N))
        G = G if n_g else ca.MX.zeros(1, n_x * N)
        r, g = R.shape[0], G.shape[0]
        ports = {"A": A.shape, "B": B.shape, "D": R.shape, "E": G.shape, "WEIGHT": (r, N)}
        ports |= {"P": P.shape, "BLOCK": (N, 1)}
        results = {"HH": (n_v, n_v), "JT": (n_v, r * N), "CT": (n_v, g * N), "S": (n_x, n_v)}
        numbers = {"X": n_x, "U": n_u, "N": N, "V": n_v, "R": r, "G": g}
        given = (A, B, R, G, weight, P, ca.MX(ca.DM(list(block_of))))
        kernel = native_function(
            "condense", tuple(ports), tuple(results), ports | results, **numbers
        )
        H, J, C, S = kernel(*(ca.densify(part) for part in given))
        return Condensed(H, J[:, : n_r * N], C[:, : n_g * N], S)
    S, rows, limits = ca.MX.zeros(n_x, n_v), [], []
    for k, block in enumerate(block_of):
        S = ca.mtimes(A[:, n_x * k : n_x * (k + 1)], S)
        columns = slice(n_u * block, n_u * (block + 1))
        S[:, columns] += B[:, n_u * k : n_u * (k + 1)]
        rows.append(ca.mtimes(R[:, n_x * k : n_x * (k + 1)], S))
        limits.append(ca.mtimes(G[:, n_x * k : n_x * (k + 1)], S))
    J, C = ca.vertcat(*rows), ca.vertcat(*limits)
    last = ca.DM.zeros(n_u, n_v)
    last[:, n_v - n_u :] = ca.DM.eye(n_u)
    T = ca.vertcat(S, last)
    H = ca.mtimes(J.T, ca.vec(weight) * J) if n_r else ca.MX.zeros(n_v, n_v)
    H = H + ca.mtimes(T.T, ca.mtimes(P, T))
    return Condensed(*(ca.densify(part) for part in ((H + H.T) / 2, J.T, C.T, S)))


def response(A: ca.MX, B: ca.MX, c: ca.MX, x0: ca.MX, u: ca.MX, *, native: bool) -> ca.MX:
    """States of the linear dynamics, shape (n_x, N + 1).

    Args:
        A: shape (n_x, n_x N).
        B: shape (n_x, n_u N).
        c: shape (n_x, N).
        x0: shape (n_x,).
        u: shape (n_u, N).
        native: whether the C kernel may be embedded (generated code only).
    """
    n_x, N = c.shape
    n_u = u.shape[0]
    if native:
        ports = {"A": A.shape, "B": B.shape, "CK": c.shape, "D0": (n_x, 1), "DU": u.shape}
        sizes = ports | {"DX": (n_x, N + 1)}
        numbers = {"X": n_x, "U": n_u, "N": N}
        kernel = native_function("linear_response", tuple(ports), ("DX",), sizes, **numbers)
        return kernel(*(ca.densify(part) for part in (A, B, c, x0, u)))
    states = [x0]
    for k in range(N):
        forced = ca.mtimes(B[:, n_u * k : n_u * (k + 1)], u[:, k]) + c[:, k]
        states.append(ca.mtimes(A[:, n_x * k : n_x * (k + 1)], states[-1]) + forced)
    return ca.densify(ca.horzcat(*states))


class Quadratic(NamedTuple):
    """Cost of a linear-quadratic problem, blocks of all k side by side.

    Stage k costs 1/2 x^T Q x + u^T S x + 1/2 u^T R u + q^T x + r^T u; Q (n_x, n_x (N + 1)),
    S (n_u, n_x N), R (n_u, n_u N), q (n_x, N + 1), r (n_u, N).
    """

    Q: ca.MX
    S: ca.MX
    R: ca.MX
    q: ca.MX
    r: ca.MX


class Regulated(NamedTuple):
    """Solution: u_k = K_k x_k + k_k, states and commands, status (1: not convex)."""

    K: ca.MX
    k: ca.MX
    x: ca.MX
    u: ca.MX
    status: ca.MX


def riccati(A: ca.MX, B: ca.MX, c: ca.MX, cost: Quadratic, x0: ca.MX, *, native: bool) -> Regulated:
    """Minimize a quadratic cost over linear dynamics without constraints.

    C: the Riccati recursion (Rawlings, Mayne, Diehl, Model Predictive Control, 2nd ed., section
    8.8.3), Cholesky factors of R + B^T P B. Virtual machine: the same recursion with CasADi's
    solves; its gains come from the inverse-free form with P symmetric by averaging.

    Args:
        A: shape (n_x, n_x N).
        B: shape (n_x, n_u N).
        c: shape (n_x, N).
        cost: of states and commands.
        x0: shape (n_x,).
        native: whether the C kernel may be embedded (generated code only).
    """
    n_x, N = c.shape
    n_u = B.shape[1] // N
    if native:
        ports = {"A": A.shape, "B": B.shape, "CK": c.shape, "QQ": cost.Q.shape}
        ports |= {"SS": cost.S.shape, "RR": cost.R.shape, "QL": cost.q.shape}
        ports |= {"RL": cost.r.shape, "X0": (n_x, 1)}
        results = {"KK": (n_u, n_x * N), "KL": (n_u, N), "XX": (n_x, N + 1), "UU": (n_u, N)}
        results |= {"BACK": (1, 1)}
        kernel = native_function(
            "riccati", tuple(ports), tuple(results), ports | results, X=n_x, U=n_u, N=N
        )
        given = (A, B, c, *cost, x0)
        return Regulated(*kernel(*(ca.densify(part) for part in given)))
    P, p = cost.Q[:, n_x * N :], cost.q[:, N]
    gains: list[ca.MX] = []
    offsets: list[ca.MX] = []
    least: list[ca.MX] = []
    for k in reversed(range(N)):
        a, b = A[:, n_x * k : n_x * (k + 1)], B[:, n_u * k : n_u * (k + 1)]
        states, commands = slice(n_x * k, n_x * (k + 1)), slice(n_u * k, n_u * (k + 1))
        t = p + ca.mtimes(P, c[:, k])
        F = cost.R[:, commands] + ca.mtimes(b.T, ca.mtimes(P, b))
        H = cost.S[:, states] + ca.mtimes(b.T, ca.mtimes(P, a))
        h = cost.r[:, k] + ca.mtimes(b.T, t)
        found = -ca.solve(ca.densify(F), ca.densify(ca.horzcat(H, h)), "ldl")
        gains.insert(0, found[:, :n_x])
        offsets.insert(0, found[:, n_x])
        least.append(_least_pivot(F))
        P = cost.Q[:, states] + ca.mtimes(a.T, ca.mtimes(P, a)) + ca.mtimes(H.T, found[:, :n_x])
        P = (P + P.T) / 2
        p = cost.q[:, k] + ca.mtimes(a.T, t) + ca.mtimes(H.T, found[:, n_x])
    x, u = [x0], []
    for k in range(N):
        u.append(ca.mtimes(gains[k], x[-1]) + offsets[k])
        a, b = A[:, n_x * k : n_x * (k + 1)], B[:, n_u * k : n_u * (k + 1)]
        x.append(ca.mtimes(a, x[-1]) + ca.mtimes(b, u[-1]) + c[:, k])
    parts = (*(ca.horzcat(*part) for part in (gains, offsets, x, u)), ca.mmin(ca.vertcat(*least)))
    status = 1 - (parts[-1] > 0)
    return Regulated(*(ca.densify(part) for part in (*parts[:-1], status)))


def _least_pivot(F: ca.MX) -> ca.MX:
    """Smallest pivot of the LDL^T factors, positive where F is positive definite."""
    n = F.shape[0]
    symbol = ca.SX.sym("F", n, n)
    D, _, _ = ca.ldl(symbol, False)
    return ca.mmin(ca.Function("pivots", [symbol], [D])(F))
