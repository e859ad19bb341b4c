"""Sets of sensors judged by what they leave unseen, and the smallest that sees all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from dtcasadi.errors import EstimationError

from .observability import Gramians

# Sets double with every sensor.
MOST_SENSORS = 12
# A sensor that adds less than this to what the others say adds nothing [bit].
NOTHING = 0.01
_NAMED = 0.1  # share of a direction from which on a number is named in it


@dataclass(frozen=True, eq=False)
class Seen:
    """What a set of sensors sees of a motion, in the window where it sees least.

    Attributes:
        sensors: their names.
        least: smallest eigenvalue of the Gramian: 1 / least is the variance its readings alone
            leave in the direction they see worst, over the one before.
        condition: largest over smallest eigenvalue; infinite where something is not seen at all.
        left: of each number, the deviation that is left with these readings over the one before,
            shape (n_z,); NaN for biases of sensors that are not in the set.
        directions: numbers that make up each direction that is not seen within the bound.
        bits: information in the readings of the whole window.
    """

    sensors: tuple[str, ...]
    least: float
    condition: float
    left: np.ndarray
    directions: tuple[tuple[str, ...], ...]
    bits: float

    def sees_all(self, bound: float) -> bool:
        """Whether the readings alone leave at most `bound` times the deviations before."""
        return self.least * bound**2 >= 1


def judged(found: Gramians, sensors: Sequence[str], bound: float = 1.0) -> Seen:
    """What a set of sensors sees.

    Args:
        found: the information of each.
        sensors: the set.
        bound: deviation that readings alone may leave in any direction, over the one before.
    """
    mine = np.array([owner in ("", *sensors) for owner in found.owner])
    names = [name for name, taken in zip(found.names, mine, strict=True) if taken]
    windows = np.sum([found.parts[name] for name in sensors], axis=0)[:, mine][:, :, mine]
    values, vectors = np.linalg.eigh(windows)
    worst = int(np.argmin(values[:, 0]))
    low, high = values[worst, 0], values[worst, -1]
    # Round-off of the sums: what lies below is zero.
    floor = len(names) * np.finfo(float).eps * high
    low = low if low > floor else 0.0
    remaining = np.linalg.inv(np.eye(len(names)) + windows[worst])
    left = np.full(len(mine), np.nan)
    left[mine] = np.sqrt(np.diag(remaining))
    unseen = [v for e, v in zip(values[worst], vectors[worst].T, strict=True) if e * bound**2 < 1]
    return Seen(
        tuple(sensors),
        float(low),
        float(high / low) if low else float("inf"),
        left,
        tuple(_named(v, names) for v in unseen),
        float(np.min(np.sum(np.log2(1 + np.maximum(values, 0)), axis=1)) / 2),
    )


def every_set(found: Gramians, bound: float = 1.0) -> list[Seen]:
    """Every set of the sensors, small ones first.

    Raises:
        EstimationError: too many sensors.
    """
    names = list(found.parts)
    if len(names) > MOST_SENSORS:
        raise EstimationError(
            f"observability: expected at most {MOST_SENSORS} sensors, got {len(names)}"
        )
    sizes = range(1, len(names) + 1)
    return [judged(found, some, bound) for size in sizes for some in combinations(names, size)]


def smallest(sets: Sequence[Seen], bound: float = 1.0) -> Seen | None:
    """The smallest set that sees all within the bound, of several the one that sees most."""
    good = [each for each in sets if each.sees_all(bound)]
    return min(good, key=lambda each: (len(each.sensors), -each.least), default=None)


def adding_nothing(sets: Sequence[Seen]) -> tuple[str, ...]:
    """Sensors without which all the others say the same."""
    whole = max(sets, key=lambda each: len(each.sensors))
    others = {frozenset(each.sensors): each.bits for each in sets}
    return tuple(
        name
        for name in whole.sensors
        if whole.bits - others.get(frozenset(whole.sensors) - {name}, 0.0) < NOTHING
    )


def _named(direction: np.ndarray, names: Sequence[str]) -> tuple[str, ...]:
    """The numbers that a direction is made of, the largest first."""
    shares = direction**2
    order = np.argsort(-shares)
    return tuple(names[k] for k in order if shares[k] >= _NAMED) or (names[order[0]],)
