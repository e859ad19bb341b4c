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
        overlap: part of the command over which a way opens along the parabola, above 0.

    Raises:
        ActuatorError: a field out of range.
    """

    overlap: float = 0.04

    def __post_init__(self) -> None:
        """Check the field."""
        _share(self, "overlap")

    @property
    def command(self) -> str:
        """What a command is."""
        return "opening"

    def ways(self, u: ca.SX, pressure: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Openings to the supply and to the exhaust, 0 to 1 each."""
        half, opening = self.overlap / 2, cut(u, -1.0, 1.0)
        return tuple(ramp(way - half, half) / (1 - half) for way in (opening, -opening))


@dataclass(frozen=True)
class PressureValve:
    """A three-way valve that follows a pressure command: opening (u - pressure) / band.

    Within `underlap` of the middle both ways are a little open and bleed air, as real ones do; the
    pressure settles within underlap * band of the command. Fully open where |u - pressure| is 1.25
    band or more, with a continuous slope.

    Attributes:
        band: distance from the command at which the valve would be fully open [Pa], positive.
        underlap: opening below which both ways are open, above 0.

    Raises:
        ActuatorError: a field out of range.
    """

    band: Each
    underlap: float = 0.02

    def __post_init__(self) -> None:
        """Check both fields."""
        checked("valve", self, ("band",), positive=True)
        _share(self, "underlap")

    @property
    def command(self) -> str:
        """What a command is."""
        return "pressure"

    def ways(self, u: ca.SX, pressure: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Openings to the supply and to the exhaust, 0 to 1 each."""
        opening = soft_cut((u - pressure) * (1 / self.band), -1.0, 1.0)
        supply = ramp(opening, self.underlap)
        return supply, ca.fmax(supply - opening, 0.0)  # the same as ramp(-opening)


def _share(valve: Valve | PressureValve, name: str) -> None:
    checked("valve", valve, (name,), positive=True)
    value = getattr(valve, name)
    if not isinstance(value, float) or value >= 1:
        raise refusal(f"valve.{name}", "a number between 0 and 1", value)
