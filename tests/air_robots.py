"""Small robots with an air supply, in the paper's unitless numbers."""

from dataclasses import replace

import numpy as np

import dtcasadi as dtc
from dtcasadi.actuation import settled
from dtcasadi.actuators import Delay, Gas, Hysteresis, Orifice, PressureValve, Regulator
from dtcasadi.bench.dynamics import seed_robot

# The paper's unitless robot in an atmosphere ten times its pressure.
ATMOSPHERE, PRESSURE = 120.0, 12.0
SUPPLY, EXHAUST = Orifice(1e-3, 0.3), Orifice(2e-3, 0.4)


def gas(**changes: object) -> Gas:
    fields: dict = {"supply": SUPPLY, "exhaust": EXHAUST, "supply_pressure": 60.0}
    return Gas(**fields | {"atmosphere": ATMOSPHERE} | changes)


SERVO = gas(
    valve=PressureValve(4.0, response_time=0.01), exponent=1.2, leak=Orifice(1e-6), dead_volume=0.1
)
ACTUATORS = {
    "gas": gas(),
    "worn": Hysteresis(Regulator(0.1), 2.0),
    "all": Delay(Hysteresis(SERVO, 2.0, break_in=4.0), 0.02),
}


def robot(n: int = 3, *, undamped: bool = False) -> dtc.Robot:
    """Two chambers, overlapping from four discs on; without damping it is conservative."""
    seed = seed_robot(n)
    chambers = (dtc.Chamber((1, n - 1)), dtc.Chamber((2, n))) if n > 2 else seed.chambers
    damping = dtc.Damping() if undamped else seed.damping
    return replace(seed, chambers=chambers, damping=damping)


def start(model: dtc.Model, q: np.ndarray, pressure: float) -> np.ndarray:
    states = settled(model, q, np.full(model.n_u, pressure))
    return np.concatenate([q, np.zeros(model.n_q), states])
