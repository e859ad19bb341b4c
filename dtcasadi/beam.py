r"""Beams cut into segments: what `dtcasadi.tube` and `dtcasadi.rod` share.

A segment carries bending in axial springs, posts along the wall from disc to disc, and shear and
twist in diagonal springs that run round the wall from disc i to disc i+1. With the relative
rotation w and the shear angles g (thread against the mean of the discs' axes) of a segment of
length l, the stored energy is to second order

.. math:: \tfrac12 \left( \frac{EI}{l} (w_x^2 + w_y^2) + \frac{GJ}{l} w_z^2
          + GA\, l\, (g_x^2 + g_y^2) \right),

that of a Timoshenko beam with one point of integration (Hughes 2000, The Finite Element Method,
section 5.4): errors fall with the square of l. Posts alone give no shear and no twist stiffness.
Diagonals between the discs' rims would also stretch in bending, more than the whole tube does once
l exceeds about two radii. Their ends are therefore carried, on arms rigid with the discs, to the
middle of the segment, where bending moves nothing sideways.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from scipy.linalg import expm

from . import checks
from .errors import RobotError
from .parts import Disc, Spring, Thread

MAX_DISCS = 4096


class Wire(NamedTuple):
    """A spring without its number: ends on disc i and disc i+1 in their frames, [m] and [N/m]."""

    start: np.ndarray
    end: np.ndarray
    stiffness: float


class Segment(NamedTuple):
    """A piece of a beam between two discs, at rest.

    Attributes:
        length: of the beam's axis [m].
        angles: rest bend about x and y and twist of the disc frames over the segment, shape (3,)
            [rad]; the axis is a piece of a helix.
        centre: of the section in the disc's frame, shape (3,) [m]; the thread joins at the origin.
        turn: angle by which the thread is set round the section's centre at its start [rad].
    """

    length: float
    angles: np.ndarray
    centre: np.ndarray
    turn: float = 0.0

    def thread(self) -> Thread:
        """The thread from rim to rim, with the rest rotations A and B that make q = 0 the rest.

        Raises:
            RobotError: field `bend`: so much bend leaves the thread no length.
        """
        R, gap = self._next()
        if gap[2] <= 0:
            raise RobotError("bend", "a rest bend that leaves the fabric a length", self.angles)
        length = float(np.linalg.norm(gap))
        set_round = about_z(self.turn)
        lean = _shortest_turn(gap / length)
        bend, twist = set_round @ lean, lean.T @ R
        return Thread(length, self.centre - set_round @ self.centre, bend, twist)

    def arm(self, radius: float, hardening: float = 0.0) -> float:
        """How far posts on a circle about the thread stand over their discs [m].

        Posts between the discs themselves give a moment that goes with the sine of the bend w, an
        energy less by w^2 / 12. With arms a it is more by (a / radius)^2 / 8 of w^2, so that the
        moment can be linear to fifth order. Where the disc frames twist about the wall such arms
        would lean against each other.

        Args:
            radius: of the circle [m].
            hardening: what other springs add to the bending energy, of w^2.
        """
        return 0.0 if self.angles[2] else radius * math.sqrt(8 * (1 / 12 - hardening))

    def along(
        self, radius: float, start: float, end: float, stiffness: float, arm: float = 0.0
    ) -> Wire:
        """A spring from an angle on disc i to one on disc i+1, at a radius from their centres.

        Both are counted from the thread's side half-way along, so equal ones make a post that
        follows the wall where the disc frames twist about it. An arm puts either end that far
        beyond its disc.
        """
        half, reach = self.angles[2] / 2, np.array([0.0, 0.0, arm])
        point = self._before(self.centre + spoke(radius, start + half) - reach)
        return Wire(point, self.centre + spoke(radius, end - half) + reach, stiffness)

    def across(self, point: np.ndarray, along: np.ndarray, stiffness: float) -> Wire:
        """A spring in the plane half-way between the discs.

        Args:
            point: its middle, from the axis in the frame half-way, shape (3,) [m].
            along: from there to its end on disc i+1; the opposite end belongs to disc i.
            stiffness: [N/m].
        """
        R, gap = self._next()
        half_R, half_way = _helix(self.angles / 2, self.length / 2)
        start, end = (self.centre + half_way + half_R @ (point + k * along) for k in (-1, 1))
        return Wire(self._before(start), R.T @ (end - gap), stiffness)

    def _next(self) -> tuple[np.ndarray, np.ndarray]:
        """Frame i+1 at rest in frame i after its thread has been set round: rotation, origin."""
        R, way = _helix(self.angles, self.length)
        return R, self.centre + way - R @ self.centre

    def _before(self, point: np.ndarray) -> np.ndarray:
        """A point of frame i after its thread has been set round, in frame i itself."""
        return self.centre + about_z(self.turn) @ (point - self.centre)


class Cut(NamedTuple):
    """A beam in segments.

    Attributes:
        segments: from the root on.
        ends: number of the disc at which each of the parts in series ends.
    """

    segments: tuple[Segment, ...]
    ends: tuple[int, ...]

    @classmethod
    def of(
        cls,
        length: float,
        n_discs: int,
        centre: np.ndarray,
        angles: np.ndarray,
        turns: Sequence[float] = (0.0,),
    ) -> Self:
        """Equal parts in series, each in equal segments.

        Args:
            length: of the axis [m].
            n_discs: number of discs, the root included.
            centre: of the section in the disc's frame, shape (3,) [m].
            angles: rest bend about x and y and twist over the whole length, shape (3,) [rad].
            turns: for each part, by how much its thread is set round from where the one before
                ends [rad].

        Raises:
            RobotError: field `n_discs`: not an integer, or fewer segments than parts.
        """
        n_segments = checks.index("n_discs", n_discs, len(turns) + 1, MAX_DISCS) - 1
        segments: list[Segment] = []
        ends: list[int] = []
        for k, turn in enumerate(turns):
            mine = n_segments // len(turns) + (k < n_segments % len(turns))
            piece = Segment(length / len(turns) / mine, angles / len(turns) / mine, centre)
            segments += [piece._replace(turn=turn), *[piece] * (mine - 1)]
            ends.append(len(segments) + 1)
        return cls(tuple(segments), tuple(ends))

    def rings(
        self, mass_per_length: float, radius: float, payload: float, area: float
    ) -> tuple[Disc, ...]:
        """Hoops that carry the beam's mass: each half of both neighbouring segments.

        Equal masses would move the mass by half a segment, an error of first order.

        Args:
            mass_per_length: [kg/m].
            radius: of the hoops [m].
            payload: point mass at the centre of the last section [kg].
            area: what pressure acts on, round the section's centre [m^2].
        """
        halves = [0.0, *(segment.length / 2 for segment in self.segments), 0.0]
        centre, rings = self.segments[0].centre, []
        for before, after in zip(halves, halves[1:], strict=False):
            hoop = Disc.hoop(mass_per_length * (before + after), radius)
            last = payload if after == 0.0 else 0.0
            outline = hoop.outline - hoop.centroid + centre
            rings.append(
                Disc(hoop.mass + last, hoop.inertia, centre, area, centre, outline)  # thin hoops
            )
        return tuple(rings)


def ring(segment: Segment, radius: float, n: int, stiffness: float, span: float) -> list[Wire]:
    """N springs round the axis half-way along a segment, each tangent to a circle.

    Together they resist shear with n k / 2 per shift squared and twist with n k r^2. Neighbours
    lean opposite ways, so that the robot keeps the mirror symmetry of its section.

    Args:
        segment: where.
        radius: r, of the circle [m].
        n: how many, an even number.
        stiffness: k, of each [N/m].
        span: length of each [m].
    """
    wires = []
    for k in range(n):
        angle = 2 * math.pi * (k + 0.5) / n
        along = spoke(span / 2, angle + math.pi / 2) * (-1) ** k
        wires.append(segment.across(spoke(radius, angle), along, stiffness))
    return wires


def springs(wires: Iterable[Iterable[Wire]], retardation_time: float) -> tuple[Spring, ...]:
    """The wires of each segment as springs with the damping of a Kelvin-Voigt material."""
    return tuple(
        Spring((i, i + 1), *wire, damping=retardation_time * wire.stiffness)
        for i, mine in enumerate(wires, 1)
        for wire in mine
    )


def checked_rest(beam: Any) -> dict[str, Any]:
    """What tubes and rods have in common, cleaned: rest shape, payload, viscosity, gravity.

    Raises:
        RobotError: naming the field.
    """
    single = np.ndim(beam.bend) == 0
    bend = beam.bend if not single else (checks.number("bend", beam.bend), 0.0)
    fields: dict[str, Any] = {
        "bend": checks.array("bend", bend, (2,)),
        "twist": checks.number("twist", beam.twist),
        "up": checks.unit("up", beam.up),
    }
    for name in ("payload", "retardation_time", "gravity"):
        fields[name] = checks.number(name, getattr(beam, name), nonnegative=True)
    return fields


def spoke(radius: float, angle: float) -> np.ndarray:
    """From a section's centre to the wall at an angle from the thread's side, shape (3,) [m].

    The angle runs counterclockwise as seen from +z. Multiples of a right angle give exact zeros,
    so that a symmetric robot is exactly symmetric.
    """
    sine, cosine = math.sin(angle), math.cos(angle)
    if min(abs(sine), abs(cosine)) < 1e-12:
        sine, cosine = float(round(sine)), float(round(cosine))
    return np.array([radius * sine, -radius * cosine, 0.0])


def about_z(angle: float) -> np.ndarray:
    """Rotation about z, shape (3, 3)."""
    x, y, _ = spoke(1.0, angle)
    return np.array([[-y, -x, 0.0], [x, -y, 0.0], [0.0, 0.0, 1.0]])


def _helix(angles: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and displacement along an axis of constant curvature and twist."""
    x, y, z = angles
    rates = np.array([[0, -z, y, 0], [z, 0, -x, 0], [-y, x, 0, length], [0, 0, 0, 0]], dtype=float)
    motion = expm(rates)
    return motion[:3, :3], motion[:3, 3]


def _shortest_turn(direction: np.ndarray) -> np.ndarray:
    """The rotation from z to a unit vector on its side, about the axis normal to both."""
    x, y, z = direction
    k = 1 / (1 + z)
    return np.array([[1 - k * x * x, -k * x * y, x], [-k * x * y, 1 - k * y * y, y], [-x, -y, z]])
