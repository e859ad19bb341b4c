"""Drag of a fluid on a disc."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from .. import checks
from ..parts import set_fields
from .points import at_centre, checked_point
from .protocol import DiscState, Force, Wrench, column

if TYPE_CHECKING:
    from ..parts import Disc, Thread

# Added to squared speeds [m^2/s^2], so that their root has a slope at rest.
STILL = 1e-30


@dataclass(frozen=True, eq=False)
class Drag(Force):
    r"""Linear and quadratic drag on a point of a disc, and a rotary drag.

    With the velocity u of the point against the fluid and w of the disc, along the disc's axes,

    .. math:: F_j = -(\mathrm{linear}_j + \mathrm{quadratic}_j\, s_j)\, u_j, \quad
              s_x = s_y = \sqrt{u_x^2 + u_y^2}, \quad s_z = |u_z|, \quad
              M_j = -\mathrm{angular}_j\, w_j

    so that flow along the axis and across it are independent (G. I. Taylor, "Analysis of the
    swimming of long and narrow animals", Proc. R. Soc. A 214, 1952). A cylinder of length l and
    radius r in a fluid of density rho has quadratic = rho C r l across, with C about 1.1 (Hoerner,
    Fluid-Dynamic Drag, 1965, chapter 3). In a fluid at rest it never does positive work.

    Attributes:
        disc: number of the disc, from 2.
        linear: along x, y, z, one number for all or shape (3,), not negative [N s/m].
        quadratic: the same [N s^2/m^2].
        angular: about x, y, z, the same [N m s/rad].
        flow: velocity of the fluid in the root's frame, shape (3,) [m/s].
        point: where it acts, in the disc's frame, shape (3,) [m]; None: the centre of mass.

    Raises:
        RobotError: a coefficient is negative or not finite, or an array has another shape.
    """

    disc: int
    linear: float | np.ndarray = 0.0
    quadratic: float | np.ndarray = 0.0
    angular: float | np.ndarray = 0.0
    flow: np.ndarray = field(default_factory=lambda: np.zeros(3))
    point: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        names = ("linear", "quadratic", "angular")
        set_fields(
            self,
            **{name: checks.row(name, getattr(self, name), 3, nonnegative=True) for name in names},
            flow=checks.array("flow", self.flow, (3,)),
            **checked_point(self.point),
        )

    def fitted(self, discs: "Sequence[Disc]", threads: "Sequence[Thread]") -> "Drag":
        """The drag on the disc's centre of mass where no point is given."""
        return at_centre(self, discs)

    def wrenches(self, disc: DiscState) -> Wrench:
        """Force and moment along the disc's axes."""
        u = disc.velocity_own(self.point) - ca.mtimes(disc.R.T, column(self.flow))
        across, along = ca.sqrt(ca.sumsqr(u[:2]) + STILL), ca.sqrt(u[2] ** 2 + STILL)
        speed = ca.vertcat(across, across, along)
        force = -(column(self.linear) + column(self.quadratic) * speed) * u
        push = disc.push_own(force, self.point)
        return push + disc.turn_own(-column(self.angular) * disc.w_own)
