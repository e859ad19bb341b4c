"""Straight springs and dampers between any two points of neighbouring discs, eq (5)."""

from dataclasses import dataclass

import casadi as ca

from ..kernels.axes import cross
from .protocol import DiscState, Force, Wrench

# The length is sqrt(d.d + (FOLD l)^2): 5e-17 relative at d = l, and no division by zero on a fold.
FOLD = 1e-8


@dataclass(frozen=True, eq=False)
class Springs(Force):
    """All springs of one pair: ends (3, n) in their own discs' frames, the rest (n, 1).

    Pull k (|d| - L) + c d|d|/dt along d, on disc i towards disc i+1 and back.
    """

    discs: tuple[int, int]
    start: ca.SX
    end: ca.SX
    stiffness: ca.SX
    rest_length: ca.SX
    damping: ca.SX

    def wrenches(self, disc: DiscState) -> Wrench:
        """Wrench on disc i+1."""
        zero = ca.SX.zeros(3)
        total = Wrench(zero, zero)
        for m in range(self.stiffness.shape[0]):
            arm = ca.mtimes(disc.R, self.end[:, m])
            d, length = gap(disc, self.start[:, m], arm)
            push = self.stiffness[m] * (self.rest_length[m] - length)
            if not _is_zero(self.damping[m]):
                rate = disc.v + cross(disc.w, arm)
                push = push - self.damping[m] * ca.dot(d, rate) / length
            force = d * (push / length)
            total = total + Wrench(cross(arm, force), force)
        return total

    def energy(self, disc: DiscState) -> ca.SX:
        """Sum of k (|d| - L)^2 / 2 [J]."""
        total = ca.SX(0)
        for m in range(self.stiffness.shape[0]):
            arm = ca.mtimes(disc.R, self.end[:, m])
            _, length = gap(disc, self.start[:, m], arm)
            total = total + self.stiffness[m] * (length - self.rest_length[m]) ** 2 / 2
        return total


def gap(disc: DiscState, start: ca.SX, arm: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Vector from a point of the reference to r + arm of the disc, and its length."""
    d = disc.r + arm - start
    scale = disc.thread.length if disc.thread else 1
    return d, ca.sqrt(ca.dot(d, d) + (FOLD * scale) ** 2)


def _is_zero(value: ca.SX) -> bool:
    return value.is_constant() and value.is_zero()
