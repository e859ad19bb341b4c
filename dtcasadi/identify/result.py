"""What identification returns."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..files import written
from .gauss_newton import Status
from .problem import Problem
from .whiteness import ResidualTests


class ChannelError(NamedTuple):
    """How well one channel that was left out is predicted.

    Attributes:
        name: of the channel.
        unit: its unit.
        n: readings.
        rms: root mean square error, in the unit.
        size: rms over the stated standard deviation.
        fit: 100 (1 - rms / standard deviation of the readings) [%].
    """

    name: str
    unit: str
    n: int
    rms: float
    size: float
    fit: float


class Validation(NamedTuple):
    """Prediction of data that were left out.

    Attributes:
        source: which data.
        how: where the state at their start comes from.
        size: root mean square error over all readings, in standard deviations of the noise.
        channels: by channel.
    """

    source: str
    how: str
    size: float
    channels: tuple[ChannelError, ...]


class Fit(NamedTuple):
    """One experiment: times, readings and what the model reads, NaN where there is none."""

    source: str
    t: np.ndarray
    y: np.ndarray
    h: np.ndarray


@dataclass(frozen=True, eq=False)
class Identified:
    """Parameters with their uncertainty.

    Attributes:
        names: of the parameters.
        values: shape (n_p,).
        starts: values at the start, shape (n_p,).
        units: of the values; `x start`: a factor on numbers that keep their ratios.
        covariance: of the values, shape (n_p, n_p); infinite variance where the data are silent.
        intervals: ends, shape (n_p, 2).
        level: probability that an interval holds the truth, if model and noise are right.
        correlation: on the parameters' scales, shape (n_p, n_p).
        unidentifiable: what the data cannot tell apart, a sentence for each combination.
        at_bound: names of parameters that ended on a bound; intervals take them as known.
        tests: of the residuals.
        validation: of data left out, one for each.
        status: `converged`, `stalled`, `limit` or `failed`.
        message: a sentence.
        iterations: steps of Gauss-Newton.
        cost: half the sum of squares (or Huber's) at the end.
        theta: all parameters, as the model takes them, shape (n_theta,).
        x0: first state of each experiment.
        fits: readings and model of each experiment.
        notes: what was noticed in the logs and on the way, a sentence each.
        problem: what was solved.
        step_error: error of the model's steps over the noise, of the worst channel; NaN: unknown.
        build_s: time to build and compile [s].
        solve_s: time to solve [s].
    """

    names: tuple[str, ...]
    values: np.ndarray
    starts: np.ndarray
    units: tuple[str, ...]
    covariance: np.ndarray
    intervals: np.ndarray
    level: float
    correlation: np.ndarray
    unidentifiable: tuple[str, ...]
    at_bound: tuple[str, ...]
    tests: ResidualTests
    validation: tuple[Validation, ...]
    status: str
    message: str
    iterations: int
    cost: float
    theta: np.ndarray
    x0: tuple[np.ndarray, ...]
    fits: tuple[Fit, ...]
    notes: tuple[str, ...]
    problem: Problem
    build_s: float
    solve_s: float
    step_error: float = np.nan

    @property
    def success(self) -> bool:
        """Whether the search converged; the tests say whether to believe the model."""
        return self.status == Status.CONVERGED

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviations of the values, shape (n_p,)."""
        return np.sqrt(np.diag(self.covariance))

    def __getitem__(self, name: str) -> float:
        """The value of a parameter."""
        return float(self.values[self.names.index(name)])

    def report(self) -> str:
        """The result as lines of text."""
        from .report import text

        return text(self)

    def record(self) -> dict[str, Any]:
        """The result as plain values for JSON."""
        from .report import record

        return record(self)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the numbers as .npz, whole or not at all.

        Raises:
            OSError: the file cannot be written.
        """
        target = Path(path)
        arrays: dict[str, Any] = {
            name: getattr(self, name)
            for name in ("values", "starts", "covariance", "intervals", "correlation", "theta")
        }
        arrays |= {"names": np.array(self.names), "units": np.array(self.units)}
        arrays |= {"status": np.array(self.status), "unidentifiable": np.array(self.unidentifiable)}
        for k, (x0, fit) in enumerate(zip(self.x0, self.fits, strict=True)):
            arrays |= {f"x0_{k}": x0, f"t_{k}": fit.t, f"y_{k}": fit.y, f"h_{k}": fit.h}
        with written(target) as file:
            np.savez(file, **arrays)
        return target
