"""Robots from the stiffnesses of a rod, the thread on its axis."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from . import checks
from .beam import Cut, Segment, Wire, checked_rest, ring, springs
from .errors import RobotError
from .parts import Chamber, set_fields
from .robot import STANDARD_GRAVITY, Robot

# A ring of springs for the twist must not be small against the segment: at a bend of w its plane
# opens by w^2 l / 8, which has to remain short against the springs.
_RING_OVER_LENGTH = 1 / 2


@dataclass(frozen=True, eq=False)
class Cell:
    """A chamber beside a rod's axis, over its whole length.

    Attributes:
        area: what the pressure acts on [m^2].
        centroid: (x, y) of that area from the axis [m].
        rated_pressure: see `dtcasadi.parts.Chamber`.
    """

    area: float
    centroid: Sequence[float]
    rated_pressure: float | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        centroid = checks.array("centroid", self.centroid, (2,))
        area = checks.number("area", self.area, positive=True)
        set_fields(self, area=area, centroid=centroid)

    def chamber(self, n_discs: int) -> Chamber:
        """The chamber on so many discs."""
        points = np.tile([*self.centroid, 0.0], (n_discs, 1))
        areas = np.full(n_discs, self.area)
        return Chamber((1, n_discs), areas, points, rated_pressure=self.rated_pressure)


@dataclass(frozen=True, eq=False)
class Rod:
    """A rod before it is cut into discs; see `Robot.from_rod` for every field."""

    length: float
    EI: float
    GA: float
    GJ: float
    mass_per_length: float
    payload: float = 0.0
    bend: float | Sequence[float] | np.ndarray = 0.0
    twist: float = 0.0
    cells: Sequence[Cell] = ()
    retardation_time: float = 0.0
    radius: float | None = None
    up: Sequence[float] | np.ndarray = (0.0, 1.0, 0.0)
    gravity: float = STANDARD_GRAVITY

    def __post_init__(self) -> None:
        """Check every field."""
        for name in ("length", "EI", "GA", "GJ", "mass_per_length"):
            set_fields(self, **{name: checks.number(name, getattr(self, name), positive=True)})
        radius = math.sqrt(self.GJ / (2 * self.GA)) if self.radius is None else self.radius
        for number, cell in enumerate(self.cells, 1):
            if not isinstance(cell, Cell):
                raise RobotError(f"cells[{number}]", "a Cell", checks.shown(cell))
        set_fields(
            self,
            radius=checks.number("radius", radius, positive=True),
            **checked_rest(self),
            cells=tuple(self.cells),
        )

    def robot(self, n_discs: int) -> Robot:
        """The rod as a robot of so many discs, the root included.

        Raises:
            RobotError: field `n_discs`: not an integer from 2 on.
        """
        radius = self.radius or 0.0
        cut = Cut.of(self.length, n_discs, 0.0, np.append(self.bend, self.twist))
        return Robot(
            discs=cut.rings(self.mass_per_length, radius, self.payload, math.pi * radius**2),
            threads=tuple(segment.thread() for segment in cut.segments),
            springs=springs(map(self._wires, cut.segments), self.retardation_time),
            chambers=tuple(cell.chamber(n_discs) for cell in self.cells),
            up=np.asarray(self.up),
            gravity=self.gravity,
        )

    def _wires(self, segment: Segment) -> list[Wire]:
        """Posts for EI; a ring for GJ; for what the ring leaves of GA, crossed diagonals."""
        length, n = segment.length, 4
        radius = math.sqrt(self.GJ / (2 * self.GA))
        angles = [k * math.pi / 2 for k in range(n)]
        across = max(radius, _RING_OVER_LENGTH * length)
        ring_GA = self.GJ / (2 * across**2)
        rest_GA = self.GA - ring_GA
        post = 2 * self.EI / (length * n * radius**2)
        # Crossed diagonals of width c come closer in bending, which adds GA c^2 w^2 / (64 EI) to
        # its energy: with c^2 = EI / GA 1/64, for which the posts' arms are that much shorter.
        arm = segment.arm(radius, 1 / 64 if rest_GA > 0 else 0.0)
        wires = [segment.along(radius, angle, angle, post, arm) for angle in angles]
        wires += ring(segment, across, n, 2 * ring_GA / (n * length), 2 * across)
        if rest_GA > 0:
            width = math.sqrt(self.EI / rest_GA)
            stiffness = rest_GA * (length**2 + width**2) / (2 * length * width**2)
            for angle in angles:
                wires.append(segment.along(width / 2, angle, angle + math.pi, stiffness))
        return wires
