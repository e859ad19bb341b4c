"""Actuators: how commands u become chamber pressures, with what states.

An actuator is a frozen value; its states follow q and qd in x. `Actuator` says how to write one's
own, and they nest: `Delay(Hysteresis(Gas(...)))`.
"""

from ..checks import shown
from ..errors import ModelError
from .delay import Delay
from .direct import Direct
from .gas import Gas
from .hysteresis import Hysteresis
from .orifice import Orifice
from .protocol import Accounts, Actuator, Air, Signals, Wrapped
from .regulator import Regulator
from .valve import PressureValve, Valve

_BY_NAME = {"direct": Direct, "regulator": Regulator}


def actuator_of(value: object) -> Actuator:
    """The actuator a `build` option names, or the value itself.

    Raises:
        ModelError: neither a known name nor an actuator value.
    """
    if isinstance(value, str) and value in _BY_NAME:
        return _BY_NAME[value]()
    if isinstance(value, Actuator):
        return value
    names = ", ".join(repr(name) for name in _BY_NAME)
    raise ModelError(f"actuator: expected {names} or an actuator value, got {shown(value)}")


__all__ = [
    "Accounts",
    "Actuator",
    "Air",
    "Delay",
    "Direct",
    "Gas",
    "Hysteresis",
    "Orifice",
    "PressureValve",
    "Regulator",
    "Signals",
    "Valve",
    "Wrapped",
    "actuator_of",
]
