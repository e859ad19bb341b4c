"""Sigma points: the unscented transform as a square root.

With points at distance h from the mean along the columns of a root of P, let d be half the
difference and s half the sum, less the centre, of the two images of a column. The scaled unscented
transform is then

    mean = y_0 + sum s / h^2 = y_0 + delta
    cov  = sum (d d^T + s s^T) / h^2 + (2 - alpha^2) delta delta^T

(from Simon, Optimal State Estimation, section 14.3, with beta = 2, by putting the weights in). No
term is negative, so the covariance is a sum of squares (van der Merwe and Wan, ICASSP 2001, need a
downdate there): `estimators.clouds`.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dpotrf


def root_of(P: np.ndarray) -> np.ndarray:
    """Columns L with L L^T = P, shape (n, m), one for each entry that is not known exactly.

    At least one, of zeros where all is known; more of them where P is semidefinite.
    """
    # LAPACK itself: NumPy's way to it takes longer than a factorization of this size.
    whole, failed = dpotrf(P, lower=1, clean=1)
    if not failed:
        return np.asarray(whole)
    known = np.diag(P) <= 0
    block = P[np.ix_(~known, ~known)]
    try:
        part = np.linalg.cholesky(block)
    except np.linalg.LinAlgError:  # semidefinite
        values, vectors = np.linalg.eigh(block)
        least = len(values) * np.finfo(float).eps * max(values.max(initial=0.0), 0.0)
        part = vectors * np.sqrt(np.where(values > least, values, 0.0))
    root = np.zeros((len(P), max(len(part), 1)))
    root[~known, : len(part)] = part
    return root


def spread_out(centre: np.ndarray, root: np.ndarray, distance: float | np.ndarray) -> np.ndarray:
    """The centre, then each column added, then each taken away, shape (n, 1 + 2 m)."""
    n, m = root.shape
    points = np.empty((n, 1 + 2 * m))
    ahead, middle = points[:, 1 : m + 1], centre[:, np.newaxis]
    points[:, 0] = centre
    np.multiply(root, distance, out=ahead)
    np.subtract(middle, ahead, out=points[:, m + 1 :])
    ahead += middle
    return points
