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

    Disc frames follow the wall, not a fabric that winds round it. The frame half-way is the wall's
    in the middle of the axis.

    Attributes:
        length: of the beam's axis [m].
        R: frame i+1 in frame i, shape (3, 3).
        way: from the section's centre of disc i to that of disc i+1, in frame i, shape (3,) [m].
        half_R: the frame half-way in frame i.
        half_way: its origin from the centre of disc i, in frame i.
        root: centre of disc i from where the thread joins it, shape (3,) [m].
        leave: the same from where the outgoing thread leaves it.
        reach: centre of disc i+1 from where the thread joins it, in frame i+1.
        side: angle of the fabric round the axis half-way [rad].
        winding: by how much the fabric winds round the wall [rad].
    """

    length: float
    R: np.ndarray
    way: np.ndarray
    half_R: np.ndarray
    half_way: np.ndarray
    root: np.ndarray
    leave: np.ndarray
    reach: np.ndarray
    side: float
    winding: float

    def thread(self) -> Thread:
        """The thread from rim to rim, with the rest rotations A and B that make q = 0 the rest.

        Raises:
            RobotError: field `bend`: so much bend leaves the thread no length.
        """
        gap = self.leave + self.way - self.R @ self.reach
        if gap[2] <= 0:
            raise RobotError("bend", "a rest bend that leaves the fabric a length", self.length)
        length = float(np.linalg.norm(gap))
        lean = _shortest_turn(gap / length)
        return Thread(length, self.root - self.leave, lean, lean.T @ self.R)

    def along(
        self, radius: float, start: float, end: float, stiffness: float, arm: float = 0.0
    ) -> Wire:
        """A spring from an angle round disc i to one round disc i+1, at a radius from the axis.

        Angles count from the fabric's side half-way. An arm puts either end that far beyond its
        disc.
        """
        over = np.array([0.0, 0.0, arm])
        point = self.root + spoke(radius, self.side + start) - over
        return Wire(point, self.reach + spoke(radius, self.side + end) + over, stiffness)

    def arm(self, radius: float, hardening: float = 0.0) -> float:
        """How far posts on a circle about the thread stand over their discs [m].

        Posts between the discs themselves give a moment that goes with the sine of the bend w, an
        energy less by w^2 / 12. With arms a it is more by (a / radius)^2 / 8 of w^2, so that the
        moment can be linear to fifth order. Where a rest bend turns round the wall such arms would
        lean against each other.

        Args:
            radius: of the circle [m].
            hardening: what other springs add to the bending energy, of w^2.
        """
        return 0.0 if self.winding else radius * math.sqrt(8 * (1 / 12 - hardening))

    def across(self, radius: float, angle: float, span: float, stiffness: float) -> Wire:
        """A spring in the plane half-way between the discs, its ends on arms of either disc.

        Args:
            radius: of the circle round the axis that it touches [m].
            angle: where it does, from the fabric's side [rad].
            span: its length [m]; negative: from disc i it runs the other way round.
            stiffness: [N/m].
        """
        middle = spoke(radius, self.side + angle)
        along = spoke(span / 2, self.side + angle + math.pi / 2)
        start, end = (self.half_way + self.half_R @ (middle + k * along) for k in (-1, 1))
        return Wire(self.root + start, self.reach + self.R.T @ (end - self.way), stiffness)


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
        offset: float,
        angles: np.ndarray,
        turns: Sequence[float] = (0.0,),
    ) -> Self:
        """Equal parts in series, each in equal segments.

        Args:
            length: of the axis [m].
            n_discs: number of discs, the root included.
            offset: of the fabric from the axis [m].
            angles: rest bend about x and y, in a frame that winds with the fabric, and the
                fabric's winding over the whole length, shape (3,) [rad].
            turns: for each part, by how much its fabric is set round from where the one before
                ends [rad].

        Raises:
            RobotError: field `n_discs`: not an integer, or fewer segments than parts.
        """
        n_segments = checks.index("n_discs", n_discs, len(turns) + 1, MAX_DISCS) - 1
        segments: list[Segment] = []
        ends: list[int] = []
        side, root = 0.0, -spoke(offset, 0.0)
        for k, turn in enumerate(turns):
            mine = n_segments // len(turns) + (k < n_segments % len(turns))
            share = 1 / len(turns) / mine
            side += turn
            for _ in range(mine):
                piece = _piece(length * share, angles * share, side, offset, root)
                segments.append(piece)
                side, root = side + angles[2] * share, piece.reach
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
        centres = [self.segments[0].root, *(segment.reach for segment in self.segments)]
        rings = []
        for before, after, centre in zip(halves, halves[1:], centres, strict=False):
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
    step = 2 * math.pi / n
    return [segment.across(radius, (k + 0.5) * step, span * (-1) ** k, stiffness) for k in range(n)]


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


def _piece(
    length: float, angles: np.ndarray, side: float, offset: float, root: np.ndarray
) -> Segment:
    """The segment that starts with the fabric at an angle `side` round the axis."""

    def wall(share: float) -> tuple[np.ndarray, np.ndarray]:
        turn, way = _helix(angles * share, length * share)
        start, end = about_z(side), about_z(side + angles[2] * share)
        return start @ turn @ end.T, start @ way

    R, way = wall(1.0)
    half_R, half_way = wall(0.5)
    return Segment(
        length=length,
        R=R,
        way=way,
        half_R=half_R,
        half_way=half_way,
        root=root,
        leave=-spoke(offset, side),
        reach=-spoke(offset, side + angles[2]),
        side=side + angles[2] / 2,
        winding=float(angles[2]),
    )


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
