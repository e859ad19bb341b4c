"""Bilateral constraints as values: pinned and guided points, straps, closed loops.

Each gives rows phi(q) = 0 in metres, and for a unit of each row's multiplier the points that are
pulled and their directions, which make the row of A_q = d phi / d q. The robot feels -A_q^T lambda,
eq (7). Disc 1, the root, may be one end of a strap or a loop.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from .. import checks
from ..errors import RobotError
from ..parts import set_fields

_AXES = np.eye(3)
# Added to squared lengths [m^2], so that their root has a slope at zero.
_TINY = 1e-30


class Pull(NamedTuple):
    """A direction in the root's frame, shape (3, 1), at a point of a disc (from 1)."""

    disc: int
    point: np.ndarray
    direction: Any


class Row(NamedTuple):
    """One scalar constraint: phi [m], and d phi = sum of direction . d(point)."""

    phi: Any
    pulls: tuple[Pull, ...]


class Poses(NamedTuple):
    """Rotations and origins of the discs in the root frame, the root first."""

    R: Any
    r: Any

    def place(self, disc: int, point: np.ndarray) -> Any:
        """A point of a disc in the root frame, shape (3, 1) [m]."""
        return self.r[disc - 1] + ca.mtimes(self.R[disc - 1], ca.DM(point))


@dataclass(frozen=True, eq=False)
class Pinned:
    """A point of a disc held at a place, free to turn: three rows.

    Attributes:
        disc: number of the disc, from 2.
        point: in the disc's frame, shape (3,) [m].
        place: in the root's frame, shape (3,) [m].

    Raises:
        RobotError: a value is not finite, or no disc that moves.
    """

    disc: int
    point: np.ndarray
    place: np.ndarray

    def __post_init__(self) -> None:
        """Check every field."""
        set_fields(self, disc=_moving(self.disc), **_points(self, "point", "place"))

    @property
    def discs(self) -> tuple[int, ...]:
        """The discs it pulls."""
        return (self.disc,)

    def rows(self, poses: Poses) -> list[Row]:
        """Place of the point less where it belongs, along x, y and z."""
        away = poses.place(self.disc, self.point) - ca.DM(self.place)
        pulls = [(Pull(self.disc, self.point, ca.DM(axis)),) for axis in _AXES]
        return [Row(away[k], pulls[k]) for k in range(3)]


@dataclass(frozen=True, eq=False)
class Guided:
    """A point of a disc that slides without friction along a line (two rows) or a plane (one).

    Attributes:
        disc: number of the disc, from 2.
        point: in the disc's frame, shape (3,) [m].
        place: of the line or the plane, in the root's frame, shape (3,) [m].
        along: direction of the line, shape (3,); or
        normal: of the plane, shape (3,); unit vectors are stored.

    Raises:
        RobotError: a value is not finite, no disc that moves, or not one of along and normal.
    """

    disc: int
    point: np.ndarray
    place: np.ndarray
    along: np.ndarray | None = None
    normal: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        if (self.along is None) == (self.normal is None):
            got = "none" if self.along is None else "both"
            raise RobotError("along", "either along or normal", got)
        name = "normal" if self.along is None else "along"
        unit = checks.unit(name, getattr(self, name))
        set_fields(self, disc=_moving(self.disc), **_points(self, "point", "place"), **{name: unit})

    @property
    def discs(self) -> tuple[int, ...]:
        """The discs it pulls."""
        return (self.disc,)

    def rows(self, poses: Poses) -> list[Row]:
        """Distance of the point from the plane, or along two directions across the line."""
        away = poses.place(self.disc, self.point) - ca.DM(self.place)
        directions = [self.normal]
        if self.along is not None:
            first = np.cross(self.along, _AXES[np.argmin(np.abs(self.along))])
            first /= np.linalg.norm(first)
            directions = [first, np.cross(self.along, first)]
        units = [ca.DM(direction) for direction in directions]
        return [Row(ca.dot(n, away), (Pull(self.disc, self.point, n),)) for n in units]


@dataclass(frozen=True, eq=False)
class Strap:
    """A second fabric thread: two points keep their distance, whether it pulls or pushes: one row.

    Attributes:
        discs: numbers of two discs, rising.
        start: its end on the first, in that disc's frame, shape (3,) [m].
        end: its end on the second [m].
        length: positive [m].

    Raises:
        RobotError: a value is not finite or out of range.
    """

    discs: tuple[int, int]
    start: np.ndarray
    end: np.ndarray
    length: float

    def __post_init__(self) -> None:
        """Check every field."""
        length = checks.number("length", self.length, positive=True)
        set_fields(self, discs=_pair(self.discs), **_points(self, "start", "end"), length=length)

    def rows(self, poses: Poses) -> list[Row]:
        """|end - start| - length."""
        first, second = self.discs
        way = poses.place(second, self.end) - poses.place(first, self.start)
        distance = ca.sqrt(ca.sumsqr(way) + _TINY)
        unit = way / distance
        pulls = Pull(first, self.start, -unit), Pull(second, self.end, unit)
        return [Row(distance - self.length, pulls)]


@dataclass(frozen=True, eq=False)
class Joined:
    """A closed loop: a point of one disc stays on a point of another, free to turn: three rows.

    Attributes:
        discs: numbers of two discs, rising.
        start: the point of the first, in its frame, shape (3,) [m].
        end: the point of the second, in its frame, shape (3,) [m].

    Raises:
        RobotError: a value is not finite, or discs that do not rise.
    """

    discs: tuple[int, int]
    start: np.ndarray
    end: np.ndarray

    def __post_init__(self) -> None:
        """Check every field."""
        set_fields(self, discs=_pair(self.discs), **_points(self, "start", "end"))

    def rows(self, poses: Poses) -> list[Row]:
        """Way from the one point to the other along the root's x, y and z."""
        first, second = self.discs
        way = poses.place(second, self.end) - poses.place(first, self.start)
        return [
            Row(way[k], (Pull(first, self.start, -axis), Pull(second, self.end, axis)))
            for k, axis in enumerate(ca.DM(row) for row in _AXES)
        ]


Constraint = Pinned | Guided | Strap | Joined


def _moving(disc: object) -> int:
    return checks.index("disc", disc, 2, 10**6)


def _pair(discs: Any) -> tuple[int, int]:
    numbers = tuple(checks.index("discs", disc, 1, 10**6) for disc in discs)
    if len(numbers) != 2 or numbers[0] >= numbers[1]:
        raise RobotError("discs", "two disc numbers in rising order", checks.shown(discs))
    return numbers


def _points(owner: Any, *names: str) -> dict[str, np.ndarray]:
    return {name: checks.array(name, getattr(owner, name), (3,)) for name in names}
