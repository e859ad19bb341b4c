r"""Compliant contact of a disc's rim points with an obstacle, as one of the forces.

A point at the signed distance g from the obstacle, with the unit normal n out of it and the
velocity v, is pushed with

.. math:: f_n = k\, h(-g)\, s(1 - d\, n \cdot v), \qquad
          f_t = -\mu\, f_n\, v_t / \sqrt{|v_t|^2 + v_s^2},

where h starts smoothly at zero over the stated penetration delta (`forces.walls.taken_up`), so that
k = 2 F / delta gives delta under the stated load F; s is 1 at rest and never negative, so that
nothing pulls; d is the dissipation of Hunt and Crossley ("Coefficient of restitution interpreted as
damping in vibroimpact", J. Appl. Mech. 42, 1975): what hits at a low speed v leaves at v (1 - 2 d v
/ 3); v_t is the velocity along the surface. Short of the cone's edge friction acts like a damper:
on a slope below atan(mu) a point creeps at

.. math:: v = v_s \tan\theta / \sqrt{\mu^2 - \tan^2\theta}.

Everything has two continuous derivatives where the distance has.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ..forces.protocol import DiscState, Force, Packed, Wrench
from ..forces.walls import taken_up
from ..kernels.axes import cross
from .obstacle import Obstacle
from .shapes import towards

# Share of the damping factor over which it bends to zero.
_BEND = 0.1


class Touch(NamedTuple):
    """A rim point: its distance [m], its place [m] and the force on it [N], root frame."""

    gap: ca.SX
    place: ca.SX
    force: ca.SX


@dataclass(frozen=True, eq=False)
class CompliantContact(Force):
    """The rim of one disc against one obstacle.

    Attributes:
        disc: number of the disc.
        shape: kind of the obstacle's shape.
        geometry: its numbers.
        points: on the rim, in the disc's frame, shape (n, 3) [m].
        stiffness: k [N/m].
        penetration: over which the force starts [m].
        friction: mu.
        slip_speed: v_s [m/s].
        dissipation: d [s/m].
    """

    disc: int
    shape: Any
    geometry: np.ndarray
    points: np.ndarray
    stiffness: float
    penetration: float
    friction: float
    slip_speed: float
    dissipation: float

    @classmethod
    def of(cls, obstacle: Obstacle, disc: int, points: np.ndarray) -> "CompliantContact":
        """A disc's rim against an obstacle."""
        numbers = {name: getattr(obstacle, name) for name in NUMBERS}
        return cls(disc=disc, shape=type(obstacle.shape), points=points, **numbers)

    def touches(self, disc: DiscState) -> list[Touch]:
        """Every rim point."""
        return [self._touch(disc, self._point(k)) for k in range(self.points.shape[0])]

    def wrenches(self, disc: DiscState) -> Wrench:
        """Sum of the forces on the rim points."""
        moment, force = ca.SX.zeros(3), ca.SX.zeros(3)
        for touch in self.touches(disc):
            moment = moment + cross(touch.place - disc.r, touch.force)
            force = force + touch.force
        return Wrench(moment, force)

    def energy(self, disc: DiscState) -> ca.SX:
        """Energy of what has sunk in [J]."""
        total = ca.SX(0)
        for k in range(self.points.shape[0]):
            gap, _ = towards(self.shape, self.geometry, disc.place(self._point(k)))
            total = total + self.stiffness * taken_up(-gap, self.penetration).once
        return total

    def _point(self, k: int) -> ca.SX:
        return ca.SX(self.points)[k, :].T

    def _touch(self, disc: DiscState, point: ca.SX) -> Touch:
        place, v = disc.place(point), disc.velocity(point)
        gap, normal = towards(self.shape, self.geometry, place)
        apart = ca.dot(normal, v)
        push = self.stiffness * taken_up(-gap, self.penetration).h
        push = push * _bent(1 - self.dissipation * apart) / _bent(1)
        slip = v - apart * normal
        drag = self.friction / ca.sqrt(ca.sumsqr(slip) + self.slip_speed**2)
        return Touch(gap, place, push * (normal - drag * slip))


# Of an obstacle and its contacts, each may be a free parameter.
NUMBERS = ("geometry", "stiffness", "penetration", "friction", "slip_speed", "dissipation")


def _bent(share: Any) -> Any:
    """The share where it is positive, and never negative."""
    return (share + ca.sqrt(share**2 + _BEND**2)) / 2


def rim_touches(
    R: ca.SX, r: ca.SX, w: ca.SX, v: ca.SX, *contacts: Packed
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Gaps (n, 1), places (3, n) and forces (3, n) of a disc's contacts; w and v along its axes."""
    disc = DiscState(R, r, own_rates=(w, v))
    known: list[Any] = [contact.force() for contact in contacts]
    touches = [touch for contact in known for touch in contact.touches(disc)]
    gaps, places, forces = zip(*touches, strict=True)
    return ca.vertcat(*gaps), ca.horzcat(*places), ca.horzcat(*forces)
