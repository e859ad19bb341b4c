"""Actuators by themselves: on chambers of given volume, in numbers."""

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from dtcasadi.actuators import Actuator, Air, Gas, Orifice, PressureValve, Valve
from dtcasadi.actuators.fields import filled

ATMOSPHERE, LITRE = 101325.0, 1e-3
# 0.5 l/(s bar): a small solenoid valve.
SMALL = 5e-9


def gas(**changes: object) -> Gas:
    """A one-litre chamber's usual supply: 3 bar, small valves commanded by their opening."""
    fields: dict = {
        "supply": Orifice(SMALL, 0.3),
        "exhaust": Orifice(SMALL, 0.4),
        "supply_pressure": 3e5,
        "valve": Valve(),
        "atmosphere": ATMOSPHERE,
    }
    return Gas(**fields | changes)


def servo(**changes: object) -> Gas:
    """The same, commanded by pressure."""
    return gas(valve=PressureValve(band=2e3), **changes)


def air(volume: object, rate: object, rest: float, n: int = 1) -> Air:
    """Chambers that do not grow under pressure."""
    return Air(volume, rate, ca.DM.ones(n) * rest, ca.DM(n, 1), ca.DM(n, 1))


class Tank:
    """An actuator's Functions of (state, u, volume, volume_rate), built once."""

    ports = ("state", "u", "volume", "volume_rate")

    def __init__(self, actuator: Actuator, rest: float = LITRE, n: int = 1):
        sizes = (len(actuator.state_names(n)), n, n, n)
        self.symbols = [ca.SX.sym(name, size) for name, size in zip(self.ports, sizes, strict=True)]
        state, u, volume, rate = self.symbols
        working, seen = filled(actuator, {}), air(volume, rate, rest, n)
        self.actuator, self.rest, self.n = actuator, rest, n
        self.pressure = self._function(working.pressure(state, u, seen))
        self.rate = self._function(working.rate(state, u, seen))
        self.signals = self._function(*working.signals(state, u, seen))
        self.accounts = self._function(*working.accounts(state, u, seen, closed=False))
        self.closed = self._function(*working.accounts(state, u, seen, closed=True))

    def _function(self, *values: ca.SX) -> ca.Function:
        return ca.Function("f", self.symbols, [ca.densify(value) for value in values])

    def slopes(self, at: list[np.ndarray]) -> np.ndarray:
        """Jacobian of pressure and rate for all ports."""
        both = ca.vertcat(self.pressure(*self.symbols), self.rate(*self.symbols))
        ports = ca.vertcat(*self.symbols)
        return ca.Function("J", self.symbols, [ca.jacobian(both, ports)])(*at).full()

    def differences(self, at: list[np.ndarray], steps: list[float]) -> np.ndarray:
        """The same by central differences."""
        columns = []
        for k, (value, h) in enumerate(zip(at, steps, strict=True)):
            for j in range(len(value)):
                sides = []
                for side in (h, -h):
                    moved = [np.array(v, dtype=float) for v in at]
                    moved[k][j] += side
                    sides.append(
                        np.concatenate(
                            [f(*moved).full().ravel() for f in (self.pressure, self.rate)]
                        )
                    )
                columns.append((sides[0] - sides[1]) / (2 * h))
        return np.array(columns).T

    def run(self, gauge: float, u: float, times: np.ndarray) -> np.ndarray:
        """Gauge pressures at the times in a rigid tank, from a gauge pressure, u held."""
        volume = [self.rest]
        start = self.actuator.rest_state(np.array([gauge]), *np.array([volume, volume]))
        found = solve_ivp(
            lambda t, z: self.rate(z, u, volume, 0.0).full().ravel(),
            (0.0, float(times[-1])),
            start,
            method="LSODA",
            t_eval=times,
            rtol=1e-10,
            atol=1e-12,
        )
        return np.array([float(self.signals(z, u, volume, 0.0)[0]) for z in found.y.T])
