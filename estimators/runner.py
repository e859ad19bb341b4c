"""A filter run on samples of several rates that arrive late, lost or out of order."""

from __future__ import annotations

from bisect import insort
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from dtcasadi.errors import EstimationError, LogError
from dtcasadi.logs import Log
from dtcasadi.measuring import Sensor
from dtcasadi.waist import Discrete

from .base import Estimate

# Samples a step that one run may keep waiting; more is a fault of the times.
_MOST_STEPS = 10**7
# Steps between two rows of a log that are run through; beyond, a time is wrong or a pause so long
# that it parts two logs.
_LONGEST_GAP = 10**5


class Filter(Protocol):
    """What can be run: `EKF`, or another filter of the same two functions."""

    @property
    def discrete(self) -> Discrete:
        """The model."""

    @property
    def start(self) -> Estimate:
        """The estimate at the beginning."""

    def predict(self, est: Estimate, u: Any) -> Estimate:
        """The estimate a step later."""

    def update(self, est: Estimate, y: Any, sensor: Any, u: Any) -> Estimate:
        """The estimate with a measurement taken in."""


class Sample(NamedTuple):
    """A measurement: step of its instant, order of arrival, sensor, readings."""

    step: int
    order: int
    sensor: str
    y: np.ndarray


class Runner:
    """Takes samples in as they come; knows the estimate at any step up to now.

    An instant belongs to the nearest step. Samples wait, sorted by their instants, for the largest
    latency: the filter itself stays that far behind, and `now` goes on from it to the present with
    what has arrived. An older sample is refused.

    Attributes:
        behind: the estimate of the oldest instant whose samples are still taken, before them.
        refused: (instant [s], sensor) of samples that came too late.
    """

    def __init__(self, filter: Filter, *, latency_s: float | None = None, t_start: float = 0.0):
        """Start at `filter.start`.

        Args:
            filter: the filter.
            latency_s: how late a sample may come [s]; default: the largest of the sensors.
            t_start: time of the first estimate [s].
        """
        self._filter, self._t_start = filter, t_start
        self._h = filter.discrete.step_s
        sensors = filter.discrete.sensors.values()
        latest = (
            max((s.latency_s for s in sensors), default=0.0) if latency_s is None else latency_s
        )
        self._lag = int(np.ceil(latest / self._h - 1e-9))
        self._waiting: list[Sample] = []
        self._commands: list[np.ndarray] = []  # of the steps from `behind` to the present
        self._u = np.zeros(filter.discrete.linearize.size1_in("u"))
        self._step = self._now = self._order = 0
        self.behind = filter.start
        self.refused: list[tuple[float, str]] = []

    def feed(self, t: float, sensor: str, y: Sequence[float] | np.ndarray) -> bool:
        """Take a sample in; False if it is older than the largest latency and refused.

        Raises:
            EstimationError: an instant that is not finite, or after the present.
        """
        step = self._step_of(t)
        if step > self._now:
            raise EstimationError(
                f"{sensor}: expected a sample up to the present, {self.t:.6g} s, got {t:.6g} s"
            )
        if step < self._step:
            self.refused.append((t, sensor))
            return False
        self._order += 1
        insort(
            self._waiting,
            Sample(step, self._order, sensor, np.asarray(y, dtype=float)),
            key=lambda sample: sample[:2],
        )
        return True

    @property
    def t(self) -> float:
        """The present [s]."""
        return self._t_start + self._now * self._h

    def command(self, u: Sequence[float] | np.ndarray) -> None:
        """The command from now on, held until the next."""
        self._u = np.asarray(u, dtype=float)

    def advance(self) -> None:
        """Go on by a step."""
        self._commands.append(self._u)
        self._now += 1
        while self._now - self._step > self._lag:
            u = self._commands.pop(0)
            self.behind = self._filter.predict(self._taken(self.behind, self._step, u), u)
            self._step += 1
            self._waiting = [sample for sample in self._waiting if sample.step >= self._step]

    def now(self) -> Estimate:
        """The estimate at present, with all samples that have arrived."""
        est = self.behind
        for k, u in enumerate(self._commands):
            est = self._filter.predict(self._taken(est, self._step + k, u), u)
        return self._taken(est, self._now, self._u)

    def _taken(self, est: Estimate, step: int, u: np.ndarray) -> Estimate:
        """All samples of an instant; those of different sensors are read together."""
        waiting = [sample for sample in self._waiting if sample.step == step]
        while waiting:
            now: dict[str, np.ndarray] = {}
            later = []
            for sample in waiting:
                if sample.sensor in now:
                    later.append(sample)
                else:
                    now[sample.sensor] = sample.y
            est = self._read(est, now, u)
            waiting = later
        return est

    def _read(self, est: Estimate, now: Mapping[str, np.ndarray], u: np.ndarray) -> Estimate:
        if len(now) == 1:
            ((name, y),) = now.items()
            return self._filter.update(est, y, name, u)
        # Always the same sensors, or each combination would be compiled.
        sensors = self._filter.discrete.sensors
        absent = sum(sensors[name].n_y for name in sensors if name not in now)
        y = np.concatenate([now.get(n, np.full(s.n_y, np.nan)) for n, s in sensors.items()])
        est = self._filter.update(est, y, tuple(sensors), u)
        return est.replaced(skipped=est.skipped - absent)

    def _step_of(self, t: float) -> int:
        if not np.isfinite(t) or abs(t - self._t_start) > _MOST_STEPS * self._h:
            raise EstimationError(f"t: expected a finite time near the run's, got {t!r}")
        return round((t - self._t_start) / self._h)


@dataclass(frozen=True, eq=False)
class Track:
    """What a filter made of a log, at every step.

    Attributes:
        t: times [s], shape (n,).
        estimates: the estimate at each.
        u: commands, shape (n, n_u).
        refused: (instant [s], sensor) of samples that came too late.
    """

    t: np.ndarray
    estimates: tuple[Estimate, ...]
    u: np.ndarray
    refused: tuple[tuple[float, str], ...]

    @property
    def last(self) -> Estimate:
        """The estimate at the end."""
        return self.estimates[-1]


def track(filter: Filter, log: Log, *, t_end: float | None = None) -> Track:
    """Run a filter over a log whose rows are in the order of arrival.

    A row arrives when its sensor's latency has passed, or with the row before it, if that is later.

    Raises:
        LogError: channels are missing or have another unit, or the times have too long a gap.
        EstimationError: the log spans too many steps.
    """
    discrete = filter.discrete
    n_u = discrete.linearize.size1_in("u")
    commands = log.columns((f"command{k}", None) for k in range(1, n_u + 1)) if n_u else None
    readings = _readings(discrete.sensors, log)
    h, t_start = discrete.step_s, float(np.min(log.t))
    span = (float(np.max(log.t)) if t_end is None else t_end) - t_start
    n = round(span / h)
    if n > _MOST_STEPS:
        raise EstimationError(f"{log.source}: expected at most {_MOST_STEPS} steps, got {n}")
    arrivals = np.maximum.accumulate(log.t)
    _check_gaps(log.source, np.concatenate([[t_start], arrivals]), h)
    runner = Runner(filter, t_start=t_start)
    u, row = np.zeros(n_u), 0
    estimates, used = [], []
    for k in range(n + 1):
        while row < len(log.t) and arrivals[row] <= t_start + (k + 0.5) * h:
            if commands is not None and np.all(np.isfinite(commands[row])):
                u = commands[row]
            runner.command(u)
            for name, values in readings.items():
                if np.any(np.isfinite(values[row])):
                    runner.feed(log.t[row], name, values[row])
            row += 1
        estimates.append(runner.now())
        used.append(u)
        if k < n:
            runner.advance()
    times = t_start + h * np.arange(n + 1)
    return Track(times, tuple(estimates), np.array(used), tuple(runner.refused))


def _check_gaps(source: str, times: np.ndarray, h: float) -> None:
    gaps = np.diff(times)
    k = int(np.argmax(gaps))
    if gaps[k] > _LONGEST_GAP * h:
        raise LogError(
            f"{source}: t: expected rows at most {_LONGEST_GAP} steps of {h:g} s apart, got none "
            f"from {times[k]:.6g} s to {times[k + 1]:.6g} s"
        )


def _readings(sensors: Mapping[str, Sensor], log: Log) -> dict[str, np.ndarray]:
    """Readings of each sensor that the log has."""
    found = {}
    for name, sensor in sensors.items():
        values = log.columns((f"{name}.{channel}", unit) for channel, unit in sensor.channels)
        if values is not None:
            found[name] = values
    return found
