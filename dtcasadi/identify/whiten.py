"""Residuals in standard deviations: L^-1 e with R_v = L L^T, readings that are missing left out."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular


def whitened(e: np.ndarray, J: np.ndarray, R_v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals and their derivatives in standard deviations.

    Args:
        e: residuals, NaN where there is none, shape (n, n_y).
        J: derivatives, shape (n, n_y, m).
        R_v: covariance of a full reading, shape (n_y, n_y).

    Returns:
        L^-1 e and L^-1 J of the readings that there are, shapes (k,) and (k, m).
    """
    good = np.isfinite(e)
    sigma = np.sqrt(np.diag(R_v))
    if np.array_equal(R_v, np.diag(np.diag(R_v))):
        scale = np.broadcast_to(sigma, e.shape)[good]
        return e[good] / scale, J[good] / scale[:, np.newaxis]
    parts = []
    for i in np.flatnonzero(good.any(axis=1)):
        have = good[i]
        L = np.linalg.cholesky(R_v[np.ix_(have, have)])
        rows = np.column_stack([e[i, have], J[i, have]])
        parts.append(solve_triangular(L, rows, lower=True))
    rows = np.vstack(parts) if parts else np.zeros((0, 1 + J.shape[2]))
    return rows[:, 0], rows[:, 1:]


def standardized(e: np.ndarray, R_v: np.ndarray) -> np.ndarray:
    """Residuals by channel over their own standard deviations, shape (n, n_y), NaN kept."""
    return e / np.sqrt(np.diag(R_v))
