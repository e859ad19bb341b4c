"""Numbers over the horizon, checked."""

from typing import Any

import numpy as np

from dtcasadi import checks

from .problem import refusal


def weights_of(name: str, value: Any, rows: int, m: int) -> np.ndarray:
    """Non-negative numbers of shape (rows, m), as `rows_of`."""
    found = rows_of(name, value, rows, m)
    if np.any(found < 0):
        raise refusal(name, "non-negative weights", checks.shown(value))
    return found


def rows_of(name: str, value: Any, rows: int, m: int, *, finite: bool = True) -> np.ndarray:
    """Numbers of shape (rows, m) from one, from m, or from all."""
    expected = f"numbers: one, {m}, or of shape ({rows}, {m})"
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise refusal(name, expected, checks.shown(value)) from None
    if array.shape not in ((), (m,), (rows, m)):
        raise refusal(name, expected, f"shape {array.shape}")
    if np.any(np.isnan(array)) or (finite and not np.all(np.isfinite(array))):
        raise refusal(name, f"finite {expected}", checks.shown(value))
    return np.array(np.broadcast_to(array, (rows, m)))
