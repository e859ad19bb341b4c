"""The wall between two neighbouring discs where it acts one way only: wrinkles and bunches."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import casadi as ca
import numpy as np

from .. import checks
from ..kernels.axes import cross, vector
from ..parts import rest_gap, set_fields
from .protocol import DiscState, Force, Wrench, column
from .springs import gap

if TYPE_CHECKING:
    from ..parts import Disc, Thread

# Share of the length over which a wall goes from slack to taut, where none is given.
SMOOTHING = 0.01


class Taken(NamedTuple):
    """A stretch h that starts smoothly, and the integrals of h and of h^3."""

    h: ca.SX
    once: ca.SX
    cubed: ca.SX


def taken_up(stretch: ca.SX, width: ca.SX) -> Taken:
    r"""Zero below zero, stretch - width / 2 above the width, twice differentiable between.

    With s = stretch / width in 0..1,

    .. math:: h = w (s^3 - s^4 / 2), \quad \int h = w^2 (s^4 / 4 - s^5 / 10), \quad
              \int h^3 = w^4 s^{10} (1/10 - 3 s / 22 + s^2 / 16 - s^3 / 104)
    """
    s = ca.fmin(ca.fmax(stretch / width, 0), 1)
    beyond = ca.fmax(stretch - width, 0)
    half = width / 2
    h = width * s**3 * (1 - s / 2) + beyond
    once = width**2 * s**4 * (1 / 4 - s / 10) + beyond * (half + beyond / 2)
    start = s**10 * (1 / 10 - 3 * s / 22 + s**2 / 16 - s**3 / 104)
    cubed = width**4 * start + ((half + beyond) ** 4 - half**4) / 4
    return Taken(h, once, cubed)


class _Law(Force):
    """Force k (h + b h^3) of a stretch h that has been taken up, and its energy."""

    discs: Any
    start: Any
    end: Any
    stiffness: Any
    stiffening: Any
    smoothing: Any

    def force(self, stretch: ca.SX) -> ca.SX:
        """The force [N]."""
        h = taken_up(stretch, self.smoothing).h
        return self.stiffness * h * (1 + self.stiffening * h**2)

    def stored(self, stretch: ca.SX) -> ca.SX:
        """Its integral from no stretch on [J]."""
        _, once, cubed = taken_up(stretch, self.smoothing)
        return self.stiffness * (once + self.stiffening * cubed)

    def checked(self) -> dict[str, Any]:
        """The fields that both walls have, checked."""
        values = {name: getattr(self, name) for name in ("stiffness", "stiffening")}
        fields = {n: checks.number(n, value, nonnegative=True) for n, value in values.items()}
        if self.smoothing is not None:
            fields["smoothing"] = checks.number("smoothing", self.smoothing, positive=True)
        ends = {name: checks.array(name, getattr(self, name), (3,)) for name in ("start", "end")}
        return {"discs": checks.neighbours("discs", self.discs), **ends, **fields}


@dataclass(frozen=True, eq=False)
class WallSpring(_Law):
    """A strip of wall between two points: pulls when taut, stiffer the more, slack otherwise.

    Pull k (h + b h^3) along the strip, h its stretch beyond the rest length, taken up smoothly;
    shorter than that it wrinkles and gives no force at all.

    Attributes:
        discs: (i, i + 1), the pair it joins.
        start: its end on disc i, in frame i, shape (3,) [m].
        end: its end on disc i+1, in frame i+1, shape (3,) [m].
        stiffness: k, not negative [N/m].
        rest_length: length from which on it is taut [m]; None: its length in the rest pose.
        stiffening: b, not negative [1/m^2].
        smoothing: stretch over which it becomes taut, positive [m]; None: 1 % of the rest length.

    Raises:
        RobotError: discs that are no neighbours, or a number out of range.
    """

    discs: tuple[int, int]
    start: np.ndarray
    end: np.ndarray
    stiffness: float
    rest_length: float | None = None
    stiffening: float = 0.0
    smoothing: float | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        fields = self.checked()
        if self.rest_length is not None:
            rest = checks.number("rest_length", self.rest_length, positive=True)
            fields["rest_length"] = rest
        set_fields(self, **fields)

    def fitted(self, discs: "Sequence[Disc]", threads: "Sequence[Thread]") -> "WallSpring":
        """The strip with its rest length and smoothing filled in."""
        rest, width = self.rest_length, self.smoothing
        if rest is None:
            way = rest_gap(threads[self.discs[0] - 1], self.start, self.end)
            rest = float(np.linalg.norm(way))
        width = SMOOTHING * rest if width is None else width
        return replace(self, rest_length=rest, smoothing=width)

    def wrenches(self, disc: DiscState) -> Wrench:
        """Wrench on disc i+1."""
        arm = ca.mtimes(disc.R, column(self.end))
        d, length = gap(disc, column(self.start), arm)
        force = d * (-self.force(length - self.rest_length) / length)
        return Wrench(cross(arm, force), force)

    def energy(self, disc: DiscState) -> ca.SX:
        """Energy of the stretch [J]."""
        _, length = gap(disc, column(self.start), ca.mtimes(disc.R, column(self.end)))
        return self.stored(length - self.rest_length)


@dataclass(frozen=True, eq=False)
class FabricBunching(_Law):
    """Fabric that bunches between two rim points and fills the space: pushes, never pulls.

    Push k (h + b h^3) with h the part of `gap` that is no longer there, taken up smoothly. The
    space left is measured along the mean of the discs' axes, d . (z_i + z_{i+1}) / 2 with d from
    point to point, so that the force keeps its side where discs would pass through each other.

    Attributes:
        discs: (i, i + 1), the pair it fills.
        start: point on disc i, in frame i, shape (3,) [m].
        end: point on disc i+1, in frame i+1, shape (3,) [m].
        stiffness: k, not negative [N/m].
        gap: space that the bunched fabric takes, positive [m].
        stiffening: b, not negative [1/m^2].
        smoothing: loss of space over which it sets in, positive [m]; None: 1 % of the gap.

    Raises:
        RobotError: discs that are no neighbours, or a number out of range.
    """

    discs: tuple[int, int]
    start: np.ndarray
    end: np.ndarray
    stiffness: float
    gap: float
    stiffening: float = 0.0
    smoothing: float | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        space = checks.number("gap", self.gap, positive=True)
        set_fields(self, **{"smoothing": SMOOTHING * space, **self.checked(), "gap": space})

    def wrenches(self, disc: DiscState) -> Wrench:
        """Push f n on disc i+1, n = (z_i + z_{i+1}) / 2, and the moment f z_{i+1} x d / 2."""
        arm, d, axis, mean = self._parts(disc)
        push = self.force(self.gap - ca.dot(d, mean))
        return Wrench(cross(arm, push * mean) + cross(axis, d) * (push / 2), push * mean)

    def energy(self, disc: DiscState) -> ca.SX:
        """Energy of the bunch [J]."""
        _, d, _, mean = self._parts(disc)
        return self.stored(self.gap - ca.dot(d, mean))

    def _parts(self, disc: DiscState) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """Arm on disc i+1, vector between the points, axis of disc i+1, mean of both axes."""
        arm, axis = ca.mtimes(disc.R, column(self.end)), disc.R[:, 2]
        return arm, disc.r + arm - column(self.start), axis, (axis + vector(0, 0, 1)) / 2
