"""Valves: how far a command opens a chamber's way to the supply and to the exhaust."""

from dataclasses import dataclass

import casadi as ca

from .fields import Each, checked, refusal
from .smooth import cut, ramp, soft_cut


@dataclass(frozen=True)
class Valve:
    """A three-way valve whose command is its opening, from -1 (exhaust) to 1 (supply).

    Each way opens along a parabola and then in proportion; both are shut at zero.

    Attributes:
        overlap: part of the opening over which a way opens along the parabola, above 0.
        response_time: lag of the opening behind what it should be, a state [s]; None: none.

    Raises:
        ActuatorError: a field out of range.
    """

    overlap: float = 0.04
    response_time: Each | None = None

    def __post_init__(self) -> None:
        """Check the fields."""
        _check(self, "overlap")

    @property
    def command(self) -> str:
        """What a command is."""
        return "opening"

    def target(self, u: ca.SX, pressure: ca.SX) -> ca.SX:
        """The opening asked for, within [-1, 1]."""
        return cut(u, -1.0, 1.0)

    def ways(self, opening: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Shares of the supply's and the exhaust's orifice that are open."""
        half = self.overlap / 2
        supply, exhaust = (ramp(way - half, half) / (1 - half) for way in (opening, -opening))
        return supply, exhaust


@dataclass(frozen=True)
class PressureValve:
    """A three-way valve that follows a pressure command: opening (u - pressure) / band.

    Within `underlap` of the middle both ways are a little open and bleed air, as real ones do; the
    pressure settles within underlap * band of the command. Fully open where |u - pressure| is 1.25
    band or more, with a continuous slope.

    Attributes:
        band: distance from the command at which the valve would be fully open [Pa], positive.
        underlap: opening below which both ways are open, above 0.
        response_time: lag of the opening behind what it should be, a state [s]; None: none.

    Raises:
        ActuatorError: a field out of range.
    """

    band: Each
    underlap: float = 0.02
    response_time: Each | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        checked("valve", self, ("band",), positive=True)
        _check(self, "underlap")

    @property
    def command(self) -> str:
        """What a command is."""
        return "pressure"

    def target(self, u: ca.SX, pressure: ca.SX) -> ca.SX:
        """The opening asked for, within [-1, 1]."""
        return soft_cut((u - pressure) * (1 / self.band), -1.0, 1.0)

    def ways(self, opening: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Shares of the supply's and the exhaust's orifice that are open."""
        supply = ramp(opening, self.underlap)
        return supply, ca.fmax(supply - opening, 0.0)  # the same as ramp(-opening)


def _check(valve: Valve | PressureValve, lap: str) -> None:
    checked("valve", valve, (lap, "response_time"), positive=True)
    value = getattr(valve, lap)
    if not isinstance(value, float) or value >= 1:
        raise refusal(f"valve.{lap}", "a number between 0 and 1", value)
