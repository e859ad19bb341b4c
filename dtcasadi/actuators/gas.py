"""Air in the chambers as an ideal gas, fed and vented through orifices."""

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from .fields import Each, below, checked, refusal
from .orifice import SPECIFIC, Orifice
from .protocol import Accounts, Actuator, Air, Signals
from .smooth import Number, positive, sign
from .valve import PressureValve, Valve

# Share of the rest volume over which a folding chamber's volume stops at zero: at full volume it
# is wrong by (FOLD / 2)^2 = 2.5e-5 of itself.
FOLD = 0.01
# The energy divides by n - 1; this much above 1 it is right to 1e-6.
_NEARLY_ONE = 1 + 1e-6
_NEWTON_STEPS = 6


@dataclass(frozen=True)
class Gas(Actuator):
    r"""Ideal gas behind a supply and an exhaust orifice, one amount of air per chamber.

    The state `air` = m R T0 [J] is the air's mass as pressure times volume at T0 = 293.15 K. With
    V_air = dead_volume + (V + sqrt(V^2 + w^2)) / 2, w = FOLD times the rest volume, which stays
    positive where a folded chamber's V turns negative, and n the exponent,

    .. math::
        p_{abs} = p_{atm} \left(\frac{air}{p_{atm} V_{air}}\right)^n, \quad
        \frac{d\,air}{dt} = s\,Q(p_{supply}, p) - e\,Q(p, p_{exhaust}) - Q_{leak}(p, p_{atm})

    with Q of `Orifice` and the openings s, e of the valve. n = 1 is isothermal; n = 1.4 holds for
    changes too fast for the walls to warm the air. For n > 1 temperature follows density, T / T0 =
    (p_abs / p_atm)^((n-1)/n), in filling too: it is that of air compressed in the chamber, not
    mixed from a warm supply.

    A valve with a response time adds the state `opening`. The pressure that pushes is
    (p_abs - p_atm) dV_air/dV, so that the air's work is what it gives up and a sealed chamber is a
    spring with the energy in `accounts`.

    Attributes:
        supply: orifice from the supply.
        exhaust: orifice to the exhaust.
        supply_pressure: gauge [Pa].
        valve: `Valve` (the command is its opening) or `PressureValve` (a gauge pressure).
        leak: orifice to the atmosphere that is always open; None: tight.
        exhaust_pressure: gauge; negative: a vacuum pump [Pa].
        exponent: n of the polytropic change of state, 1 to 1.4 for air.
        atmosphere: absolute pressure around the robot [Pa].
        dead_volume: of hoses and fittings, one chamber's [m^3].

    Raises:
        ActuatorError: a field out of range.
    """

    supply: Orifice
    exhaust: Orifice
    supply_pressure: Each
    valve: Valve | PressureValve = field(default_factory=Valve)
    leak: Orifice | None = None
    exhaust_pressure: Each = 0.0
    exponent: Each = 1.0
    atmosphere: float = 101325.0
    dead_volume: Each = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        for name, kinds in (
            ("supply", Orifice),
            ("exhaust", Orifice),
            ("leak", Orifice | None),
            ("valve", Valve | PressureValve),
        ):
            if not isinstance(getattr(self, name), kinds):
                kind = "a Valve or a PressureValve" if name == "valve" else "an Orifice"
                raise refusal(f"gas.{name}", kind, repr(getattr(self, name)))
        checked("gas", self, ("supply_pressure", "exhaust_pressure"))
        checked("gas", self, ("atmosphere",), positive=True)
        checked("gas", self, ("exponent",), positive=True)
        checked("gas", self, ("dead_volume",), nonnegative=True)
        if not isinstance(self.atmosphere, float):
            raise refusal("gas.atmosphere", "one number for all chambers", self.atmosphere)
        vacuum, sink, source = -self.atmosphere, self.exhaust_pressure, self.supply_pressure
        below("gas.exhaust_pressure", vacuum, sink, "a gauge pressure above vacuum")
        below("gas.supply_pressure", sink, source, "a gauge pressure above exhaust_pressure")
        if np.min(self.exponent) < 1:
            raise refusal("gas.exponent", "a number from 1", self.exponent)

    @property
    def command(self) -> str:
        """The valve's."""
        return self.valve.command

    @property
    def sees_volume(self) -> bool:
        """The air fills it."""
        return True

    @property
    def stores_air(self) -> bool:
        """The air is a spring."""
        return True

    def state_names(self, n: int) -> tuple[str, ...]:
        """One amount of air per chamber, then the openings of valves that lag."""
        kinds = ("air", "opening") if self._lags else ("air",)
        return tuple(f"{kind}_{i + 1}" for kind in kinds for i in range(n))

    def state_units(self, n: int) -> tuple[str, ...]:
        """Pressure times volume; a share."""
        return ("J",) * n + ("1",) * (n if self._lags else 0)

    def pressure(self, state: ca.SX, u: ca.SX, air: Air) -> ca.SX:
        """Gauge pressure as it pushes on the robot [Pa], shape (n, 1)."""
        gauge = self._gauge(state, air)
        slope = 0.5 + 0.5 * sign(air.volume_at(gauge), FOLD * air.rest_volume)
        return gauge * slope

    def rate(self, state: ca.SX, u: ca.SX, air: Air) -> ca.SX:
        """What flows in and out [J/s], and how fast valves open [1/s]."""
        supply, exhaust, leak = self._flows(state, u, air)
        rate = supply - exhaust - leak
        if not self._lags:
            return rate
        lag = self.valve.target(u, self._gauge(state, air)) - state[u.shape[0] :]
        return ca.vertcat(rate, lag / self.valve.response_time)

    def signals(self, state: ca.SX, u: ca.SX, air: Air) -> Signals:
        """Gauge pressure [Pa] and mass flows [kg/s]; in through the supply, out of the others."""
        flows = (flow / SPECIFIC for flow in self._flows(state, u, air))
        return Signals(self._gauge(state, air), *flows)

    def accounts(self, state: ca.SX, u: ca.SX, air: Air, *, closed: bool) -> Accounts:
        r"""Energy of the air against the atmosphere, and what the flows bring of it.

        .. math::
            E = p_{atm} V \left(\frac{x^n - n x}{n - 1} + 1\right), \quad
            x = \frac{air}{p_{atm} V}, \quad -\frac{\partial E}{\partial V} = p_{abs} - p_{atm}

        for n = 1 its limit air (ln x - 1) + p_atm V (Bejan, Advanced Engineering Thermodynamics,
        section 5: the flow exergy dE/d(air) is ln x).
        """
        if not closed:
            return super().accounts(state, u, air, closed=closed)
        volume = self._room(air, self._gauge(state, air))
        amount = state[: u.shape[0]]
        x = amount / (self.atmosphere * volume)
        if self._isothermal:
            energy, worth = amount * (ca.log(x) - 1) + self.atmosphere * volume, ca.log(x)
        else:
            n = ca.fmax(self.exponent, _NEARLY_ONE)
            energy = self.atmosphere * volume * ((x**n - n * x) / (n - 1) + 1)
            worth = n * (x ** (n - 1) - 1) / (n - 1)
        supplied = ca.dot(worth, self.rate(state, u, air)[: u.shape[0]])
        return Accounts(ca.sum1(energy), supplied, type(u)(1, 1))

    def rest_state(self, pressure: np.ndarray, volume: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """The air that fills the volumes with gauge pressures; valves shut."""
        ratio = np.maximum(1 + np.asarray(pressure, dtype=float) / self.atmosphere, 0.0)
        room = np.asarray(self.dead_volume) + positive(np.asarray(volume), FOLD * np.asarray(rest))
        amount = self.atmosphere * room * ratio ** (1 / np.asarray(self.exponent))
        return np.concatenate([amount, np.zeros(len(amount) if self._lags else 0)])

    def rest_command(self, pressure: np.ndarray) -> np.ndarray:
        """The pressures, or valves that are shut."""
        return pressure if self.command == "pressure" else np.zeros(np.shape(pressure))

    @property
    def _isothermal(self) -> bool:
        return isinstance(self.exponent, float) and self.exponent == 1.0

    def _room(self, air: Air, pressure: ca.SX) -> ca.SX:
        """Volume that the air fills at a gauge pressure [m^3]."""
        return self.dead_volume + positive(air.volume_at(pressure), FOLD * air.rest_volume)

    @property
    def _lags(self) -> bool:
        return self.valve.response_time is not None

    def _gauge(self, state: ca.SX, air: Air) -> ca.SX:
        """Gauge pressure [Pa]; where chambers grow with it, by Newton's method.

        air(p) is rising and convex, so from a chamber that does not grow, too much, it comes down
        to the root; the steps are enough for volumes that double.
        """
        state = state[: air.volume.shape[0]]
        gauge = self._gauge_in(state, self._room(air, 0.0))
        if not air.grows:
            return gauge
        p = ca.SX.sym("p", gauge.shape[0])
        excess = self._air_at(p, self._room(air, p)) - state
        better = p - excess / ca.jtimes(excess, p, ca.SX.ones(p.shape[0]))
        for _ in range(_NEWTON_STEPS):
            gauge = ca.substitute(better, p, gauge)
        return gauge

    def _gauge_in(self, state: ca.SX, room: ca.SX) -> ca.SX:
        if self._isothermal:
            return state / room - self.atmosphere
        return self.atmosphere * ((state / (self.atmosphere * room)) ** self.exponent - 1)

    def _air_at(self, pressure: ca.SX, room: ca.SX) -> ca.SX:
        ratio = 1 + pressure / self.atmosphere
        if not self._isothermal:
            ratio = ratio ** (1 / self.exponent)
        return self.atmosphere * room * ratio

    def _flows(self, state: ca.SX, u: ca.SX, air: Air) -> tuple[ca.SX, ca.SX, ca.SX]:
        """In through the supply, out through the exhaust, out through the leak [J/s]."""
        gauge = self._gauge(state, air)
        absolute = gauge + self.atmosphere
        warmth: Number = 1.0
        if not self._isothermal:
            warmth = (absolute / self.atmosphere) ** ((self.exponent - 1) / self.exponent)
        opening = state[u.shape[0] :] if self._lags else self.valve.target(u, gauge)
        supply, exhaust = self.valve.ways(opening)
        source, sink = (p + self.atmosphere for p in (self.supply_pressure, self.exhaust_pressure))
        into = supply * self.supply.flow(source, absolute, 1.0, warmth)
        out = exhaust * self.exhaust.flow(absolute, sink, warmth, 1.0)
        if self.leak is None:
            return into, out, type(u)(*u.shape)
        return into, out, self.leak.flow(absolute, self.atmosphere, warmth, 1.0)
