"""Readings with faults."""

import numpy as np


def faulty(rng: np.random.Generator, n: int) -> np.ndarray:
    """Readings: mostly noise, sometimes not a number, or far off."""
    y = rng.normal(size=n)
    kind = rng.random()
    if kind < 0.05:
        y[rng.integers(n)] = rng.choice([np.nan, np.inf, -np.inf])
    elif kind < 0.1:
        y *= 1e6
    return y
