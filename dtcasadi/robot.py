"""The robot as frozen numbers: discs, threads, springs, chambers and damping.

Discs are numbered 1..n_discs as in the paper; disc 1 is the fixed root. Segment i joins disc i to
disc i+1. Frame i has its origin where the thread joins disc i, y radial to the disc's centre, x
tangent, z axial. Everything is checked once, here and in `dtcasadi.parts`; the physics below holds
no checks.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from . import checks
from .constraints.values import Constraint
from .contact.obstacle import Obstacle
from .contact.plates import Plates
from .errors import RobotError
from .forces.protocol import Force
from .forces.traits import check
from .parts import Chamber, Damping, Disc, Spring, Thread, rest_gap, set_fields

STANDARD_GRAVITY = 9.81


def _items(name: str, values: Any, kind: Any) -> tuple[Any, ...]:
    """The values as a tuple, each of the kind."""
    try:
        result = tuple(values)
    except TypeError:
        raise RobotError(name, f"a sequence of {_title(kind)}", checks.shown(values)) from None
    for number, value in enumerate(result, 1):
        if not isinstance(value, kind):
            raise RobotError(f"{name}[{number}]", f"a {_title(kind)}", checks.shown(value))
    return result


def _title(kind: Any) -> str:
    return getattr(kind, "__name__", "Constraint")


@dataclass(frozen=True, eq=False)
class Robot:
    """A chain of discs and threads; see the module docstring for frames and numbering.

    Attributes:
        discs: n_discs >= 2 discs, the first one fixed.
        threads: n_discs - 1 threads.
        springs: any number, each between neighbours.
        chambers: any number; the pressure vector has one entry for each.
        damping: one `Damping` for all segments, or one for each.
        up: direction against gravity in the root frame; stored as a unit vector.
        gravity: acceleration of gravity [m/s^2], not negative.
        forces: any number, of `dtcasadi.forces` or one's own (see `dtcasadi.Force`).
        obstacles: any number, of `dtcasadi.contact`, that the discs may touch.
        constraints: any number, of `dtcasadi.constraints`, met at all times.
        plates: what discs are like to each other; None: they may pass through.

    Raises:
        RobotError: naming the field, what was expected and what was given.
    """

    discs: tuple[Disc, ...]
    threads: tuple[Thread, ...]
    springs: tuple[Spring, ...] = ()
    chambers: tuple[Chamber, ...] = ()
    damping: Damping | tuple[Damping, ...] = field(default_factory=Damping)
    up: np.ndarray = field(default_factory=lambda: np.array([0.0, 1.0, 0.0]))
    gravity: float = STANDARD_GRAVITY
    forces: tuple[Force, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    plates: Plates | None = None

    def __post_init__(self) -> None:
        """Check how the parts fit together and complete the defaults."""
        discs, threads = _items("discs", self.discs, Disc), _items("threads", self.threads, Thread)
        springs = _items("springs", self.springs, Spring)
        chambers = _items("chambers", self.chambers, Chamber)
        n = len(discs)
        if n < 2:
            raise RobotError("discs", "at least 2 discs, the root included", n)
        if len(threads) != n - 1:
            raise RobotError("threads", f"{n - 1} threads for {n} discs", len(threads))
        damping = self.damping
        if isinstance(damping, Damping):
            damping = (damping,) * (n - 1)
        damping = _items("damping", damping, Damping)
        if len(damping) != n - 1:
            raise RobotError("damping", f"one Damping, or {n - 1}", len(damping))
        constraints = _items("constraints", self.constraints, Constraint)
        spans = {"springs": springs, "chambers": chambers, "constraints": constraints}
        for name, parts in spans.items():
            for number, part in enumerate(parts, 1):
                if part.discs[-1] > n:
                    path = f"{name}[{number}].discs"
                    raise RobotError(path, f"discs from 1 to {n}", part.discs)
        set_fields(
            self,
            discs=discs,
            threads=threads,
            springs=tuple(_at_rest(k, spring, threads) for k, spring in enumerate(springs, 1)),
            chambers=tuple(_completed(chamber, discs) for chamber in chambers),
            damping=damping,
            up=checks.unit("up", self.up),
            gravity=checks.number("gravity", self.gravity, nonnegative=True),
            forces=_fitted(_items("forces", self.forces, Force), discs, threads),
            obstacles=_items("obstacles", self.obstacles, Obstacle),
            constraints=constraints,
        )
        set_fields(self, obstacles=tuple(self._fitted_obstacles()))

    def _fitted_obstacles(self) -> Iterator[Obstacle]:
        """The obstacles with what they take from the robot filled in."""
        for number, obstacle in enumerate(self.obstacles, 1):
            try:
                yield obstacle.fitted(self.n_discs, self.weight)
            except RobotError as error:
                path = f"obstacles[{number}].{error.field}"
                raise RobotError(path, error.expected, error.got) from None

    @classmethod
    def from_tube(
        cls,
        length: float,
        radius: float,
        wall_thickness: float,
        youngs_modulus: float,
        poissons_ratio: float,
        density: float,
        n_discs: int,
        fabric: str = "strip",
        *,
        payload: float = 0.0,
        bend: float | Sequence[float] = 0.0,
        twist: float = 0.0,
        **options: Any,
    ) -> "Robot":
        """A robot from a tube's dimensions and material, cut into discs.

        Its stiffnesses and mass, and how springs carry them: `dtcasadi.tube`, `dtcasadi.beam`.

        Args:
            length: of the tube's axis [m].
            radius: from the axis to the middle of the wall [m].
            wall_thickness: thin against the radius [m].
            youngs_modulus: of the wall [Pa].
            poissons_ratio: above -1, at most 0.5.
            density: of the wall [kg/m^3].
            n_discs: the root included.
            fabric: `strip`: an inextensible strip along the wall is the thread; `axis`: the thread
                is on the axis, as with fabric all round that lets the tube bend but not stretch.
            payload: point mass at the centre of the last disc [kg].
            bend: rest angle between the ends of the axis, about x, or a pair about (x, y) [rad];
                these axes turn with the twist.
            twist: angle by which the strip winds round the tube from root to tip, at rest [rad];
                a straight tube then traces a curve in space when inflated.
            options: more fields of `dtcasadi.tube.Tube`:
                chambers: number of equal chambers in series (1);
                strip_turns: for each chamber but the first, by how much its strip is set further
                    round the wall [rad];
                rated_pressure, radial_compliance: of every chamber, as of a Chamber; a thin wall
                    without hoops of its own grows by radius / (E wall_thickness) [1/Pa];
                retardation_time: viscosity of the wall over its Young's modulus (Kelvin-Voigt) [s];
                posts: axial springs round the wall, an even number (4);
                up, gravity: as of a Robot.

        Raises:
            RobotError: naming the field, what was expected and what was given.
        """
        from .tube import Tube

        sizes = (length, radius, wall_thickness, youngs_modulus, poissons_ratio, density)
        return Tube(*sizes, fabric, payload, bend, twist, **options).robot(n_discs)

    @classmethod
    def from_rod(
        cls,
        length: float,
        EI: float,
        GA: float,
        GJ: float,
        mass_per_length: float,
        n_discs: int,
        *,
        payload: float = 0.0,
        bend: float | Sequence[float] = 0.0,
        twist: float = 0.0,
        **options: Any,
    ) -> "Robot":
        """A robot from the stiffnesses of an inextensible rod, the thread on its axis.

        Args:
            length: of the axis [m].
            EI: bending stiffness about x and y [N m^2].
            GA: shear stiffness, the shear coefficient included [N].
            GJ: twisting stiffness [N m^2].
            mass_per_length: [kg/m].
            n_discs: the root included.
            payload: as of `from_tube`, like bend and twist.
            bend: rest angle between the ends of the axis, about x, or a pair about (x, y) [rad].
            twist: rest angle between them about the axis [rad].
            options: more fields of `dtcasadi.rod.Rod`:
                retardation_time, up, gravity: as of `from_tube`;
                cells: chambers beside the axis, `dtcasadi.rod.Cell` values;
                radius: of the discs [m]; by default that of the thin tube with this GA and GJ.

        Raises:
            RobotError: naming the field, what was expected and what was given.
        """
        from .rod import Rod

        return Rod(length, EI, GA, GJ, mass_per_length, payload, bend, twist, **options).robot(
            n_discs
        )

    @property
    def n_discs(self) -> int:
        """Number of discs, the root included."""
        return len(self.discs)

    @property
    def touchable(self) -> bool:
        """Whether its discs may touch an obstacle or each other."""
        return bool(self.obstacles) or self.plates is not None

    @property
    def weight(self) -> float:
        """Of all discs but the root [N]."""
        return self.gravity * sum(disc.mass for disc in self.discs[1:])

    @property
    def length(self) -> float:
        """Sum of the thread lengths [m]."""
        return sum(thread.length for thread in self.threads)


def _at_rest(number: int, spring: Spring, threads: tuple[Thread, ...]) -> Spring:
    """The spring with its rest length filled in from the rest pose (all coordinates zero)."""
    if spring.rest_length is not None:
        return spring
    gap = rest_gap(threads[spring.discs[0] - 1], spring.start, spring.end)
    try:
        return replace(spring, rest_length=float(np.linalg.norm(gap)))
    except RobotError as error:  # ends near the largest number a robot may hold
        path = f"springs[{number}].{error.field}"
        raise RobotError(path, error.expected, error.got) from None


def _fitted(
    forces: tuple[Force, ...], discs: tuple[Disc, ...], threads: tuple[Thread, ...]
) -> tuple[Force, ...]:
    """The forces with what they take from the robot filled in, the discs they name checked."""
    fitted = []
    for number, force in enumerate(forces, 1):
        path = f"forces[{number}]"
        check(path, force, len(discs))
        try:
            fitted.append(force.fitted(discs, threads))
        except RobotError as error:
            raise RobotError(f"{path}.{error.field}", error.expected, error.got) from None
    return tuple(fitted)


def _completed(chamber: Chamber, discs: tuple[Disc, ...]) -> Chamber:
    """The chamber with areas and centroids filled in from its discs."""
    spanned = discs[chamber.discs[0] - 1 : chamber.discs[1]]
    areas = [d.area for d in spanned] if chamber.areas is None else chamber.areas
    centroids = [d.centroid for d in spanned] if chamber.centroids is None else chamber.centroids
    return replace(chamber, areas=np.array(areas), centroids=np.array(centroids))
