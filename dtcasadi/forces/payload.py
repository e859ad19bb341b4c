"""Mass carried by a disc."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from .. import checks
from ..kernels.axes import skew
from ..parts import set_fields
from .points import at_centre, checked_point
from .protocol import Body, Force, Packed, column

if TYPE_CHECKING:
    from ..robot import Disc, Thread


@dataclass(frozen=True, eq=False)
class Payload(Force):
    """A rigid body held by a disc: weight and inertia.

    Attributes:
        disc: number of the disc, from 1.
        mass: [kg], not negative.
        point: its centre of mass in the disc's frame, shape (3,) [m]; None: the disc's own.
        inertia: tensor about that centre along the disc's axes, shape (3, 3) [kg m^2]; default: a
            point mass.
    """

    disc: int
    mass: float
    point: np.ndarray | None = None
    inertia: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))

    def __post_init__(self) -> None:
        """Check every field."""
        set_fields(
            self,
            mass=checks.number("mass", self.mass, nonnegative=True),
            inertia=checks.tensor("inertia", self.inertia, definite=False),
            **checked_point(self.point),
        )

    def fitted(self, discs: "Sequence[Disc]", threads: "Sequence[Thread]") -> "Payload":
        """The payload at the disc's centre of mass where no point is given."""
        return at_centre(self, discs)

    def body(self) -> Body:
        """Mass, inertia and centre."""
        return Body(self.mass, self.inertia, self.point)


def together(own: Body, *carried: Packed) -> Body:
    """A disc and what it carries as one body.

    The centre is the mean weighted by mass, the tensors add about it by the parallel-axis theorem
    (Goldstein, Classical Mechanics, section 5.3).
    """
    bodies = [own, *(force.force().body() for force in carried)]
    mass = sum((body.mass for body in bodies), ca.SX(0))
    com = sum((body.mass * column(body.com) for body in bodies), ca.SX.zeros(3)) / mass
    inertia = ca.SX.zeros(3, 3)
    for body in bodies:
        lever = skew(column(body.com) - com)
        inertia = inertia + body.inertia - body.mass * ca.mtimes(lever, lever)
    return Body(mass, inertia, com)
