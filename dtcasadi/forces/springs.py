"""Straight springs between any two points of neighbouring discs, eq (5)."""

from typing import NamedTuple

import casadi as ca

from ..kernels.axes import cross
from .pair import Pair, PairWrench, no_wrench

# The length is sqrt(d.d + (FOLD l)^2): 5e-17 relative at d = l, and no division by zero on a fold.
FOLD = 1e-8


class Springs(NamedTuple):
    """The springs of one pair: ends (3, n) in their own discs' frames, the rest (n, 1)."""

    start: ca.SX
    end: ca.SX
    stiffness: ca.SX
    rest_length: ca.SX
    damping: ca.SX


def spring_wrench(pair: Pair, springs: Springs) -> PairWrench:
    """Pull f = k (|d| - L) + c d|d|/dt along d, on disc i towards disc i+1 and back."""
    total = no_wrench()
    for m in range(springs.stiffness.shape[0]):
        start = springs.start[:, m]
        arm = ca.mtimes(pair.R, springs.end[:, m])
        d, length = _gap(pair, start, arm)
        pull = springs.stiffness[m] * (length - springs.rest_length[m])
        if not _is_zero(springs.damping[m]):
            rate = pair.length * pair.t_rate + cross(pair.w, arm)
            pull = pull + springs.damping[m] * ca.dot(d, rate) / length
        force = d * (pull / length)
        total = total + PairWrench(cross(start, force), force, -cross(arm, force), -force)
    return total


def spring_energy(pair: Pair, springs: Springs) -> ca.SX:
    """Sum of k (|d| - L)^2 / 2 over the pair's springs [J]."""
    total = ca.SX(0)
    for m in range(springs.stiffness.shape[0]):
        arm = ca.mtimes(pair.R, springs.end[:, m])
        _, length = _gap(pair, springs.start[:, m], arm)
        total = total + springs.stiffness[m] * (length - springs.rest_length[m]) ** 2 / 2
    return total


def _gap(pair: Pair, start: ca.SX, arm: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Vector from the spring's start to its end and its length, in frame i."""
    d = pair.r + arm - start
    return d, ca.sqrt(ca.dot(d, d) + (FOLD * pair.length) ** 2)


def _is_zero(value: ca.SX) -> bool:
    return value.is_constant() and value.is_zero()
