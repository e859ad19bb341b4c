"""Actuators: how commands u become chamber pressures, with what states.

An actuator is a frozen value with four methods; its states follow q and qd in x.
"""

from typing import Protocol

import casadi as ca
import numpy as np

from ..errors import ModelError
from .direct import Direct
from .regulator import Regulator


class Actuator(Protocol):
    """What a model needs of an actuator; n is the number of chambers."""

    def state_names(self, n: int) -> tuple[str, ...]:
        """Names of the states appended to x."""

    def pressure(self, state: ca.SX, u: ca.SX) -> ca.SX:
        """Chamber pressures [Pa], shape (n, 1)."""

    def rate(self, state: ca.SX, u: ca.SX) -> ca.SX:
        """Time derivative of the states."""

    def rest_state(self, u: np.ndarray) -> np.ndarray:
        """The states at which a constant command has settled."""


_BY_NAME = {"direct": Direct, "regulator": Regulator}


def actuator_of(value: object) -> Actuator:
    """The actuator a `build` option names, or the value itself.

    Raises:
        ModelError: neither a known name nor an actuator value.
    """
    if isinstance(value, str) and value in _BY_NAME:
        return _BY_NAME[value]()
    if isinstance(value, Direct | Regulator):
        return value
    names = ", ".join(repr(name) for name in _BY_NAME)
    raise ModelError(f"actuator: expected {names} or an actuator value, got {value!r}")


__all__ = ["Actuator", "Direct", "Regulator", "actuator_of"]
