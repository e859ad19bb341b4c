"""Forces as a user may write them, for the tests of the protocol."""

from dataclasses import dataclass

import casadi as ca

import dtcasadi as dtc
from dtcasadi.forces import DiscState, Wrench


@dataclass(frozen=True, eq=False)
class Magnet(dtc.Force):
    """Pulls a point of a disc towards a place, softer with distance; wrenches and energy."""

    disc: int
    strength: float
    place: tuple[float, ...] = (0.3, 0.4, 0.5)
    soft: float = 0.2

    def wrenches(self, disc: DiscState) -> Wrench:
        gap = ca.SX(self.place) - disc.place((0.0, 1.0, 0.0))
        return disc.push(self.strength * gap / (ca.sumsqr(gap) + self.soft), (0.0, 1.0, 0.0))

    def energy(self, disc: DiscState) -> ca.SX:
        gap = ca.SX(self.place) - disc.place((0.0, 1.0, 0.0))
        return self.strength / 2 * ca.log(ca.sumsqr(gap) + self.soft)


class MagnetByEnergy(Magnet):
    """The same from its energy alone."""

    wrenches = dtc.Force.wrenches


@dataclass(frozen=True, eq=False)
class Tendon(dtc.Force):
    """An elastic cable with a damper through a point of each of its discs."""

    discs: tuple[int, ...]
    stiffness: float
    damping: float
    point: tuple[float, ...] = (0.5, 0.1, 0.0)
    rest: float = 1.0

    def wrenches(self, *discs: DiscState) -> list[Wrench]:
        places = [ca.SX(self.point), *(disc.place(self.point) for disc in discs)]
        speeds = [ca.SX.zeros(3), *(disc.velocity(self.point) for disc in discs)]
        gaps = [b - a for a, b in zip(places, places[1:], strict=False)]
        lengths = [ca.norm_2(gap) for gap in gaps]
        units = [gap / length for gap, length in zip(gaps, lengths, strict=True)]
        rate = sum(ca.dot(u, b - a) for u, a, b in zip(units, speeds, speeds[1:], strict=False))
        tension = self.stiffness * (sum(lengths) - self.rest) + self.damping * rate
        pulls = [-tension * u for u in units]
        ends = [*pulls[1:], ca.SX.zeros(3)]
        return [
            disc.push(own - onward, self.point)
            for disc, own, onward in zip(discs, pulls, ends, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class Sail(dtc.Force):
    """Drag of the wind on a disc, along the disc's axes, and a brake along the root's."""

    disc: int
    area: float
    wind: tuple[float, ...] = (1.0, -0.5, 2.0)

    def wrenches(self, disc: DiscState) -> Wrench:
        slip = disc.R.T @ ca.SX(self.wind) - disc.v_own
        own = disc.push_own(self.area * slip[2] ** 3 * ca.SX([0, 0, 1]), (0.1, 0.2, 0.3))
        brake = disc.turn(-self.area * disc.w * ca.sumsqr(disc.w))
        turned = Wrench(disc.R.T @ brake.moment, disc.R.T @ brake.force, own=True)
        return own + turned
