"""Whether a filter's errors are as large as its covariance says: Monte Carlo runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import chi2

from dtcasadi.discrete import DiscreteModel

from .runner import Filter


def nees_in_band(
    made: Filter,
    discrete: DiscreteModel,
    sensors: Sequence[str],
    *,
    mean: np.ndarray,
    P0: np.ndarray,
    Q: np.ndarray,
    u: np.ndarray,
    runs: int,
    steps: int,
    seed: int = 5,
) -> float:
    r"""Share of runs and times with e^T P^-1 e inside its two-sided 95 % band.

    Errors e are those of x after an update; of a consistent filter e^T P^-1 e is chi-square with
    n_x degrees of freedom (Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking
    and Navigation, section 5.4).

    Args:
        made: the filter, started at `mean`.
        discrete: the truth, which moves with noise Q and starts at `mean` with variances P0.
        sensors: names, read together at every step.
        mean: shape (n_x,).
        P0: variances, shape (n_x,).
        Q: variances of the noise of a step, shape (n_x,).
        u: constant command, shape (n_u,).
        runs: number of runs.
        steps: steps of each.
        seed: of the noise.
    """
    rng = np.random.default_rng(seed)
    step, sensor = discrete.compiled("step"), discrete.together(sensors)
    theta, n_x = discrete.theta0, len(mean)
    R = np.sqrt(np.diag(sensor.R_v))
    low, high = chi2.interval(0.95, n_x)
    inside = []
    for _ in range(runs):
        x: np.ndarray = mean + np.sqrt(P0) * rng.normal(size=n_x)
        est = made.start
        for _ in range(steps):
            y: Any = sensor.output(x, u, theta).full()[:, 0] + R * rng.normal(size=len(R))
            est = made.update(est, y, tuple(sensors), u)
            e = x - est.x
            inside.append(low <= e @ np.linalg.solve(est.P[:n_x, :n_x], e) <= high)
            x = step(x, u, theta)[0] + np.sqrt(Q) * rng.normal(size=n_x)
            est = made.predict(est, u)
    return float(np.mean(inside))
