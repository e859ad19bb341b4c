r"""Robots from a tube's dimensions and material.

Thin wall, mid-surface radius r, thickness t, length L; sections stay plane and round, as rigid
discs do (Gere and Timoshenko, Mechanics of Materials, sections 3.10 and 5.5):

.. math:: EA = 2\pi E r t,\quad EI = \pi E r^3 t,\quad GA_s = \pi G r t,\quad GJ = 2\pi G r^3 t,
          \quad G = \frac{E}{2 (1 + \nu)},\quad \mu = 2\pi r t \rho

The shear area is half the section's: the wall's shear at an angle is the section's times its sine.
Fabric on the wall cannot stretch, so the tube bends about it: 3 pi E r^3 t in the plane through
fabric and axis, pi E r^3 t across. A pressure p gives it the moment p pi r^3 and so the curvature
p / (3 E t), with `last_disc` as long as the bend is small against r / L.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import checks
from .beam import Cut, Segment, Wire, checked_rest, ring, springs
from .errors import RobotError
from .parts import Chamber, set_fields
from .robot import STANDARD_GRAVITY, Robot

FABRICS = ("strip", "axis")
MAX_POSTS = 64
# Length of the ring's springs about a strip, in radii. With it the ring's stiffening in a large
# bend about the fabric makes up for the posts', whose moment goes with the sine of the angle: at
# a Poisson's ratio of 0.5 the moment is linear to third order.
_STRIP_SPAN = 1.5


@dataclass(frozen=True, eq=False)
class Tube:
    """A tube before it is cut into discs; see `Robot.from_tube` for every field."""

    length: float
    radius: float
    wall_thickness: float
    youngs_modulus: float
    poissons_ratio: float
    density: float
    fabric: str = "strip"
    payload: float = 0.0
    bend: float | Sequence[float] | np.ndarray = 0.0
    twist: float = 0.0
    chambers: int = 1
    strip_turns: Sequence[float] = ()
    rated_pressure: float | None = None
    radial_compliance: float = 0.0
    retardation_time: float = 0.0
    posts: int = 4
    up: Sequence[float] | np.ndarray = (0.0, 1.0, 0.0)
    gravity: float = STANDARD_GRAVITY

    def __post_init__(self) -> None:
        """Check every field."""
        for name in ("length", "radius", "wall_thickness", "youngs_modulus", "density"):
            set_fields(self, **{name: checks.number(name, getattr(self, name), positive=True)})
        if self.wall_thickness > self.radius:
            raise RobotError("wall_thickness", "at most the radius", self.wall_thickness)
        ratio = checks.number("poissons_ratio", self.poissons_ratio)
        if not -1 < ratio <= 0.5:
            raise RobotError("poissons_ratio", "a number above -1, at most 0.5", ratio)
        if self.fabric not in FABRICS:
            raise RobotError("fabric", " or ".join(FABRICS), checks.shown(self.fabric))
        n_chambers = checks.index("chambers", self.chambers, 0, 256)
        posts = checks.index("posts", self.posts, 4, MAX_POSTS)
        if posts % 2:  # the diagonals between them lean left and right in turn
            raise RobotError("posts", "an even number", posts)
        turns = checks.array("strip_turns", np.asarray(self.strip_turns, dtype=float), (None,))
        if len(turns) not in (0, max(n_chambers - 1, 0)):
            expected = f"one for each of the {n_chambers} chambers but the first"
            raise RobotError("strip_turns", expected, checks.shown(turns))
        set_fields(
            self,
            poissons_ratio=ratio,
            chambers=n_chambers,
            posts=posts,
            strip_turns=tuple(turns.tolist()) or (0.0,) * max(n_chambers - 1, 0),
            **checked_rest(self),
        )

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + nu)) [Pa]."""
        return self.youngs_modulus / (2 * (1 + self.poissons_ratio))

    @property
    def mass_per_length(self) -> float:
        """2 pi r t rho [kg/m]."""
        return 2 * math.pi * self.radius * self.wall_thickness * self.density

    def robot(self, n_discs: int) -> Robot:
        """The tube as a robot of so many discs, the root included.

        Raises:
            RobotError: field `n_discs`: fewer than one segment for each chamber.
        """
        offset = self.radius if self.fabric == "strip" else 0.0
        cut = Cut.of(
            self.length,
            n_discs,
            offset,
            np.append(self.bend, self.twist),
            (0.0, *self.strip_turns),
        )
        area = math.pi * self.radius**2
        pressed: dict[str, Any] = {
            "rated_pressure": self.rated_pressure,
            "radial_compliance": self.radial_compliance,
        }
        return Robot(
            discs=cut.rings(self.mass_per_length, self.radius, self.payload, area),
            threads=tuple(segment.thread() for segment in cut.segments),
            springs=springs(map(self._wires, cut.segments), self.retardation_time),
            chambers=tuple(
                Chamber((first, last), **pressed)
                for first, last in zip((1, *cut.ends), cut.ends, strict=False)
            )[: self.chambers],
            up=np.asarray(self.up),
            gravity=self.gravity,
        )

    def _wires(self, segment: Segment) -> list[Wire]:
        """Posts with EA / l in all, and between them springs round the wall with G pi r t / l."""
        n, r = self.posts, self.radius
        wall = math.pi * r * self.wall_thickness / segment.length
        step = 2 * math.pi / n
        stiffness = 2 * self.youngs_modulus * wall / n
        strip = self.fabric == "strip"
        # A post along the fabric would never change its length; one across a wound strip does.
        angles = [k * step for k in range(1 if strip and not segment.winding else 0, n)]
        arm = 0.0 if strip else segment.arm(r)
        posts = [segment.along(r, angle, angle, stiffness, arm) for angle in angles]
        span = _STRIP_SPAN * r if strip else 2 * r
        return posts + ring(segment, r, n, 2 * self.shear_modulus * wall / n, span)
