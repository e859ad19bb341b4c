"""Gravity, a uniform field."""

from dataclasses import dataclass

import casadi as ca

from .protocol import Force, Packed


@dataclass(frozen=True, eq=False)
class Gravity(Force):
    """Acceleration -magnitude * up of every mass [m/s^2].

    Felt as an acceleration of the root the other way, so the recursions carry it at no cost.
    """

    magnitude: ca.SX
    up: ca.SX

    def touched(self) -> tuple[int, ...]:
        """No disc more than another."""
        return ()

    def field(self) -> ca.SX:
        """Acceleration of free fall, along the root's axes."""
        return -self.magnitude * self.up


def felt_at_root(*fields: Packed) -> ca.SX:
    """Acceleration of the root that stands for the fields, along its own axes."""
    total = ca.SX.zeros(3)
    for field in fields:
        total = total - field.force().field()
    return total
