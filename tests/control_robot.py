"""The stiffer four-disc robot behind a pressure regulator, and problems on its tip."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

import dtcasadi as dtc
from dtcasadi.discrete import DiscreteModel
from dtcasadi.presets import seed_four_disc
from dtcasadi.sensors import Marker
from ocp import Band, Effort, Limits, Problem, Tracking


@cache
def robot(chart: str = "planar", method: str = "midpoint") -> DiscreteModel:
    """Springs of 50, damping of 20 on each rate, a lag of 0.1 s; steps of 50 ms."""
    given = seed_four_disc()
    springs = tuple(replace(spring, stiffness=50.0) for spring in given.springs)
    given = replace(given, springs=springs, damping=dtc.Damping(20, 20, 20))
    model = dtc.build(given, chart=chart, actuator=dtc.Regulator(time_constant=0.1))
    return model.discrete(0.05, method=method, sensors=(Marker(name="tip", disc=4, noise=0.01),))


def tip(reference: Any = 2.6, horizon: int = 10, **changes: Any) -> Problem:
    """How far the tip hangs down; pressures from 0 to 14, at most 40 a second."""
    fields: dict[str, Any] = {
        "effort": Effort(change=1e-4),
        "limits": Limits(0.0, 14.0, rate=40.0),
        "soft": Band("tip", upper=2.8, channels="y", linear=5.0),
    }
    return Problem(horizon, Tracking("tip", reference, channels="y"), **fields | changes)


def rest(pressure: float) -> np.ndarray:
    """The planar robot at rest, shape (13,)."""
    model = robot().model
    return np.concatenate([dtc.equilibrium(model, pressure).q, np.zeros(6), [pressure]])
