"""Numbers of an actuator by the paths of `parameters=`."""

import casadi as ca
import numpy as np

from ..errors import ModelError
from .fields import filled, numbers_of
from .protocol import Actuator, Air


def named(actuator: Actuator, path: str) -> tuple[str, np.ndarray]:
    """The whole path of a number and its values, shape (1,) or (n,).

    Args:
        actuator: the actuator.
        path: as after `actuator.`; what is inside a `source` may leave that word out.

    Raises:
        ModelError: there is no such number, or nothing depends on it.
    """
    known = dict(numbers_of(actuator))
    whole, inner = path, actuator
    while whole not in known and hasattr(inner, "source"):
        whole, inner = f"source.{whole}", inner.source
    if whole not in known:
        names = ", ".join(f"actuator.{name}" for name in known) or "no number of this actuator"
        raise ModelError(f"parameters: expected one of {names}, got 'actuator.{path}'")
    if not _acts(actuator, whole, known):
        raise ModelError(f"parameters: actuator.{path} has no effect in this actuator")
    return whole, known[whole]


def _acts(actuator: Actuator, path: str, known: dict[str, np.ndarray]) -> bool:
    """Whether pressures or rates depend on the number."""
    n = max(len(numbers) for numbers in known.values())
    number = ca.SX.sym("number", len(known[path]))
    sizes = (len(actuator.state_names(n)), n, n, n)
    state, u, volume, rate = (ca.SX.sym("s", size) for size in sizes)
    air = Air(volume, rate, ca.DM.ones(n), ca.DM(n, 1), ca.DM(n, 1))
    working = filled(actuator, {path: number})
    result = ca.vertcat(working.pressure(state, u, air), working.rate(state, u, air))
    return bool(ca.depends_on(result, number))
