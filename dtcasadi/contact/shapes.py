"""Shapes of obstacles: signed distances that are smooth outside, positive where nothing touches.

Each is a frozen value in the root's frame. `distance` is a kernel: it takes the shape's numbers as
a column, so that they may be free parameters, and has no `if_else`.
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from .. import checks
from ..errors import RobotError
from ..parts import set_fields

# Added to squared lengths [m^2], so that their root has a slope at zero.
_TINY = 1e-30
# Of the smallest edge of a box, where no rounding is given.
_ROUNDING = 0.1


class Balls(NamedTuple):
    """A shape as the convex hull of equal balls: their centres, shape (n, 3), and radius [m]."""

    centres: np.ndarray
    radius: float


@dataclass(frozen=True, eq=False)
class HalfSpace:
    """All that lies below a plane.

    Attributes:
        point: of the plane, shape (3,) [m].
        normal: out of the obstacle, shape (3,); stored as a unit vector.

    Raises:
        RobotError: a value is not finite, or the normal is zero.
    """

    point: np.ndarray
    normal: np.ndarray

    def __post_init__(self) -> None:
        """Check every field."""
        point = checks.array("point", self.point, (3,))
        set_fields(self, point=point, normal=checks.unit("normal", self.normal))

    @property
    def numbers(self) -> np.ndarray:
        """What `distance` takes: point and normal."""
        return np.concatenate([self.point, self.normal])

    @staticmethod
    def distance(numbers: ca.SX, place: ca.SX) -> ca.SX:
        """N . (place - point) [m]."""
        return ca.dot(numbers[3:], place - numbers[:3])

    def balls(self) -> None:
        """None: it has no end."""


@dataclass(frozen=True, eq=False)
class Sphere:
    """A ball.

    Attributes:
        centre: shape (3,) [m].
        radius: positive [m].

    Raises:
        RobotError: a value is not finite, or the radius is not positive.
    """

    centre: np.ndarray
    radius: float

    def __post_init__(self) -> None:
        """Check every field."""
        centre = checks.array("centre", self.centre, (3,))
        radius = checks.number("radius", self.radius, positive=True)
        set_fields(self, centre=centre, radius=radius)

    @property
    def numbers(self) -> np.ndarray:
        """What `distance` takes: centre and radius."""
        return np.array([*self.centre, self.radius])

    @staticmethod
    def distance(numbers: ca.SX, place: ca.SX) -> ca.SX:
        """|place - centre| - radius [m]."""
        return _length(place - numbers[:3]) - numbers[3]

    def balls(self) -> Balls:
        """One ball."""
        return Balls(self.centre[np.newaxis], self.radius)


@dataclass(frozen=True, eq=False)
class Capsule:
    """A cylinder with hemispherical ends.

    Attributes:
        start: one end of its axis, shape (3,) [m].
        end: the other end.
        radius: positive [m].

    Raises:
        RobotError: a value is not finite, the radius is not positive, or both ends are the same.
    """

    start: np.ndarray
    end: np.ndarray
    radius: float

    def __post_init__(self) -> None:
        """Check every field."""
        start, end = (checks.array(name, getattr(self, name), (3,)) for name in ("start", "end"))
        if not np.linalg.norm(end - start) > 0:
            raise RobotError("end", "another point than start", checks.shown(end))
        radius = checks.number("radius", self.radius, positive=True)
        set_fields(self, start=start, end=end, radius=radius)

    @property
    def numbers(self) -> np.ndarray:
        """What `distance` takes: start, end and radius."""
        return np.array([*self.start, *self.end, self.radius])

    @staticmethod
    def distance(numbers: ca.SX, place: ca.SX) -> ca.SX:
        """Distance from the axis less the radius [m] (Ericson 2005, section 5.1.2)."""
        start, axis = numbers[:3], numbers[3:6] - numbers[:3]
        share = ca.dot(place - start, axis) / ca.sumsqr(axis)
        nearest = start + ca.fmin(ca.fmax(share, 0), 1) * axis
        return _length(place - nearest) - numbers[6]

    def balls(self) -> Balls:
        """A ball at each end."""
        return Balls(np.stack([self.start, self.end]), self.radius)


@dataclass(frozen=True, eq=False)
class Box:
    """A block with rounded edges.

    Attributes:
        centre: shape (3,) [m].
        size: lengths of its edges, the rounding included, shape (3,), positive [m].
        orientation: its axes in the root's frame, shape (3, 3).
        rounding: radius of its edges, positive, at most half the shortest edge [m]; None: a tenth
            of it. The distance is smooth where it is larger than minus this.

    Raises:
        RobotError: a value is not finite or out of range.
    """

    centre: np.ndarray
    size: np.ndarray
    orientation: np.ndarray = field(default_factory=lambda: np.eye(3))
    rounding: float | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        size = checks.array("size", self.size, (3,))
        if not np.all(size > 0):
            raise RobotError("size", "three positive numbers", checks.shown(size))
        rounding = _ROUNDING * size.min() if self.rounding is None else self.rounding
        rounding = checks.number("rounding", rounding, positive=True)
        if rounding > size.min() / 2:
            raise RobotError("rounding", "at most half the shortest edge", rounding)
        set_fields(
            self,
            centre=checks.array("centre", self.centre, (3,)),
            size=size,
            orientation=checks.rotation("orientation", self.orientation),
            rounding=rounding,
        )

    @property
    def _core(self) -> np.ndarray:
        assert self.rounding is not None
        return self.size / 2 - self.rounding

    @property
    def numbers(self) -> np.ndarray:
        """What `distance` takes: centre, half the core's edges, rounding, axes by rows."""
        return np.concatenate([self.centre, self._core, [self.rounding], self.orientation.ravel()])

    @staticmethod
    def distance(numbers: ca.SX, place: ca.SX) -> ca.SX:
        """Distance from the core less the rounding; inside the core, from its nearest face [m]."""
        axes = ca.reshape(numbers[7:16], 3, 3)  # by columns: the transpose
        beyond = ca.fabs(ca.mtimes(axes, place - numbers[:3])) - numbers[3:6]
        inside = ca.fmin(ca.fmax(ca.fmax(beyond[0], beyond[1]), beyond[2]), 0)
        return _length(ca.fmax(beyond, 0)) + inside - numbers[6]

    def balls(self) -> Balls:
        """A ball at each corner of the core."""
        signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
        corners = self.centre + signs * self._core @ self.orientation.T
        assert self.rounding is not None
        return Balls(corners, self.rounding)


Shape: Any = HalfSpace | Sphere | Capsule | Box
SHAPES = (HalfSpace, Sphere, Capsule, Box)


def _length(v: ca.SX) -> ca.SX:
    return ca.sqrt(ca.sumsqr(v) + _TINY)


def towards(kind: Any, numbers: ca.SX, place: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Signed distance of a place from a shape [m] and its gradient, out of the shape."""
    symbol = ca.SX.sym("place", 3)
    distance = kind.distance(numbers, symbol)
    values = ca.substitute(
        [distance, ca.gradient(distance, symbol)], [symbol], [ca.densify(ca.SX(place))]
    )
    return values[0], values[1]
