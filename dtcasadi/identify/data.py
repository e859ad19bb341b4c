"""Logs on the grid of a model's steps: what was used, left out, and noticed.

Rows are sorted by time. A reading belongs to the nearest step, a command holds until the next one
(an empty cell: the one before). Nothing is filled in: a missing reading has no weight.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from .. import checks
from ..errors import IdentificationError, LogError
from ..logs import Log
from ..measuring import Sensor

MOST_STEPS = 10**6
# A pause of so many usual spacings is a gap; a reading so far from its step, in steps, is off it.
_GAP, _OFF = 5.0, 0.1
_STUCK = 50  # equal readings in a row that a noisy sensor does not give


@dataclass(frozen=True, eq=False)
class Experiment:
    """One log, and what is known of the state at its first instant.

    Attributes:
        log: the readings and commands.
        x0: state to start the search from, shape (n_x,); default: the scene's, or zero.
        sigma: what is known of it: None: nothing; 0: it is exact; else the standard deviation of
            x0, one number or (n_x,); infinite entries are unknown.
        command: the command at each time where the log has none, t -> (n_u,).
    """

    log: Log
    x0: Any = None
    sigma: Any = None
    command: Callable[[float], np.ndarray] | None = None

    def __post_init__(self) -> None:
        """Check the log."""
        if not isinstance(self.log, Log):
            got = checks.shown(self.log)
            raise IdentificationError(f"experiment: log: expected a Log, got {got}")


class Count(NamedTuple):
    """What became of one channel's cells."""

    used: int
    empty: int
    doubled: int


@dataclass(frozen=True, eq=False)
class Data:
    """An experiment on the grid t_start + k step_s, k = 0 ... n.

    Attributes:
        source: what messages call it.
        t: times [s], shape (n + 1,).
        u: commands held over each step, shape (n + 1, n_u); the last row serves readings only.
        y: readings, shape (n + 1, n_y); NaN where there is none.
        seen: steps with a reading.
        x0: state the search starts from, shape (n_x,).
        sigma: its standard deviations, shape (n_x,); 0: exact, infinite: unknown.
        counts: of each channel.
        notes: what was noticed, a sentence each.
    """

    source: str
    t: np.ndarray
    u: np.ndarray
    y: np.ndarray
    seen: np.ndarray
    x0: np.ndarray
    sigma: np.ndarray
    counts: dict[str, Count]
    notes: tuple[str, ...]

    @property
    def n(self) -> int:
        """Number of steps."""
        return len(self.t) - 1

    def first(self, n: int) -> Data:
        """Its first n steps."""
        parts = {key: getattr(self, key)[: n + 1] for key in ("t", "u", "y", "seen")}
        return replace(self, **parts)


class Wanted(NamedTuple):
    """What a model asks of a log."""

    step_s: float
    sensor: Sensor  # all that are read, as one
    names: tuple[str, ...]  # of the channels, as logs have them
    n_u: int
    n_x: int
    command_unit: str | None  # None: any


def sensors_in(sensors: Sequence[Sensor], logs: Sequence[Log]) -> tuple[str, ...]:
    """Names of the sensors that at least one of the logs has.

    Raises:
        LogError: none.
    """
    heads = {name.partition(".")[0] for log in logs for name in log.channels}
    found = tuple(sensor.name for sensor in sensors if sensor.name in heads)
    if not found:
        known = ", ".join(f"{s.name}.{channel}" for s in sensors for channel, _ in s.channels)
        source = logs[0].source if logs else "logs"
        raise LogError(f"{source}: expected channels of {known or 'sensors: there are none'}")
    return found


def gridded(experiment: Experiment, wanted: Wanted) -> Data:
    """The experiment on the model's steps.

    Raises:
        LogError: channels missing or of another unit, no readings, or too many steps.
        IdentificationError: a start of the wrong shape.
    """
    log, notes = experiment.log, []
    order = np.argsort(log.t, kind="stable")
    if np.any(np.diff(log.t) < 0):
        late = int(np.sum(log.t < np.maximum.accumulate(log.t)))
        notes.append(f"{_many(late, 'row')} behind later ones: sorted by time")
    t = log.t[order]
    span = t[-1] - t[0]
    if not span > 0:
        raise LogError(f"{log.source}: t: expected rows at different times, got one instant")
    n = round(span / wanted.step_s)
    if not 1 <= n <= MOST_STEPS:
        raise LogError(
            f"{log.source}: expected 1 to {MOST_STEPS} steps of {wanted.step_s:g} s, got a span of "
            f"{span:g} s"
        )
    steps = np.rint((t - t[0]) / wanted.step_s).astype(int)
    notes += _spacing(t, steps, wanted.step_s)
    y, counts, more = _readings(log, order, steps, n, wanted)
    seen = np.any(np.isfinite(y), axis=1)
    if not np.any(seen):
        raise LogError(f"{log.source}: expected readings, got empty cells only")
    notes += more
    u, more = _commands(experiment, order, steps, n, wanted)
    known = {*wanted.names, *(f"command{k}" for k in range(1, wanted.n_u + 1))}
    others = sorted(set(log.channels) - known)
    if others:
        notes.append(f"not used: {', '.join(others[:8])}{' ...' if len(others) > 8 else ''}")
    times = t[0] + wanted.step_s * np.arange(n + 1)
    start = _start(experiment, wanted.n_x)
    return Data(log.source, times, u, y, seen, *start, counts, tuple(notes + more))


def _spacing(t: np.ndarray, steps: np.ndarray, step_s: float) -> list[str]:
    """Gaps, and rows off the grid."""
    notes, apart = [], np.diff(np.unique(t))
    usual = float(np.median(apart))
    gaps = apart[apart > _GAP * usual]
    if len(gaps):
        notes.append(
            f"{_many(len(gaps), 'gap')}, the longest {gaps.max():.4g} s (rows are {usual:.4g} s "
            "apart): the model runs on through them"
        )
    off = np.abs(t - t[0] - steps * step_s) / step_s
    if np.any(off > _OFF):
        notes.append(
            f"{_many(int(np.sum(off > _OFF)), 'row')} up to {1e3 * step_s * off.max():.3g} ms away "
            "from the step of the model: a smaller step brings them nearer"
        )
    return notes


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _readings(
    log: Log, order: np.ndarray, steps: np.ndarray, n: int, wanted: Wanted
) -> tuple[np.ndarray, dict[str, Count], list[str]]:
    """Readings by step, the last of several in one step; counts; notes."""
    names, notes = wanted.names, []
    y = np.full((n + 1, len(names)), np.nan)
    counts = {}
    units = dict(zip(names, (unit for _, unit in wanted.sensor.channels), strict=True))
    for sensor in dict.fromkeys(name.partition(".")[0] for name in names):
        log.columns((name, units[name]) for name in names if name.partition(".")[0] == sensor)
    for k, name in enumerate(names):
        if name not in log.channels:
            continue
        column = log.channels[name][order]
        good = np.isfinite(column)
        y[steps[good], k] = column[good]
        used = int(np.sum(np.isfinite(y[:, k])))
        doubled = int(good.sum()) - used
        counts[name] = Count(used, int((~good).sum()), doubled)
        if good.sum() >= _STUCK and np.ptp(column[good]) == 0:
            notes.append(f"{name} never changes: is the sensor alive?")
    empty = [f"{name} {count.empty}" for name, count in counts.items() if count.empty]
    if empty:
        notes.append(f"cells without a reading, which weigh nothing: {', '.join(empty)}")
    doubled = sum(count.doubled for count in counts.values())
    if doubled:
        notes.append(
            f"{_many(doubled, 'reading')} left out for a later one in the same step: a smaller "
            "step uses them"
        )
    return y, counts, notes


def _commands(
    experiment: Experiment, order: np.ndarray, steps: np.ndarray, n: int, wanted: Wanted
) -> tuple[np.ndarray, list[str]]:
    """Commands by step, shape (n + 1, n_u)."""
    log, n_u, notes = experiment.log, wanted.n_u, []
    heads = [f"command{k}" for k in range(1, n_u + 1)]
    given = log.columns((head, None) for head in heads)
    if given is None:
        if n_u and experiment.command is None:
            raise LogError(f"{log.source}: expected channels {', '.join(heads)}, got none")
        times = wanted.step_s * (np.arange(n + 1) + 0.5)
        if n_u:
            notes.append("no commands in the log: the scene's, from its t = 0")
        rows = [experiment.command(t) for t in times] if n_u and experiment.command else []
        return (np.array(rows) if rows else np.zeros((n + 1, 0))), notes
    for head in heads:
        unit = log.units[head]
        if wanted.command_unit is not None and unit not in ("", wanted.command_unit):
            expected = f"a unit of [{wanted.command_unit}]" if wanted.command_unit else "no unit"
            raise LogError(f"{log.source}: {head}: expected {expected}, got [{unit}]")
    u = np.full((n + 1, n_u), np.nan)
    for k, head in enumerate(heads):
        column = given[order, k]
        sure = np.isfinite(column)
        u[steps[sure], k] = column[sure]
        good = np.flatnonzero(np.isfinite(u[:, k]))
        if not len(good):
            raise LogError(f"{log.source}: {head}: expected numbers, got empty cells only")
        if good[0]:
            notes.append(f"{head} starts {good[0] * wanted.step_s:.4g} s late: its first one holds")
        last = np.maximum.accumulate(np.where(np.isfinite(u[:, k]), np.arange(n + 1), good[0]))
        u[:, k] = u[np.maximum(last, good[0]), k]
    return u, notes


def _start(experiment: Experiment, n_x: int) -> tuple[np.ndarray, np.ndarray]:
    """The state at the start and what is known of it."""

    def refuse(name: str, expected: str, got: object) -> IdentificationError:
        return IdentificationError(f"experiment: {name}: expected {expected}, got {got}")

    x0 = np.zeros(n_x) if experiment.x0 is None else experiment.x0
    x0 = checks.array("x0", x0, (n_x,), error=refuse)
    sigma = np.full(n_x, np.inf)
    if experiment.sigma is not None:
        try:
            sigma = np.array(np.broadcast_to(np.asarray(experiment.sigma, dtype=float), (n_x,)))
        except (TypeError, ValueError):
            got = checks.shown(experiment.sigma)
            raise refuse("sigma", f"a number or {n_x} of them", got) from None
        if np.any(np.isnan(sigma)) or np.any(sigma < 0):
            raise refuse("sigma", "non-negative numbers", checks.shown(experiment.sigma))
    return x0, sigma
