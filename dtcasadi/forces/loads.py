"""Loads on one disc: forces and couples that keep their direction, or turn with the disc."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import casadi as ca
import numpy as np

from .. import checks
from ..parts import set_fields
from .points import at_centre, checked_point
from .protocol import DiscState, Force, Wrench, column

if TYPE_CHECKING:
    from ..robot import Disc, Thread


@dataclass(frozen=True, eq=False)
class DeadWrench(Force):
    """Force [N] and moment about the disc's origin [N m], fixed in the root frame.

    What the theta block `wrench` holds; no energy, as its numbers may change with time.
    """

    disc: int
    force: ca.SX
    moment: ca.SX

    def wrenches(self, disc: DiscState) -> Wrench:
        """The same whatever the pose."""
        return Wrench(column(self.moment), column(self.force))


@dataclass(frozen=True, eq=False)
class _PointForce(Force):
    """What the forces on one point of a disc share: their fields and checks."""

    disc: int
    magnitude: float
    direction: np.ndarray
    point: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        set_fields(
            self,
            magnitude=checks.number("magnitude", self.magnitude),
            direction=checks.unit("direction", self.direction),
            **checked_point(self.point),
        )

    def fitted(self, discs: "Sequence[Disc]", threads: "Sequence[Thread]") -> Self:
        """The force on the disc's centre of mass where no point is given."""
        return at_centre(self, discs)

    def _vector(self) -> ca.SX:
        return self.magnitude * column(self.direction)


@dataclass(frozen=True, eq=False)
class PointLoad(_PointForce):
    """A force that keeps its direction in the root's frame (a dead load).

    Attributes:
        disc: number of the disc, from 2.
        magnitude: [N], of any sign.
        direction: in the root's frame, shape (3,); stored as a unit vector.
        point: where it acts, in the disc's frame, shape (3,) [m]; None: the centre of mass.

    Raises:
        RobotError: a value is not finite, or the direction is zero.
    """

    def wrenches(self, disc: DiscState) -> Wrench:
        """The force along the disc's axes, R^T f."""
        return disc.push_own(ca.mtimes(disc.R.T, self._vector()), self.point)

    def energy(self, disc: DiscState) -> ca.SX:
        """-f . place [J]."""
        return -ca.dot(self._vector(), disc.place(self.point))


@dataclass(frozen=True, eq=False)
class FollowerLoad(_PointForce):
    """A force that turns with its disc; no energy, it may do net work round a closed path.

    Attributes:
        disc: number of the disc, from 2.
        magnitude: [N], of any sign.
        direction: in the disc's frame, shape (3,); stored as a unit vector.
        point: where it acts, in the disc's frame, shape (3,) [m]; None: the centre of mass.

    Raises:
        RobotError: a value is not finite, or the direction is zero.
    """

    def wrenches(self, disc: DiscState) -> Wrench:
        """The same whatever the pose, along the disc's axes."""
        return disc.push_own(self._vector(), self.point)


@dataclass(frozen=True, eq=False)
class Couple(Force):
    """A moment on one disc; no energy (a fixed axis is not conservative in space either).

    Attributes:
        disc: number of the disc, from 2.
        magnitude: [N m], of any sign.
        direction: axis, shape (3,); stored as a unit vector.
        follower: whether the axis turns with the disc (its frame) or keeps its direction in the
            root's frame.

    Raises:
        RobotError: a value is not finite, or the direction is zero.
    """

    disc: int
    magnitude: float
    direction: np.ndarray
    follower: bool = False

    def __post_init__(self) -> None:
        """Check every field."""
        set_fields(
            self,
            magnitude=checks.number("magnitude", self.magnitude),
            direction=checks.unit("direction", self.direction),
            follower=checks.truth("follower", self.follower),
        )

    def wrenches(self, disc: DiscState) -> Wrench:
        """The moment."""
        moment = self.magnitude * column(self.direction)
        return disc.turn_own(moment) if self.follower else disc.turn(moment)
