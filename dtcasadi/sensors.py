"""What is measured on a robot: sensors as frozen values, read by the recursions of the dynamics.

    y = h(q, qd, qdd, pressure) + bias + noise

A sensor is placed on a disc by its number (1 is the root) and points in that disc's frame: origin
where the thread joins it, y to the centre, z axial. Each has a name, noise, the time between its
samples, how late these arrive, and the share that gets lost. `model.discrete(..., sensors=(...))`
turns them into Functions with derivatives (`dtcasadi.measuring.Sensor`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from . import checks
from .contact.detect import candidates_of
from .errors import ModelError
from .kernels.axes import cross
from .robot import Robot
from .sampled import Sampled, Seen

AXES = ("x", "y", "z")


@dataclass(frozen=True, eq=False, kw_only=True)
class PressureSensor(Sampled):
    """Pressure of chambers [Pa].

    Attributes:
        chambers: their numbers, from 1.
    """

    chambers: Sequence[int] = (1,)

    def check(self, robot: Robot) -> None:
        """Raise ModelError if the robot lacks a chamber."""
        for chamber in self.chambers:
            checks.index("chambers", chamber, 1, len(robot.chambers), error=self._refuse)

    @property
    def channels(self) -> tuple[tuple[str, str], ...]:
        """One for each chamber."""
        return tuple((f"p{k}", "Pa") for k in self.chambers)

    def reading(self, seen: Seen) -> ca.SX:
        """The pressures."""
        return ca.vertcat(*(seen.pressure[k - 1] for k in self.chambers))


@dataclass(frozen=True, eq=False, kw_only=True)
class IMU(Sampled):
    r"""Gyroscope and accelerometer on a disc, along the chip's axes C (chip to disc).

    .. math:: y_g = C^T \omega + b_g,\quad
        y_a = C^T (a - g + \alpha \times s + \omega \times (\omega \times s)) + b_a

    With s the chip's place, omega, alpha, a the motion of the disc's frame in its own axes
    (Groves, Principles of GNSS, Inertial and Multisensor Navigation, section 4.4).

    Attributes:
        disc: the disc.
        position: s, in the disc's frame [m].
        orientation: C, shape (3, 3).
        biases: whether b_g, b_a are in theta, block `<name>.bias` (6), for a filter to estimate.
        noise: one number for all, or gyroscope [rad/s] and accelerometer [m/s^2], three each.
    """

    disc: int
    position: Any = (0.0, 0.0, 0.0)
    orientation: Any = field(default_factory=lambda: np.eye(3))
    biases: bool = False

    def __post_init__(self) -> None:
        """Check every field."""
        super().__post_init__()
        rotation = checks.rotation("orientation", self.orientation, error=self._refuse)
        self._set(position=self._point("position", self.position), orientation=rotation)

    def check(self, robot: Robot) -> None:
        """Raise ModelError if the robot lacks the disc, or feels impulses instead of forces."""
        super().check(robot)
        if candidates_of(robot) is not None:
            expected = "obstacles with a penetration, as it would feel impulses without"
            raise self._refuse("robot", expected, "rigid contact")

    @property
    def channels(self) -> tuple[tuple[str, str], ...]:
        """Gyroscope, then accelerometer."""
        kinds = (("g", "rad/s"), ("a", "m/s^2"))
        return tuple((kind + axis, unit) for kind, unit in kinds for axis in AXES)

    @property
    def discs(self) -> tuple[int, ...]:
        """Its disc."""
        return (self.disc,)

    @property
    def n_bias(self) -> int:
        """All six, or none."""
        return 6 if self.biases else 0

    def reading(self, seen: Seen) -> ca.SX:
        """Angular rate and specific force."""
        where = (ca.DM(self.orientation), ca.DM(self.position))
        motion = (seen.rate(self.disc), *seen.acceleration(self.disc))
        return seen.chain.asm.call(felt_by_chip, *where, *motion)


@dataclass(frozen=True, eq=False, kw_only=True)
class Marker(Sampled):
    """Place of a point of a disc in the root frame [m].

    Attributes:
        disc: the disc.
        point: in the disc's frame [m].
    """

    disc: int
    point: Any = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check every field."""
        super().__post_init__()
        self._set(point=self._point("point", self.point))

    @property
    def channels(self) -> tuple[tuple[str, str], ...]:
        """Along the root's axes."""
        return tuple((axis, "m") for axis in AXES)

    @property
    def discs(self) -> tuple[int, ...]:
        """Its disc."""
        return (self.disc,)

    def reading(self, seen: Seen) -> ca.SX:
        """The place."""
        return seen.chain.asm.call(place_of, *seen.pose(self.disc), ca.DM(self.point))


@dataclass(frozen=True, eq=False, kw_only=True)
class Orientation(Sampled):
    r"""Rotation matrix of a disc in the root frame, column by column.

    Nine numbers have no singularity and no jump. A turn by a small phi changes R by R [phi]x, so
    each axis of phi enters with weight two: R_v = 2 noise^2 I carries just the information of
    noise [rad] about each axis.

    Attributes:
        disc: the disc.
        noise: about each axis [rad].
    """

    disc: int

    @property
    def channels(self) -> tuple[tuple[str, str], ...]:
        """R11, R21, ..., R33."""
        return tuple((f"r{row}{column}", "") for column in (1, 2, 3) for row in (1, 2, 3))

    @property
    def discs(self) -> tuple[int, ...]:
        """Its disc."""
        return (self.disc,)

    @property
    def R_v(self) -> np.ndarray:
        """Twice the variance of the angles, shape (9, 9)."""
        return 2 * super().R_v

    def reading(self, seen: Seen) -> ca.SX:
        """The matrix as a column."""
        return ca.reshape(seen.pose(self.disc)[0], 9, 1)


@dataclass(frozen=True, eq=False, kw_only=True)
class Bend(Sampled):
    r"""How far a disc is turned from the root, about the root's x and y axes [rad].

    .. math:: y_x = atan2(-z_2, z_3), \quad y_y = atan2(z_1, z_3)

    With z the disc's axis in the root frame. In the plane of y and z the first is the sum of all
    angles up to the disc, between -pi and pi.

    Attributes:
        disc: the disc.
    """

    disc: int

    @property
    def channels(self) -> tuple[tuple[str, str], ...]:
        """About x, about y."""
        return (("x", "rad"), ("y", "rad"))

    @property
    def discs(self) -> tuple[int, ...]:
        """Its disc."""
        return (self.disc,)

    def reading(self, seen: Seen) -> ca.SX:
        """The angles."""
        return seen.chain.asm.call(bend_of, seen.pose(self.disc)[0])


@dataclass(frozen=True, eq=False, kw_only=True)
class Coordinates(Sampled):
    """Generalized coordinates themselves, in the chart and about the centres in force [rad].

    Attributes:
        numbers: which, from 1.
    """

    numbers: Sequence[int] = (1,)

    @property
    def channels(self) -> tuple[tuple[str, str], ...]:
        """One for each."""
        return tuple((f"q{k}", "rad") for k in self.numbers)

    def reading(self, seen: Seen) -> ca.SX:
        """The coordinates."""
        for number in self.numbers:
            checks.index("numbers", number, 1, seen.q.shape[0], error=self._refuse)
        return ca.vertcat(*(seen.q[k - 1] for k in self.numbers))


@dataclass(frozen=True, eq=False, kw_only=True)
class Lengths(Sampled):
    """Distances between points on discs [m]: string potentiometers, springs.

    Attributes:
        spans: ((disc, point), (disc, point)) of each, points in the discs' frames [m].
    """

    spans: Any

    def __post_init__(self) -> None:
        """Check every field."""
        try:
            spans = tuple(
                tuple((disc, self._point("spans", point)) for disc, point in (start, end))
                for start, end in self.spans
            )
        except (TypeError, ValueError) as error:
            if isinstance(error, ModelError):
                raise
            expected = "((disc, point), (disc, point)) of each"
            raise self._refuse("spans", expected, checks.shown(self.spans)) from None
        self._set(spans=spans)
        super().__post_init__()

    @property
    def channels(self) -> tuple[tuple[str, str], ...]:
        """One for each span."""
        return tuple((f"l{k}", "m") for k in range(1, len(self.spans) + 1))

    @property
    def discs(self) -> tuple[int, ...]:
        """All it joins."""
        return tuple(disc for span in self.spans for disc, _ in span)

    def reading(self, seen: Seen) -> ca.SX:
        """The distances."""
        lengths = []
        for span in self.spans:
            ends = [(*seen.pose(disc), ca.DM(point)) for disc, point in span]
            lengths.append(seen.chain.asm.call(distance_of, *ends[0], *ends[1]))
        return ca.vertcat(*lengths)


def felt_by_chip(C: ca.SX, position: ca.SX, w: ca.SX, alpha: ca.SX, a: ca.SX) -> ca.SX:
    """Angular rate and specific force along the chip's axes, shape (6, 1)."""
    force = a + cross(alpha, position) + cross(w, cross(w, position))
    return ca.vertcat(ca.mtimes(C.T, w), ca.mtimes(C.T, force))


def place_of(R: ca.SX, r: ca.SX, point: ca.SX) -> ca.SX:
    """A disc's point in the root frame, shape (3, 1)."""
    return r + ca.mtimes(R, point)


def bend_of(R: ca.SX) -> ca.SX:
    """Angles of a disc's axis about x and y, shape (2, 1)."""
    return ca.vertcat(ca.atan2(-R[1, 2], R[2, 2]), ca.atan2(R[0, 2], R[2, 2]))


def distance_of(R1: ca.SX, r1: ca.SX, point1: ca.SX, R2: ca.SX, r2: ca.SX, point2: ca.SX) -> ca.SX:
    """Distance of two points; smoothed within 1e-12 of zero, where it has no slope."""
    return ca.sqrt(ca.sumsqr(place_of(R2, r2, point2) - place_of(R1, r1, point1)) + 1e-24)
