"""Sigma points and what they say of a function of them: the unscented transform as a square root.

With points at distance h from the mean along the columns of a root of P, let d be half the
difference and s half the sum, less the centre, of the two images of a column. The scaled unscented
transform is then

    mean = y_0 + sum s / h^2 = y_0 + delta
    cov  = sum (d d^T + s s^T) / h^2 + (2 - alpha^2) delta delta^T

(from Simon, Optimal State Estimation, section 14.3, with beta = 2, by putting the weights in). No
term is negative, so a root of it comes from one QR factorization (van der Merwe and Wan, ICASSP
2001, need a downdate there).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

_BETA = 2.0  # of a Gaussian distribution


class Cloud(NamedTuple):
    """The image of sigma points: mean, shape (n,), and a transposed root, shape (m, n)."""

    mean: np.ndarray
    root: np.ndarray


def root_of(P: np.ndarray) -> np.ndarray:
    """Columns L with L L^T = P, shape (n, rank); none for entries known exactly."""
    known = np.diag(P) <= 0
    block = P[np.ix_(~known, ~known)]
    try:
        part = np.linalg.cholesky(block)
    except np.linalg.LinAlgError:  # semidefinite
        values, vectors = np.linalg.eigh(block)
        least = len(values) * np.finfo(float).eps * max(values.max(initial=0.0), 0.0)
        kept = values > least
        part = vectors[:, kept] * np.sqrt(values[kept])
    root = np.zeros((len(P), part.shape[1]))
    root[~known] = part
    return root


def spread_out(centre: np.ndarray, root: np.ndarray, distance: float) -> np.ndarray:
    """The centre, then each column added, then each taken away, shape (n, 1 + 2 m)."""
    steps = distance * root
    middle = centre[:, np.newaxis]
    return np.hstack([middle, middle + steps, middle - steps])


def gathered(images: np.ndarray, distance: float) -> Cloud:
    """Mean and root of the images of sigma points, shape (n, 1 + 2 m).

    The first m rows of the root are the differences, one for each column of the root of P.
    """
    m = images.shape[1] // 2
    centre, plus, minus = images[:, :1], images[:, 1 : m + 1], images[:, m + 1 :]
    differences, sums = (plus - minus) / 2, (plus + minus) / 2 - centre
    delta = np.sum(sums, axis=1) / distance**2
    left = max(_BETA - min(distance**2 / max(m, 1), 1.0), 0.0)
    rows = np.vstack([differences.T / distance, sums.T / distance, np.sqrt(left) * delta])
    return Cloud(centre[:, 0] + delta, rows)


def triangle(rows: np.ndarray) -> np.ndarray:
    """Upper triangular U with U^T U = rows^T rows, shape (n, n)."""
    n = rows.shape[1]
    if len(rows) < n:
        rows = np.vstack([rows, np.zeros((n - len(rows), n))])
    return np.asarray(np.linalg.qr(rows, mode="r"))
