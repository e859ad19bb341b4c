"""The command is the chamber pressure."""

from dataclasses import dataclass

import casadi as ca
import numpy as np


@dataclass(frozen=True)
class Direct:
    """pressure = u; no states."""

    def state_names(self, n: int) -> tuple[str, ...]:
        """No states."""
        return ()

    def pressure(self, state: ca.SX, u: ca.SX) -> ca.SX:
        """The command itself [Pa], shape (n, 1)."""
        return u

    def rate(self, state: ca.SX, u: ca.SX) -> ca.SX:
        """Nothing to integrate, shape (0, 1)."""
        return type(u)(0, 1)

    def rest_state(self, u: np.ndarray) -> np.ndarray:
        """No states, shape (0,)."""
        return np.zeros(0)
