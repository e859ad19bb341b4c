r"""What the data say about the parameters: covariance, intervals, and what they leave open.

With the first states eliminated the residuals are A dz + b, so cov z = (A^T A)^-1 where the noise
is as stated (Seber and Wild, Nonlinear Regression, section 2.1); it is computed from the singular
values of A. With Huber's loss it is larger by mean(psi^2) / mean(psi')^2 (Huber, Robust Statistics,
section 7.6). Intervals are symmetric on the parameter's scale: of a positive parameter they are
value times or over a factor.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from .elimination import ROUND_OFF
from .parameters import Parameter

# A combination whose standard deviation exceeds this is not determined: a factor of e, or 100 %.
OPEN = 1.0
_PART = 0.1  # entries of a direction below this share of the largest do not count
_SAME = 0.05


class Spread(NamedTuple):
    """Uncertainty of the parameters.

    Attributes:
        covariance: of the values, shape (n_p, n_p); infinite variance where nothing is known.
        correlation: on the parameters' scales, shape (n_p, n_p).
        sigma_z: standard deviations on the scales, shape (n_p,).
        intervals: lower and upper ends, shape (n_p, 2).
        directions: undetermined combinations on the scales, a row each.
    """

    covariance: np.ndarray
    correlation: np.ndarray
    sigma_z: np.ndarray
    intervals: np.ndarray
    directions: np.ndarray


def spread_of(
    parameters: Sequence[Parameter],
    z: np.ndarray,
    rows: np.ndarray,
    factor: float,
    level: float,
    fixed: np.ndarray | None = None,
) -> Spread:
    """Covariance and intervals.

    Args:
        parameters: what was identified.
        z: where, shape (n_p,).
        rows: A, derivatives of the residuals in standard deviations, shape (m, n_p).
        factor: on the covariance.
        level: probability that an interval holds the truth.
        fixed: parameters taken as known, shape (n_p,).
    """
    n = len(parameters)
    loose = np.ones(n, dtype=bool) if fixed is None else ~fixed
    A = np.vstack([rows, np.zeros((n, n))])[:, loose]
    _, s, Vt = np.linalg.svd(A, full_matrices=False)
    V = np.zeros((len(s), n))
    V[:, loose] = Vt
    told = s > ROUND_OFF * max(s.max(initial=0.0), 1e-300)
    scaled = V[told] / s[told][:, np.newaxis]
    covariance = factor * scaled.T @ scaled
    lost = np.any(np.abs(V[~told]) > _SAME, axis=0)
    sigma = np.sqrt(np.where(lost, np.inf, np.diag(covariance)))
    slopes = np.array([p.slope(v) for p, v in zip(parameters, z, strict=True)])
    wide = ndtri(0.5 + 0.5 * level) * sigma
    ends = np.empty((n, 2))
    for k, parameter in enumerate(parameters):
        ends[k] = [_value(parameter, z[k] + side * wide[k]) for side in (-1, 1)]
    finite = np.where((sigma > 0) & ~lost, sigma, 1.0)
    weak = told & (np.sqrt(factor) > OPEN * s)
    return Spread(
        _marked(covariance * np.outer(slopes, slopes), lost, np.inf),
        _marked(covariance / np.outer(finite, finite), lost, 1.0),
        sigma,
        ends,
        np.vstack([V[~told], V[weak]]),
    )


def _marked(matrix: np.ndarray, lost: np.ndarray, diagonal: float) -> np.ndarray:
    """The matrix with what nothing is known of marked: NaN, and a number on the diagonal."""
    matrix = matrix.copy()
    matrix[lost, :] = matrix[:, lost] = np.nan
    matrix[lost, lost] = diagonal
    return matrix


def _value(parameter: Parameter, z: float) -> float:
    """The value at a z that may be infinite, within the bounds of its meaning."""
    if np.isinf(z) or abs(z) > 300:
        return parameter.upper if z > 0 else parameter.lower
    return float(np.clip(parameter.value(z), parameter.lower, parameter.upper))


def sentences(parameters: Sequence[Parameter], directions: np.ndarray) -> tuple[str, ...]:
    """Undetermined combinations in words."""
    return tuple(_sentence(parameters, row) for row in _simplest(directions))


def _simplest(directions: np.ndarray) -> np.ndarray:
    """A basis of the same span with as many zeros as pivoting gives."""
    rows = np.array(directions, dtype=float)
    for k in range(len(rows)):
        rest = np.abs(rows[k:])
        i, j = divmod(int(np.argmax(rest)), rest.shape[1])
        rows[[k, k + i]] = rows[[k + i, k]]
        rows[k] /= rows[k, j]
        for other in range(len(rows)):
            if other != k:
                rows[other] -= rows[other, j] * rows[k]
    return rows


def _sentence(parameters: Sequence[Parameter], row: np.ndarray) -> str:
    row = row / np.max(np.abs(row))
    chosen = [(p, v) for p, v in zip(parameters, row, strict=True) if abs(v) > _PART]
    if len(chosen) == 1:
        return f"{chosen[0][0].name}: the data say nothing about it"
    names = [p.name for p, _ in chosen]
    listed = f"{', '.join(names[:-1])} and {names[-1]}"
    logs = all(p.log for p, _ in chosen)
    if logs and np.ptp([v for _, v in chosen]) < _SAME:
        only = "their ratio shows" if len(chosen) == 2 else "their ratios show"
        return f"{listed}: only {only}; all may grow by the same factor"
    if logs and len(chosen) == 2 and abs(chosen[0][1] + chosen[1][1]) < _SAME:
        # Of two equal numbers of one kind sum and product are the same to first order.
        alike = chosen[0][0].unit == chosen[1][0].unit
        return f"{listed}: only their {'sum or product' if alike else 'product'} shows"
    kind = "as powers of one factor" if logs else "in units of their starting values"
    if not logs and any(p.value0 == 0 for p, _ in chosen):
        kind = "each on its own scale"
    parts = ", ".join(f"{v:+.2g} {p.name}" for p, v in chosen)
    return f"{listed}: may change together without a trace, {kind}: {parts}"


def huber_factor(r: np.ndarray, threshold: float) -> float:
    """mean(psi^2) / mean(psi')^2 of residuals in standard deviations."""
    inside = np.abs(r) <= threshold
    psi = np.clip(r, -threshold, threshold)
    share = float(np.mean(inside))
    return float(np.mean(psi**2)) / share**2 if share else np.inf
