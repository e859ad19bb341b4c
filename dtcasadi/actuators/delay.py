"""Dead time of a command: a chain of lags in graphs, exact in a simulation."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from .. import checks
from .fields import checked, refusal
from .protocol import Accounts, Air, Signals, Wrapped

MOST_LAGS = 20


@dataclass(frozen=True)
class Delay(Wrapped):
    r"""The source gets its commands later.

    With `lags` = k > 0 as a chain of k first-order lags of time / k each, whose transfer function
    (1 + s time / k)^-k tends to exp(-s time) (error s^2 time^2 / (2 k)); their states follow the
    source's. With 0 lags `simulate` shifts the command exactly, and the model's Functions see the
    command that has arrived.

    Attributes:
        source: the actuator behind the delay.
        time: dead time [s], positive.
        lags: number of lags, up to 20.

    Raises:
        ActuatorError: a field out of range.
    """

    time: float = 0.01
    lags: int = 2

    def __post_init__(self) -> None:
        """Check the fields."""
        self.check_source("delay")
        checked("delay", self, ("time",), positive=True)
        if not isinstance(self.time, float):
            raise refusal("delay.time", "one number for all chambers", self.time)
        checks.index("delay.lags", self.lags, 0, MOST_LAGS, error=refusal)

    @property
    def dead_time(self) -> float:
        """What no lags stand for."""
        return self.source.dead_time + (0.0 if self.lags else self.time)

    def own_names(self, n: int) -> tuple[str, ...]:
        """The command on its way, the newest first."""
        chain = range(1, self.lags + 1)
        return tuple(f"delayed_{k}_{i + 1}" for k in chain for i in range(n))

    def own_units(self, n: int) -> tuple[str, ...]:
        """Those of the command."""
        unit = "Pa" if self.command == "pressure" else "1"
        return (unit,) * len(self.own_names(n))

    def pressure(self, state: ca.SX, u: ca.SX, air: Air) -> ca.SX:
        """The source's at the delayed command [Pa], shape (n, 1)."""
        return self.source.pressure(*self._arrived(state, u), air)

    def rate(self, state: ca.SX, u: ca.SX, air: Air) -> ca.SX:
        """The source's, then the lags'."""
        _, *chain = self.split(state, u)
        rates = (
            (before - own) * (self.lags / self.time)
            for before, own in zip([u, *chain[:-1]], chain, strict=bool(chain))
        )
        return ca.vertcat(self.source.rate(*self._arrived(state, u), air), *rates)

    def signals(self, state: ca.SX, u: ca.SX, air: Air) -> Signals:
        """The source's."""
        return self.source.signals(*self._arrived(state, u), air)

    def accounts(self, state: ca.SX, u: ca.SX, air: Air, *, closed: bool) -> Accounts:
        """The source's."""
        return self.source.accounts(*self._arrived(state, u), air, closed=closed)

    def rest_state(self, pressure: np.ndarray, volume: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """The source's, and the command that goes with it all along the chain."""
        command = np.asarray(self.rest_command(pressure), dtype=float)
        return np.concatenate(
            [self.source.rest_state(pressure, volume, rest), *(command for _ in range(self.lags))]
        )

    def _arrived(self, state: ca.SX, u: ca.SX) -> tuple[ca.SX, ca.SX]:
        """The source's states and command."""
        inner, *chain = self.split(state, u)
        return inner, chain[-1] if chain else u
