"""What a force sees and what it gives back: the one protocol of all forces.

A force names the discs it touches. With one disc, the world acts on it and the reference is the
root's frame; with several, the first of them is the reference and gets the reaction, so that
momentum is conserved whatever the force. It sees every other disc's pose and velocity relative to
the reference and returns a wrench on each.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import casadi as ca
import numpy as np

from ..errors import ModelError
from ..kernels.axes import cross

if TYPE_CHECKING:
    from ..robot import Disc, Thread

_PLACES = ("disc", "discs")
_MATRIX = (ca.SX, ca.MX, ca.DM)


class Wrench(NamedTuple):
    """Moment about the disc's origin [N m] and force [N], shape (3, 1) each.

    Components along the reference's axes, or with `own` along the disc's.
    """

    moment: ca.SX
    force: ca.SX
    own: bool = False

    def __add__(self, other: "Wrench") -> "Wrench":  # type: ignore[override]
        """Both on the same disc, along the same axes."""
        if self.own != other.own:
            raise ModelError("wrench: expected both along the same axes, got own=True and False")
        return Wrench(self.moment + other.moment, self.force + other.force, self.own)


class ThreadState(NamedTuple):
    """The thread that ends at a disc, along the reference's axes.

    t: its direction, shape (3, 1); near_rate and far_rate: rate of t seen from the disc before and
    from this disc [1/s]; length [m].
    """

    t: ca.SX
    near_rate: ca.SX
    far_rate: ca.SX
    length: ca.SX


@dataclass(frozen=True, eq=False)
class DiscState:
    """A disc seen from the reference.

    Attributes:
        R: rotation, the disc's frame in the reference's, shape (3, 3).
        r: position of its origin, along the reference's axes, shape (3, 1) [m].
        thread: the thread from the disc before; None where the world acts.
    """

    R: ca.SX
    r: ca.SX
    rates: tuple[ca.SX, ca.SX] | None = None  # w and v along the reference's axes, or
    own_rates: tuple[ca.SX, ca.SX] | None = None  # along the disc's
    thread: ThreadState | None = None

    @cached_property
    def w(self) -> ca.SX:
        """Angular velocity relative to the reference, along its axes, shape (3, 1) [rad/s]."""
        return self._turned(0)

    @cached_property
    def v(self) -> ca.SX:
        """Velocity of the disc's origin relative to the reference, along its axes [m/s]."""
        return self._turned(1)

    @cached_property
    def w_own(self) -> ca.SX:
        """Angular velocity along the disc's axes, shape (3, 1) [rad/s]."""
        return self._turned_back(0)

    @cached_property
    def v_own(self) -> ca.SX:
        """Velocity of the disc's origin along the disc's axes, shape (3, 1) [m/s]."""
        return self._turned_back(1)

    def _turned(self, k: int) -> ca.SX:
        if self.rates is not None:
            return self.rates[k]
        return ca.SX.zeros(3) if self.own_rates is None else ca.mtimes(self.R, self.own_rates[k])

    def _turned_back(self, k: int) -> ca.SX:
        if self.own_rates is not None:
            return self.own_rates[k]
        return ca.SX.zeros(3) if self.rates is None else ca.mtimes(self.R.T, self.rates[k])

    def place(self, point: object) -> ca.SX:
        """Position of a point of the disc given in its own frame, shape (3, 1) [m]."""
        return self.r + ca.mtimes(self.R, column(point))

    def velocity(self, point: object) -> ca.SX:
        """Velocity of a point of the disc given in its own frame, shape (3, 1) [m/s]."""
        return self.v + cross(self.w, ca.mtimes(self.R, column(point)))

    def velocity_own(self, point: object) -> ca.SX:
        """The same along the disc's axes, shape (3, 1) [m/s]."""
        return self.v_own + cross(self.w_own, column(point))

    def push(self, force: object, at: object = None) -> Wrench:
        """A force along the reference's axes on a point of the disc (None: its origin)."""
        force = column(force)
        zero = ca.SX.zeros(3)
        moment = zero if at is None else cross(ca.mtimes(self.R, column(at)), force)
        return Wrench(moment, force)

    def push_own(self, force: object, at: object = None) -> Wrench:
        """A force along the disc's own axes on a point of it (None: its origin)."""
        force = column(force)
        moment = ca.SX.zeros(3) if at is None else cross(column(at), force)
        return Wrench(moment, force, own=True)

    def turn(self, moment: object) -> Wrench:
        """A moment along the reference's axes."""
        return Wrench(column(moment), ca.SX.zeros(3))

    def turn_own(self, moment: object) -> Wrench:
        """A moment along the disc's own axes."""
        return Wrench(column(moment), ca.SX.zeros(3), own=True)


class Body(NamedTuple):
    """A rigid mass [kg], its inertia about its centre [kg m^2] and that centre [m], disc frame."""

    mass: ca.SX
    inertia: ca.SX
    com: ca.SX


@dataclass(frozen=True, eq=False)
class Force:
    """Base of every force: a frozen value that a robot holds in `forces`.

    A force has a field `disc` (the world acts on that disc) or `discs` (the first one is the
    reference), and gives `wrenches`, or `energy` alone and has its wrenches from that. With both,
    the energy is its potential: model and health book it as such, and its wrenches at rest must be
    its slope. What wrenches take because of rates is booked as dissipated. `DiscState` says what is
    seen and has `push`, `turn` and their kin to make wrenches with.

    Its other fields are numbers (also of shape (n,) or (n, m)), which may become free parameters
    (`forces[2].stiffness`) and are CasADi matrices when it is asked, or texts and truth values.
    Wrenches have to be smooth enough to be differentiated, and free of `if_else`. Derivatives are
    taken of the small kernel that holds the forces on one disc or between the same discs.
    """

    # Any arguments, so that a force may name the discs it sees: `wrenches(self, disc)`.
    def wrenches(self, *discs: Any, **_: Any) -> Any:
        """Wrench on each disc it sees [N m, N]; a single one need not be in a sequence.

        By default the force of the energy: -dU/dr, and the moment -sum_k R_k x dU/dR_k over the
        columns of R.
        """
        symbols = [DiscState(ca.SX.sym("R", 3, 3), ca.SX.sym("r", 3, 1)) for _ in discs]
        energy = self.energy(*symbols)
        place = [part for disc in symbols for part in (disc.R, disc.r)]
        slopes = [ca.gradient(energy, part) for part in place]
        actual = [ca.densify(ca.SX(part)) for disc in discs for part in (disc.R, disc.r)]
        slopes = ca.substitute(slopes, place, actual)
        return [
            Wrench(
                -sum(cross(disc.R[:, k], slope[:, k]) for k in range(3)),
                -pull,
            )
            for disc, slope, pull in zip(discs, slopes[::2], slopes[1::2], strict=True)
        ]

    def energy(self, *discs: Any, **_: Any) -> Any:
        """Potential energy [J] whose slope is the force at rest; None where there is none."""
        return None

    def body(self) -> Any:
        """`Body` that moves with the disc; None where the force carries none."""
        return None

    def field(self) -> Any:
        """Acceleration that every mass gets, along the root's axes, shape (3, 1) [m/s^2]."""
        return None

    def fitted(self, discs: "Sequence[Disc]", threads: "Sequence[Thread]") -> "Force":
        """The force with defaults that depend on the robot filled in."""
        return self

    def touched(self) -> tuple[int, ...]:
        """Numbers of the discs it touches, from 1."""
        if (discs := getattr(self, "discs", None)) is not None:
            return tuple(discs)
        disc = getattr(self, "disc", None)
        return () if disc is None else (disc,)

    @classmethod
    def acts(cls) -> bool:
        """Whether it gives wrenches."""
        return cls.wrenches is not Force.wrenches or cls.stores()

    @classmethod
    def stores(cls) -> bool:
        """Whether it has an energy."""
        return cls.energy is not Force.energy


def column(value: object) -> ca.SX:
    """Three numbers as a CasADi column."""
    return ca.vec(ca.SX(value)) if isinstance(value, _MATRIX) else ca.vertcat(*value)  # type: ignore[misc]


def constant(value: np.ndarray) -> ca.DM:
    """Numbers as a matrix that keeps only what is not zero."""
    return ca.sparsify(ca.DM(value))


def numbers_in(force: Force) -> dict[str, Any]:
    """The fields that are numbers, each a CasADi matrix or an array."""
    found: dict[str, Any] = {}
    for each in fields(force):
        value = getattr(force, each.name)
        if each.name in _PLACES or isinstance(value, bool | str) or value is None:
            continue
        if isinstance(value, _MATRIX):
            found[each.name] = value
            continue
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            continue
        if array.ndim <= 2:
            found[each.name] = array
    return found


class Packed(NamedTuple):
    """A force as a tree of matrices that a kernel takes; without the numbers of its discs."""

    kind: type[Force]
    static: tuple[tuple[str, Any], ...]
    names: tuple[str, ...]
    values: tuple[ca.SX, ...]

    def force(self) -> Force:
        """The force again."""
        return _filled(
            self.kind, dict(self.static) | dict(zip(self.names, self.values, strict=True))
        )

    def replaced(self, name: str, value: ca.SX) -> "Packed":
        """The same with another value of one number."""
        pairs = zip(self.names, self.values, strict=True)
        return self._replace(values=tuple(value if n == name else old for n, old in pairs))


def packed(force: Force) -> Packed:
    """The force for a kernel call."""
    numbers = numbers_in(force)
    static = tuple(
        (each.name, getattr(force, each.name))
        for each in fields(force)
        if each.name not in numbers and each.name not in _PLACES
    )
    values = tuple(v if isinstance(v, _MATRIX) else constant(v) for v in numbers.values())
    return Packed(type(force), static, tuple(numbers), values)


def with_numbers(force: Force, numbers: dict[str, ca.SX]) -> Force:
    """The force with matrices for its numbers; what its constructor checks is not checked again."""
    kept = {each.name: getattr(force, each.name) for each in fields(force)}
    return _filled(type(force), {**kept, **numbers})


def _filled(kind: type[Force], values: dict[str, Any]) -> Force:
    force = object.__new__(kind)
    for name, value in values.items():
        object.__setattr__(force, name, value)
    return force
