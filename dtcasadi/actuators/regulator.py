"""A pressure regulator: first-order lag with limits and a rate limit."""

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np

from .fields import Each, below, checked
from .protocol import Actuator, Air
from .smooth import cut, limited, sign, soft_cut


@dataclass(frozen=True)
class Regulator(Actuator):
    """First-order lag with limits.

        e = clip(u, minimum, maximum) - pressure
        d(pressure)/dt = limited(e / time_constant)       e / vent_time_constant where e < 0

    Fill passes into vent over |e| of about `blend`, and the rate into its limits between 0.75 and
    1.25 of them, with a continuous slope; the command is cut off where its limits are.

    Attributes:
        time_constant: lag [s], positive.
        minimum: lowest gauge pressure it commands [Pa].
        maximum: highest gauge pressure it commands [Pa]; infinite: no limit.
        rate_limit: largest rate of the pressure [Pa/s]; infinite: no limit.
        vent_time_constant: lag of a falling pressure [s]; None: the same.
        vent_rate_limit: largest rate of a falling pressure [Pa/s]; None: the same.
        blend: distance from the command over which filling passes into venting [Pa].

    Raises:
        ActuatorError: a field out of range.
    """

    time_constant: Each = 0.1
    minimum: Each = 0.0
    maximum: Each = math.inf
    rate_limit: Each = math.inf
    vent_time_constant: Each | None = None
    vent_rate_limit: Each | None = None
    blend: Each = 10.0

    def __post_init__(self) -> None:
        """Check every field."""
        lags = ("time_constant", "vent_time_constant", "blend")
        checked("regulator", self, lags, positive=True)
        checked("regulator", self, ("minimum",))
        checked("regulator", self, ("maximum",), infinite=True)
        rates = ("rate_limit", "vent_rate_limit")
        checked("regulator", self, rates, positive=True, infinite=True)
        low = self.minimum
        text = "a pressure above the minimum"
        text = f"{text} of {low:g} Pa" if isinstance(low, float) else text
        below("regulator.maximum", low, self.maximum, text)

    def state_names(self, n: int) -> tuple[str, ...]:
        """One pressure per chamber."""
        return tuple(f"pressure_{i + 1}" for i in range(n))

    def pressure(self, state: ca.SX, u: ca.SX, air: Air) -> ca.SX:
        """The lagged pressure [Pa], shape (n, 1)."""
        return state

    def rate(self, state: ca.SX, u: ca.SX, air: Air) -> ca.SX:
        """Time derivative of the pressure [Pa/s], shape (n, 1)."""
        error = cut(u, self.minimum, self.maximum) - state
        if self.vent_time_constant is None:
            rate = error / self.time_constant
        else:
            fill, vent = 1 / self.time_constant, 1 / self.vent_time_constant
            rate = error * (fill + vent + (fill - vent) * sign(error, self.blend)) / 2
        vent_limit = self.rate_limit if self.vent_rate_limit is None else self.vent_rate_limit
        low = -vent_limit if limited(vent_limit) else -math.inf
        return soft_cut(rate, low, self.rate_limit)

    def rest_state(self, pressure: np.ndarray, volume: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """The pressures within the limits, shape (n,)."""
        return np.clip(np.asarray(pressure, dtype=float), self.minimum, self.maximum)
