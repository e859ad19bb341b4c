"""Chamber pressure as wrenches on discs, III-C."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from ..kernels.axes import cross, vector
from .protocol import DiscState, Force, Wrench, column

# Added under the root of a product of free areas [m^4], so that its slope is finite at zero.
FLOOR = 1e-36


class ChamberNumbers(NamedTuple):
    """A chamber's pressed areas (n, 1) and their centroids (3, n) by disc, radial compliance."""

    areas: ca.SX
    centroids: ca.SX
    radial_compliance: ca.SX


@dataclass(frozen=True, eq=False)
class EndPressure(Force):
    """Wrench pressure * area * z at the area's centroid, along the disc's axes: a follower load.

    A chamber's last disc gets it with the chamber's gauge pressure [Pa], its first disc with the
    negative one (`side`); between them the pressure on a disc's two faces cancels (III-C).
    """

    disc: int
    side: ca.SX
    pressure: ca.SX
    area: ca.SX
    centroid: ca.SX
    radial_compliance: ca.SX

    def wrenches(self, disc: DiscState) -> Wrench:
        """The wrench, whatever the pose."""
        scale = _scale(self.radial_compliance, self.pressure)
        area = self.area * scale**2
        push = vector(0, 0, self.side * self.pressure * area)
        return disc.push_own(push, self.centroid * scale)


@dataclass(frozen=True, eq=False)
class PressureOnVolume(Force):
    r"""Wrench pressure * dV/dq of the air between two neighbouring discs.

    V is the volume between plane discs of similar outlines with areas A1, A2 and corresponding
    rim points joined by straight lines. With the discs' axes x, y, z and D from centroid to
    centroid,

    .. math::
        6 V = D \cdot (2 A_1 z_1 + 2 A_2 z_2
                       + \sqrt{A_1 A_2} (x_1 \times y_2 + x_2 \times y_1))

    by the divergence theorem, the discs being part of the closed surface. Conservative at constant
    pressure.
    """

    discs: tuple[int, int]
    pressure: ca.SX
    area: ca.SX
    area_next: ca.SX
    centroid: ca.SX
    centroid_next: ca.SX
    radial_compliance: ca.SX

    def wrenches(self, disc: DiscState) -> Wrench:
        """Force p dV/dD at the centroid of disc i+1, and the moment p dV/d(rotation) about it."""
        arm, D, (_, outer, mixed), normal = self._parts(disc)
        x, y, z = ca.horzsplit(disc.R)
        skewed = D * (y[0] - x[1]) + vector(-ca.dot(y, D), ca.dot(x, D), 0)
        moment = 2 * outer * cross(z, D) + mixed * skewed + cross(arm, normal)
        return Wrench(moment * self.pressure, normal * self.pressure)

    def volume(self, disc: DiscState) -> ca.SX:
        """V [m^3]."""
        _, D, _, normal = self._parts(disc)
        return ca.dot(D, normal)

    def _parts(self, disc: DiscState) -> tuple[ca.SX, ca.SX, tuple[ca.SX, ca.SX, ca.SX], ca.SX]:
        """Arm of the next centroid, D, a sixth of areas and their geometric mean, and dV/dD."""
        scale = _scale(self.radial_compliance, self.pressure)
        sixth = scale**2 / 6
        product = ca.SX(self.area * self.area_next)
        if not product.is_constant():
            product = product + FLOOR
        A, outer, mixed = (area * sixth for area in (self.area, self.area_next, ca.sqrt(product)))
        arm = ca.mtimes(disc.R, column(self.centroid_next) * scale)
        D = disc.r + arm - column(self.centroid) * scale
        x, y, z = ca.horzsplit(disc.R)
        normal = 2 * outer * z + mixed * vector(-x[2], -y[2], x[0] + y[1])
        return arm, D, (A, outer, mixed), normal + vector(0, 0, 2 * A)


def _scale(radial_compliance: ca.SX, pressure: ca.SX) -> ca.SX:
    """How many times larger every length of a disc's pressed area is than without pressure."""
    return 1 + radial_compliance * pressure


def end_pressures(discs: tuple[int, int], numbers: ChamberNumbers, pressure: ca.SX) -> list[Force]:
    """`last_disc`: the chamber's resultants on its first and last disc."""
    ends = ((discs[0], 0, -1.0), (discs[1], -1, 1.0))
    return [
        EndPressure(
            disc,
            ca.DM(side),
            pressure,
            numbers.areas[k],
            numbers.centroids[:, k],
            numbers.radial_compliance,
        )
        for disc, k, side in ends
    ]


def pressures_on_volume(
    discs: tuple[int, int], numbers: ChamberNumbers, pressure: ca.SX
) -> list[PressureOnVolume]:
    """`volume`: the chamber's air, segment by segment."""
    first, last = discs
    return [
        PressureOnVolume(
            (i, i + 1),
            pressure,
            numbers.areas[i - first],
            numbers.areas[i - first + 1],
            numbers.centroids[:, i - first],
            numbers.centroids[:, i - first + 1],
            numbers.radial_compliance,
        )
        for i in range(first, last)
    ]


INFLATION: dict[str, Callable[..., list]] = {
    "last_disc": end_pressures,
    "volume": pressures_on_volume,
}
