"""Whether residuals are what noise would leave: their size, and whether they are white.

Size: the sum of squares in standard deviations is chi-square with one degree of freedom for each
reading less one for each number fitted. White: the Ljung-Box statistic of the autocorrelations of
successive readings of a channel (Ljung and Box 1978, Biometrika 65) is chi-square too. A test fails
at a chance of 1 % shared among all of them (Bonferroni).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import chdtr, chdtrc

CHANCE = 0.01
LAGS = 20
_FEWEST = 4  # readings for each lag


class ChannelTest(NamedTuple):
    """One channel's residuals over all experiments.

    Attributes:
        name: of the channel.
        unit: its unit.
        n: readings.
        rms: root mean square of the residuals, in the unit.
        size: rms over the stated standard deviation.
        p_white: chance of autocorrelations as large in white noise; NaN with too few readings.
    """

    name: str
    unit: str
    n: int
    rms: float
    size: float
    p_white: float


@dataclass(frozen=True, eq=False)
class ResidualTests:
    """Tests of the residuals.

    Attributes:
        chi_square: sum of squares in standard deviations.
        freedom: its degrees of freedom.
        p_large: chance of a larger sum.
        p_small: chance of a smaller one.
        channels: by channel.
        passed: whether all is as noise would leave it.
        findings: what is not, a sentence each.
    """

    chi_square: float
    freedom: int
    p_large: float
    p_small: float
    channels: tuple[ChannelTest, ...]
    passed: bool
    findings: tuple[str, ...]


def residual_tests(
    residuals: Sequence[np.ndarray],
    names: Sequence[str],
    units: Sequence[str],
    sigma: np.ndarray,
    r: np.ndarray,
    fitted: int,
) -> ResidualTests:
    """The tests.

    Args:
        residuals: of each experiment by step and channel, NaN where there is none, (n, n_y).
        names: of the channels.
        units: of the channels.
        sigma: stated standard deviations, shape (n_y,).
        r: all residuals in standard deviations, decorrelated, shape (m,).
        fitted: how many numbers were fitted to them.
    """
    if not len(r):
        return ResidualTests(0.0, 0, 1.0, 1.0, (), False, ("there are no residuals to test",))
    channels = [
        _channel(k, names[k], units[k], sigma, residuals)
        for k in range(len(names))
        if any(np.any(np.isfinite(each[:, k])) for each in residuals)
    ]
    total, freedom = float(r @ r), max(len(r) - fitted, 1)
    p_large, p_small = float(chdtrc(freedom, total)), float(chdtr(freedom, total))
    limit = CHANCE / (2 + len(channels))
    findings = []
    size = np.sqrt(total / freedom)
    if p_large < limit:
        worst = max(channels, key=lambda each: each.size)
        findings.append(
            f"residuals are {size:.3g} times as large as the stated noise (chance {p_large:.1g}), "
            f"most of all {worst.name}: the model misses something, or the noise is larger"
        )
    if p_small < limit:
        findings.append(
            f"residuals are only {size:.3g} times the stated noise (chance {p_small:.1g}): the "
            "intervals are too wide"
        )
    coloured = [each.name for each in channels if each.p_white < limit]
    if coloured:
        findings.append(
            f"residuals of {', '.join(coloured)} are not white: the model misses something"
        )
    return ResidualTests(
        total, freedom, p_large, p_small, tuple(channels), not findings, tuple(findings)
    )


def autocorrelation(e: np.ndarray, lags: int = LAGS) -> np.ndarray:
    """Autocorrelations at 1 ... lags of a row of residuals without gaps, shape (lags,)."""
    e = e - e.mean()
    power = float(e @ e)
    if not power:
        return np.zeros(lags)
    return np.array([float(e[k:] @ e[:-k]) / power for k in range(1, lags + 1)])


def _channel(
    k: int, name: str, unit: str, sigma: np.ndarray, residuals: Sequence[np.ndarray]
) -> ChannelTest:
    rows = [each[np.isfinite(each[:, k]), k] for each in residuals]
    every = np.concatenate(rows)
    rms = float(np.sqrt(np.mean(every**2)))
    statistic, lags_all = 0.0, 0
    for row in rows:
        lags = min(LAGS, len(row) // _FEWEST)
        if lags and np.ptp(row):
            r = autocorrelation(row, lags)
            n = len(row)
            statistic += n * (n + 2) * float(np.sum(r**2 / (n - np.arange(1, lags + 1))))
            lags_all += lags
    p_white = float(chdtrc(lags_all, statistic)) if lags_all else np.nan
    return ChannelTest(name, unit, len(every), rms, rms / float(sigma[k]), p_white)
