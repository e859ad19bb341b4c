"""Kernels of the wrenches' derivatives for one number that the forces share."""

from collections.abc import Callable
from typing import Any

import casadi as ca

from ..kernels.kinematics import Segment, Turning, Words
from .protocol import Packed
from .span import Loads, Seen, span_wrenches
from .world import world_wrench


def span_slopes(
    number: str,
    words: tuple[Words, ...],
    segments: tuple[Segment, ...],
    relative: tuple[Turning, ...],
    seen: Seen,
    *forces: Packed,
) -> Loads:
    """Derivative of `span_wrenches`."""
    return _sloped(number, forces, lambda *f: span_wrenches(words, segments, relative, seen, *f))


def world_slopes(
    number: str, R: ca.SX, r: ca.SX, w: ca.SX, v: ca.SX, *forces: Packed
) -> tuple[ca.SX, ca.SX]:
    """Derivative of `world_wrench`."""
    return _sloped(number, forces, lambda *f: world_wrench(R, r, w, v, *f))


def _sloped(number: str, forces: tuple[Packed, ...], wrenches: Callable[..., Any]) -> Any:
    """The derivative of nested tuples of wrenches, at the number's value."""
    symbol = ca.SX.sym(number)
    value = ca.densify(ca.SX(forces[0].values[forces[0].names.index(number)]))

    def derived(part: Any) -> Any:
        if isinstance(part, tuple):
            return tuple(derived(each) for each in part)
        return ca.substitute(ca.jacobian(part, symbol), symbol, value)

    return derived(wrenches(*(force.replaced(number, symbol) for force in forces)))
