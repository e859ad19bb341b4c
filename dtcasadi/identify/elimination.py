"""The linearized problem with the states of all nodes eliminated, stage by stage, by QR.

From the last node back, the cost that is still to come is kept as a triangle C,

    1/2 || C [ds; dz; 1] ||^2 ,      ds_next = X ds + G dz + jump

so C [X G jump] and the stage's own rows, triangularized, are the C of the node before: the square
root form of the information filter run backwards (Bierman 1977, Factorization Methods for Discrete
Sequential Estimation, ch. V). What is left of an experiment are n_p + 1 columns. No normal
equations are formed and nothing is inverted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .shooting import Stages

# Singular values below this share of the largest one are round-off of the derivatives.
ROUND_OFF = 1e-10


class Reduced(NamedTuple):
    """One experiment's rows about its first state and the parameters.

    Attributes:
        triangles: C of each node.
        A_s: columns of the unknown entries of the first state, shape (m, n_free).
        A_p: of the parameters, shape (m, n_p).
        b: of the constant, shape (m,).
        free: which entries of the first state are unknown, shape (n_x,).
    """

    triangles: tuple[np.ndarray, ...]
    A_s: np.ndarray
    A_p: np.ndarray
    b: np.ndarray
    free: np.ndarray


def reduced(
    stages: Stages, weights: Sequence[np.ndarray], off: np.ndarray, sigma: np.ndarray
) -> Reduced:
    """Eliminate the later nodes.

    Args:
        stages: of one experiment.
        weights: square roots of the weights of each stage's readings.
        off: first state less x0, shape (n_x,).
        sigma: standard deviations of x0, 0: exact, infinite: unknown.
    """
    triangles: list[np.ndarray] = []
    n = stages[0].X.shape[0]
    C = np.zeros((0, 0))
    for stage, w in zip(reversed(stages), reversed(weights), strict=True):
        own = np.column_stack([stage.J_s, stage.J_p, stage.r]) * w[:, np.newaxis]
        if len(triangles):
            ahead = C[:, :n]
            moved = np.column_stack([ahead @ stage.X, ahead @ stage.G, ahead @ stage.jump])
            moved[:, n:] += C[:, n:]
            own = np.vstack([own, moved])
        C = np.asarray(np.linalg.qr(own, mode="r")) if len(own) > own.shape[1] else own
        triangles.append(C)
    known = np.flatnonzero((sigma > 0) & np.isfinite(sigma))
    if len(known):
        prior = np.zeros((len(known), C.shape[1]))
        prior[np.arange(len(known)), known] = 1 / sigma[known]
        prior[:, -1] = off[known] / sigma[known]
        C = np.vstack([C, prior])
    free = sigma > 0
    return Reduced(tuple(reversed(triangles)), C[:, :n][:, free], C[:, n:-1], C[:, -1], free)


def without_state(rows: Reduced, mu: float = 0.0) -> np.ndarray:
    """Rows [A_p b] that no change of the first state can serve, shape (k, n_p + 1).

    Args:
        rows: one experiment.
        mu: Marquardt's damping of the first state.
    """
    A_s, rest = _damped(rows, mu)
    if not A_s.shape[1]:
        return rest
    U, kept = _range_of(A_s)
    U = U[:, kept]
    return rest - U @ (U.T @ rest)


def first_change(rows: Reduced, dz: np.ndarray, mu: float = 0.0) -> np.ndarray:
    """The change of the first state that goes with a change of the parameters, shape (n_x,)."""
    A_s, rest = _damped(rows, mu)
    ds = np.zeros(len(rows.free))
    if A_s.shape[1]:
        scale = _norms(A_s)
        target = -(rest[:, :-1] @ dz + rest[:, -1])
        ds[rows.free] = np.linalg.lstsq(A_s / scale, target, rcond=ROUND_OFF)[0] / scale
    return ds


def _damped(rows: Reduced, mu: float) -> tuple[np.ndarray, np.ndarray]:
    """The rows, with those of the damping behind them."""
    rest = np.column_stack([rows.A_p, rows.b])
    if not mu:
        return rows.A_s, rest
    extra = np.sqrt(mu) * np.diag(_norms(rows.A_s))
    return np.vstack([rows.A_s, extra]), np.vstack([rest, np.zeros((len(extra), rest.shape[1]))])


def _range_of(A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Left singular vectors of the columns, each of length one, and which of them count."""
    U, s, _ = np.linalg.svd(A / _norms(A), full_matrices=False)
    return U, s > ROUND_OFF * max(s[0], 1e-300)


def _norms(A: np.ndarray) -> np.ndarray:
    """Lengths of the columns, one where there is nothing."""
    norms = np.linalg.norm(A, axis=0)
    return np.where(norms > 0, norms, 1.0)
