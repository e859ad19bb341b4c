"""Discs as plates that the rims of the others cannot pass through."""

from dataclasses import dataclass

from .. import checks
from ..parts import set_fields
from .obstacle import MAX_RIM_POINTS, checked_restitution


@dataclass(frozen=True, eq=False)
class Plates:
    """Rigid contact of the discs' rims with the plates of the other discs.

    A plate is the circle round the disc's outline, with its mean radius, in the plane of its rim;
    it is thick by 2 % of its radius. What has come round its edge stays on the other side.

    Attributes:
        friction: coefficient of Coulomb friction, not negative.
        restitution: Moreau's coefficient, 0 to 1.
        rim_points: number of points on each disc's rim.

    Raises:
        RobotError: a value is out of range.
    """

    friction: float = 0.5
    restitution: float = 0.0
    rim_points: int = 16

    def __post_init__(self) -> None:
        """Check every field."""
        set_fields(
            self,
            friction=checks.number("friction", self.friction, nonnegative=True),
            restitution=checked_restitution(self.restitution),
            rim_points=checks.index("rim_points", self.rim_points, 1, MAX_RIM_POINTS),
        )
