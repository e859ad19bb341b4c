"""What a robot is made of, as frozen numbers: disc, thread, spring, chamber, damping.

Frames and numbering: `dtcasadi.robot`. Each part is checked at its construction.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from . import checks
from .errors import RobotError
from .polygon import polygon_moments


def set_fields(obj: object, **values: object) -> None:
    """Store checked values in a frozen dataclass, from its `__post_init__` only."""
    for name, value in values.items():
        object.__setattr__(obj, name, value)


@dataclass(frozen=True, eq=False)
class Disc:
    """One rigid disc.

    Attributes:
        mass: mass [kg], positive.
        inertia: inertia tensor about the centre of mass in the disc's frame, shape (3, 3) [kg m^2].
        centre_of_mass: position in the disc's frame, shape (3,) [m].
        area: area the chamber pressure acts on [m^2].
        centroid: centroid of that area in the disc's frame, shape (3,) [m].
        outline: vertices of the rim in the disc's frame, shape (n, 3) [m], for drawing.

    Raises:
        RobotError: a value is not finite, the mass is not positive, or the tensor belongs to no
            rigid body (symmetric, positive definite, each principal moment at most the sum of the
            other two; Goldstein, Classical Mechanics, section 5.3).
    """

    mass: float
    inertia: np.ndarray
    centre_of_mass: np.ndarray = field(default_factory=lambda: np.zeros(3))
    area: float = 0.0
    centroid: np.ndarray = field(default_factory=lambda: np.zeros(3))
    outline: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        """Check every field."""
        set_fields(
            self,
            mass=checks.number("mass", self.mass, positive=True),
            inertia=checks.tensor("inertia", self.inertia),
            centre_of_mass=checks.array("centre_of_mass", self.centre_of_mass, (3,)),
            area=checks.number("area", self.area, nonnegative=True),
            centroid=checks.array("centroid", self.centroid, (3,)),
            outline=checks.array("outline", self.outline, (None, 3)),
        )

    @classmethod
    def hoop(cls, mass: float, radius: float) -> Self:
        """Thin circular hoop joined at its rim, centre at radius * y.

        I_zz = m r^2, I_xx = I_yy = m r^2 / 2. Its pressure area is the disc pi r^2 it encloses.
        """
        return cls._circle(mass, radius, 1.0)

    @classmethod
    def solid(cls, mass: float, radius: float) -> Self:
        """Thin uniform disc joined at its rim, centre at radius * y; I_zz = m r^2 / 2."""
        return cls._circle(mass, radius, 0.5)

    @classmethod
    def _circle(cls, mass: float, radius: float, share: float) -> Self:
        mass = checks.number("mass", mass, positive=True)
        radius = checks.number("radius", radius, positive=True)
        axial = share * mass * radius**2
        angles = np.linspace(0.0, 2 * np.pi, 33)[:-1]
        centre = np.array([0.0, radius, 0.0])
        rim = np.column_stack([np.sin(angles), -np.cos(angles), 0 * angles])
        return cls(
            mass,
            np.diag([axial / 2, axial / 2, axial]),
            centre,
            np.pi * radius**2,
            centre,
            centre + radius * rim,
        )

    @classmethod
    def polygon(cls, mass: float, vertices: Sequence[Sequence[float]]) -> Self:
        """Thin uniform plate with a simple polygon as outline.

        Args:
            mass: mass [kg].
            vertices: corners in the disc's x-y plane, shape (n, 2), n >= 3 [m], either direction.

        Raises:
            RobotError: fewer than three vertices, edges that cross, or no enclosed area.
        """
        mass = checks.number("mass", mass, positive=True)
        corners = checks.array("vertices", vertices, (None, 2))
        plate = polygon_moments(corners)
        xx, yy, xy = plate.xx, plate.yy, plate.xy
        inertia = mass * np.array([[xx, -xy, 0.0], [-xy, yy, 0.0], [0.0, 0.0, xx + yy]])
        centre = np.array([*plate.centroid, 0.0])
        rim = np.column_stack([corners, np.zeros(len(corners))])
        return cls(mass, inertia, centre, plate.area, centre, rim)


@dataclass(frozen=True, eq=False)
class Thread:
    """The inextensible thread of segment i.

    Attributes:
        length: l_i [m], positive.
        exit_point: s_i, where the thread leaves disc i, in frame i, shape (3,) [m]; zero for a
            continuous strip.
        bend: A_i, rest rotation before the thread's angles, shape (3, 3).
        twist: B_i, rest rotation between thread and disc i+1, shape (3, 3).
    """

    length: float
    exit_point: np.ndarray = field(default_factory=lambda: np.zeros(3))
    bend: np.ndarray = field(default_factory=lambda: np.eye(3))
    twist: np.ndarray = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        """Check every field."""
        set_fields(
            self,
            length=checks.number("length", self.length, positive=True),
            exit_point=checks.array("exit_point", self.exit_point, (3,)),
            bend=checks.rotation("bend", self.bend),
            twist=checks.rotation("twist", self.twist),
        )


def rest_gap(thread: Thread, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Way from a point of disc i to one of disc i+1 in the rest pose, all coordinates zero."""
    origin = thread.exit_point + thread.length * thread.bend[:, 2]
    return origin + thread.bend @ thread.twist @ end - start


@dataclass(frozen=True, eq=False)
class Spring:
    """A straight spring and damper between a point on disc i and a point on disc i+1.

    Attributes:
        discs: (i, i + 1), the pair it joins.
        start: its end on disc i, in frame i, shape (3,) [m].
        end: its end on disc i+1, in frame i+1, shape (3,) [m].
        stiffness: [N/m], not negative.
        rest_length: length without force [m]; None: its length in the robot's rest pose.
        damping: force per rate of its length [N s/m], not negative.
    """

    discs: tuple[int, int]
    start: np.ndarray
    end: np.ndarray
    stiffness: float
    rest_length: float | None = None
    damping: float = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        rest = self.rest_length
        if rest is not None:
            rest = checks.number("rest_length", rest, nonnegative=True)
        set_fields(
            self,
            discs=checks.neighbours("discs", self.discs),
            start=checks.array("start", self.start, (3,)),
            end=checks.array("end", self.end, (3,)),
            stiffness=checks.number("stiffness", self.stiffness, nonnegative=True),
            rest_length=rest,
            damping=checks.number("damping", self.damping, nonnegative=True),
        )


@dataclass(frozen=True, eq=False)
class Chamber:
    """An inflatable chamber spanning neighbouring discs.

    Attributes:
        discs: (first, last) disc it spans.
        areas: area it presses on at each disc from first to last, shape (n,) [m^2]; None: the
            discs' own areas.
        centroids: centroid of that area in each disc's frame, shape (n, 3) [m]; None: the discs'.
        radial_compliance: growth of the pressed outline by pressure: c in scale = 1 + c pressure
            of its lengths from the frame's origin, not negative [1/Pa]. Springs and masses keep
            their places.
        rated_pressure: gauge pressure above which a simulation warns [Pa]; None: never.
    """

    discs: tuple[int, int]
    areas: np.ndarray | None = None
    centroids: np.ndarray | None = None
    radial_compliance: float = 0.0
    rated_pressure: float | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        if not isinstance(self.discs, Sequence) or len(self.discs) != 2:
            raise RobotError("discs", "the first and last disc number", checks.shown(self.discs))
        first, last = (checks.index("discs", d, 1, 10**6) for d in self.discs)
        if last <= first:
            raise RobotError("discs", "first < last", (first, last))
        n = last - first + 1
        compliance = checks.number("radial_compliance", self.radial_compliance, nonnegative=True)
        set_fields(self, discs=(first, last), radial_compliance=compliance)
        if self.areas is not None:
            areas = checks.array("areas", self.areas, (n,))
            if np.any(areas < 0):
                raise RobotError("areas", "non-negative numbers", checks.shown(areas))
            set_fields(self, areas=areas)
        if self.centroids is not None:
            set_fields(self, centroids=checks.array("centroids", self.centroids, (n, 3)))
        if self.rated_pressure is not None:
            rated = checks.number("rated_pressure", self.rated_pressure, positive=True)
            set_fields(self, rated_pressure=rated)


@dataclass(frozen=True, eq=False)
class Damping:
    """Damping of one segment, [N m s/rad] each, not negative.

    Attributes:
        c_a: resists the thread's direction rate seen from disc i.
        c_b: resists the thread's direction rate seen from disc i+1.
        c_w: resists the discs' relative spin about the thread.
        c_r: resists the discs' relative angular velocity.
    """

    c_a: float = 0.0
    c_b: float = 0.0
    c_w: float = 0.0
    c_r: float = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        for name in ("c_a", "c_b", "c_w", "c_r"):
            set_fields(self, **{name: checks.number(name, getattr(self, name), nonnegative=True)})
