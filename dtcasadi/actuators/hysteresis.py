"""Hysteresis of the pressure that moves the robot, and break-in of new chambers."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from .. import checks
from .fields import Each, checked, refusal
from .protocol import Accounts, Air, Signals, Wrapped

MOST_SHARP = 8


@dataclass(frozen=True)
class Hysteresis(Wrapped):
    r"""What the walls' inner friction takes from the pressure while a chamber grows or shrinks.

    Bouc-Wen form with the state w in [-1, 1], driven by the volume through its rate v = dV/dt over
    the rest volume (with inflation `last_disc`: by the power of a unit of pressure), n = sharpness:

    .. math::
        p_{effective} = p - amplitude\, w, \quad
        travel\, \dot w = v - \tfrac12 |v|_\epsilon |w|^{n-1} w - \tfrac12 v |w|^n, \quad
        |v|_\epsilon = \sqrt{v^2 + (travel / creep\_time)^2}

    (Ikhouane, Rodellar, Systems with Hysteresis, chapter 2, with equal loading and unloading
    parameters.) At the same pressure a chamber that grows is smaller than one that shrinks.
    Driven by what the pressure works on, it can only take energy: it stores amplitude * travel *
    V_rest w^2 / 2 and dissipates the rest. It does not depend on the rate, but for creep while the
    chamber rests: w relaxes in `creep_time` and longer.

    A new chamber is stiffer: with the state c, 1 when new,

    .. math::
        p_{effective} = p - amplitude\, w - break\_in\; c\, (V - V_{rest}) / V_{rest}, \quad
        break\_in\_travel\; \dot c = - |v|_\epsilon\, c

    It is there if `break_in` is given, and takes inflation `volume`.

    Attributes:
        source: the actuator whose pressure it is.
        amplitude: half the width of a full loop in pressure [Pa].
        travel: how far a reversed motion turns the loop round, as a share of the rest volume.
        sharpness: n, how suddenly it turns, from 2.
        creep_time: over which a resting chamber relaxes, at least [s].
        break_in: pressure that twice the rest volume costs a new chamber more than an old one [Pa].
        break_in_travel: way there and back, in rest volumes, over which that falls to 37 %.

    Raises:
        ActuatorError: a field out of range.
    """

    amplitude: Each = 0.0
    travel: Each = 0.05
    sharpness: int = 2
    creep_time: Each = 1e4
    break_in: Each | None = None
    break_in_travel: Each = 5.0

    def __post_init__(self) -> None:
        """Check every field."""
        self.check_source("hysteresis")
        checked("hysteresis", self, ("amplitude", "break_in"), nonnegative=True)
        lengths = ("travel", "creep_time", "break_in_travel")
        checked("hysteresis", self, lengths, positive=True)
        checks.index("hysteresis.sharpness", self.sharpness, 2, MOST_SHARP, error=refusal)

    @property
    def sees_volume(self) -> bool:
        """For the break-in, or as the source does."""
        return self._breaks_in or self.source.sees_volume

    @property
    def sees_volume_rate(self) -> bool:
        """It is driven by it."""
        return True

    def fit(self, n: int, inflation: str) -> None:
        """Whether chambers break in with inflation `volume`, and what the source says."""
        super().fit(n, inflation)
        if self._breaks_in and inflation != "volume":
            expected = 'inflation="volume", whose work the extra stiffness takes'
            raise refusal("hysteresis.break_in", expected, repr(inflation))

    def own_names(self, n: int) -> tuple[str, ...]:
        """Friction w of each chamber, then c where chambers break in."""
        kinds = ("hysteresis", "newness") if self._breaks_in else ("hysteresis",)
        return tuple(f"{kind}_{i + 1}" for kind in kinds for i in range(n))

    def own_units(self, n: int) -> tuple[str, ...]:
        """Pure numbers."""
        return ("1",) * len(self.own_names(n))

    def pressure(self, state: ca.SX, u: ca.SX, air: Air) -> ca.SX:
        """The source's less what the walls take [Pa], shape (n, 1)."""
        inner, *own = self.split(state, u)
        return self.source.pressure(inner, u, air) - self._taken(own, air)

    def rate(self, state: ca.SX, u: ca.SX, air: Air) -> ca.SX:
        """The source's, then those of w and c [1/s]."""
        inner, w, *newness = self.split(state, u)
        v, speed = self._motion(air)
        rates = [(v - self._lost(v, speed, w)) / self.travel]
        rates += [-speed * c / self.break_in_travel for c in newness]
        return ca.vertcat(self.source.rate(inner, u, air), *rates)

    def signals(self, state: ca.SX, u: ca.SX, air: Air) -> Signals:
        """The source's."""
        inner, *_ = self.split(state, u)
        return self.source.signals(inner, u, air)

    def accounts(self, state: ca.SX, u: ca.SX, air: Air, *, closed: bool) -> Accounts:
        """Adds what the walls store and lose."""
        inner, w, *newness = self.split(state, u)
        stored, supplied, dissipated = self.source.accounts(inner, u, air, closed=closed)
        v, speed = self._motion(air)
        scale = self.amplitude * air.rest_volume
        stored = stored + ca.sum1(scale * self.travel * w**2) / 2
        dissipated = dissipated + ca.sum1(scale * w * self._lost(v, speed, w))
        for c in newness:
            stretch = self.break_in * (air.volume - air.rest_volume) ** 2 / (2 * air.rest_volume)
            stored = stored + ca.sum1(stretch * c)
            dissipated = dissipated + ca.sum1(stretch * speed * c / self.break_in_travel)
        if not closed:
            supplied = supplied + ca.dot(self._taken([w, *newness], air), air.volume_rate)
        return Accounts(stored, supplied, dissipated)

    def rest_state(self, pressure: np.ndarray, volume: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """The source's, no friction, new chambers."""
        inner, n = self.source.rest_state(pressure, volume, rest), len(pressure)
        return np.concatenate([inner, np.zeros(n), np.ones(n if self._breaks_in else 0)])

    @property
    def _breaks_in(self) -> bool:
        return self.break_in is not None

    def _motion(self, air: Air) -> tuple[ca.SX, ca.SX]:
        """Rate v and |v| smoothed [1/s]; never below |v|, so that w stays in [-1, 1]."""
        v = air.volume_rate / air.rest_volume
        return v, ca.sqrt(v**2 + (self.travel / self.creep_time) ** 2)

    def _lost(self, v: ca.SX, speed: ca.SX, w: ca.SX) -> ca.SX:
        """What keeps w within its limits; times w it is never negative, as speed >= |v|."""
        n, size = self.sharpness, ca.fabs(w)
        return (speed * size ** (n - 1) * w + v * size**n) / 2

    def _taken(self, own: list[ca.SX], air: Air) -> ca.SX:
        """Pressure that the walls take [Pa]."""
        w, *newness = own
        taken = self.amplitude * w
        for c in newness:
            taken = taken + self.break_in * c * (air.volume / air.rest_volume - 1)
        return taken
