"""An obstacle: a shape that the discs' rims cannot enter, and what touching it is like."""

from dataclasses import dataclass, replace

import numpy as np

from .. import checks
from ..errors import RobotError
from ..parts import set_fields
from .shapes import SHAPES, Box, Capsule, HalfSpace, Sphere

MAX_RIM_POINTS = 64


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A shape fixed in the root's frame against which points on the discs' rims push.

    With a penetration the contact is compliant, a force like others (`dtcasadi.contact.compliant`
    has the law and what the numbers mean); without one it is rigid, by the impulses of method
    `moreau` (`dtcasadi.contact.stepping`).

    Attributes:
        shape: `HalfSpace`, `Sphere`, `Capsule` or `Box`.
        penetration: how deep a single rim point sinks in under the load, positive [m]; None: rigid.
        load: that load, positive [N]; None: the weight of all discs but the root.
        friction: coefficient of Coulomb friction, not negative.
        slip_speed: speed above which points slip with nearly all of the friction, positive [m/s].
        dissipation: of Hunt and Crossley, not negative [s/m].
        restitution: Moreau's coefficient of a rigid contact, 0 to 1; the largest holds for all.
        rim_points: number of points on each disc's rim.
        discs: numbers of the discs that may touch it; None: all but the root.

    Raises:
        RobotError: a value is not finite or out of range.
    """

    shape: HalfSpace | Sphere | Capsule | Box
    penetration: float | None = None
    load: float | None = None
    friction: float = 0.5
    slip_speed: float = 0.01
    dissipation: float = 0.0
    restitution: float = 0.0
    rim_points: int = 16
    discs: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        if not isinstance(self.shape, SHAPES):
            names = ", ".join(kind.__name__ for kind in SHAPES)
            raise RobotError("shape", f"one of {names}", checks.shown(self.shape))
        positive = {"slip_speed": self.slip_speed}
        for name in ("penetration", "load"):
            if getattr(self, name) is not None:
                positive[name] = getattr(self, name)
        others = {"friction": self.friction, "dissipation": self.dissipation}
        set_fields(
            self,
            **{name: checks.number(name, value, positive=True) for name, value in positive.items()},
            **{name: checks.number(name, v, nonnegative=True) for name, v in others.items()},
            restitution=checked_restitution(self.restitution),
            rim_points=checks.index("rim_points", self.rim_points, 1, MAX_RIM_POINTS),
        )
        if self.discs is not None:
            discs = tuple(checks.index("discs", disc, 2, 10**6) for disc in self.discs)
            if not discs or list(discs) != sorted(set(discs)):
                raise RobotError("discs", "disc numbers in rising order", self.discs)
            set_fields(self, discs=discs)

    @property
    def rigid(self) -> bool:
        """Whether it does not yield."""
        return self.penetration is None

    @property
    def geometry(self) -> np.ndarray:
        """The numbers of its shape in the order of the shape's `distance`, shape (n,)."""
        return self.shape.numbers

    @property
    def stiffness(self) -> float:
        """Of each rim point once it has sunk in by `penetration`, 2 load / penetration [N/m]."""
        assert self.load is not None and self.penetration is not None
        return 2 * self.load / self.penetration

    def touching(self, n_discs: int) -> tuple[int, ...]:
        """Numbers of the discs that may touch it, in a robot with so many."""
        return tuple(range(2, n_discs + 1)) if self.discs is None else self.discs

    def fitted(self, n_discs: int, weight: float) -> "Obstacle":
        """The obstacle with what it takes from the robot filled in.

        Raises:
            RobotError: it names a disc that is not there, or has no load and the robot no weight.
        """
        if self.discs is not None and self.discs[-1] > n_discs:
            raise RobotError("discs", f"discs from 2 to {n_discs}", self.discs)
        if self.rigid:
            return self
        if self.load is None and not weight > 0:
            raise RobotError("load", "a positive number, as the robot has no weight", None)
        return replace(self, load=weight if self.load is None else self.load)


def checked_restitution(value: object) -> float:
    """A coefficient from 0 to 1.

    Raises:
        RobotError: it is not.
    """
    number = checks.number("restitution", value, nonnegative=True)
    if number > 1:
        raise RobotError("restitution", "a number from 0 to 1", number)
    return number
