"""The command is the chamber pressure."""

from dataclasses import dataclass

import casadi as ca

from .protocol import Actuator, Air


@dataclass(frozen=True)
class Direct(Actuator):
    """pressure = u; no states."""

    def pressure(self, state: ca.SX, u: ca.SX, air: Air) -> ca.SX:
        """The command itself [Pa], shape (n, 1)."""
        return u
