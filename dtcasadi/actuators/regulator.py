"""A pressure regulator: first-order lag with limits and a rate limit."""

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..checks import number
from ..errors import ModelError


@dataclass(frozen=True)
class Regulator:
    """First-order lag with limits.

        d(pressure)/dt = clip((clip(u, minimum, maximum) - pressure) / time_constant, +-rate_limit)

    Attributes:
        time_constant: lag [s], positive.
        minimum: lowest gauge pressure it commands [Pa].
        maximum: highest gauge pressure it commands [Pa]; infinite: no limit.
        rate_limit: largest rate of the pressure [Pa/s]; infinite: no limit.

    Raises:
        ModelError: a field out of range.
    """

    time_constant: float = 0.1
    minimum: float = 0.0
    maximum: float = math.inf
    rate_limit: float = math.inf

    def __post_init__(self) -> None:
        """Check every field."""
        number("regulator.time_constant", self.time_constant, positive=True, error=_error)
        number("regulator.minimum", self.minimum, error=_error)
        for name in ("maximum", "rate_limit"):
            value = getattr(self, name)
            if value != math.inf:
                number(f"regulator.{name}", value, error=_error)
        if self.maximum <= self.minimum:
            raise _error("regulator.maximum", "a number above minimum", self.maximum)
        if self.rate_limit <= 0:
            raise _error("regulator.rate_limit", "a positive number", self.rate_limit)

    def state_names(self, n: int) -> tuple[str, ...]:
        """One pressure per chamber."""
        return tuple(f"pressure_{i + 1}" for i in range(n))

    def pressure(self, state: ca.SX, u: ca.SX) -> ca.SX:
        """The lagged pressure [Pa], shape (n, 1)."""
        return state

    def rate(self, state: ca.SX, u: ca.SX) -> ca.SX:
        """Time derivative of the pressure [Pa/s], shape (n, 1)."""
        target = ca.fmax(u, self.minimum)
        if self.maximum < math.inf:
            target = ca.fmin(target, self.maximum)
        rate = (target - state) / self.time_constant
        if self.rate_limit < math.inf:
            rate = ca.fmin(ca.fmax(rate, -self.rate_limit), self.rate_limit)
        return rate

    def rest_state(self, u: np.ndarray) -> np.ndarray:
        """The command within the limits, shape (n,)."""
        return np.clip(np.asarray(u, dtype=float), self.minimum, self.maximum)


def _error(field: str, expected: str, got: object) -> ModelError:
    return ModelError(f"{field}: expected {expected}, got {got}")
