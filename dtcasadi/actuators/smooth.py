"""Limits and switches with a continuous slope, free of branches.

What depends on a command alone is cut off where it ends (`cut`); what depends on a state passes
smoothly, so that a filter's Jacobian is continuous.
"""

import math
from typing import Any

import casadi as ca

Number = Any  # a number, or a CasADi matrix


def limited(bound: Number) -> bool:
    """Whether a bound is one at all: not infinite."""
    return not (isinstance(bound, float | int) and math.isinf(bound))


def cut(x: ca.SX, low: Number, high: Number) -> ca.SX:
    """The value within [low, high]."""
    if limited(low):
        x = ca.fmax(x, low)
    return ca.fmin(x, high) if limited(high) else x


def ramp(x: ca.SX, width: Number) -> ca.SX:
    """max(x, 0), a parabola for |x| < width: zero below and x above, the slope continuous."""
    inside = cut(x + width, 0.0, 2 * width)
    return inside**2 * (0.25 / width) + ca.fmax(x - width, 0.0)


def soft_cut(x: ca.SX, low: Number, high: Number, share: float = 0.25) -> ca.SX:
    """The value within [low, high], low < 0 < high, the slope continuous.

    Unchanged between (1 - share) low and (1 - share) high, exactly low and high beyond (1 + share)
    times as much, parabolas between.
    """
    result = inside = cut(x, (1 + share) * low, (1 + share) * high)
    for bound, beyond in ((high, inside - (1 - share) * high), (low, (1 - share) * low - inside)):
        if limited(bound):
            result = result - ca.fmax(beyond, 0.0) ** 2 * (0.25 / (share * bound))
    return result


def positive(x: Number, width: Number) -> Number:
    """(x + sqrt(x^2 + width^2)) / 2 > 0, which is x to (width / x)^2 / 4 far from zero."""
    return 0.5 * (x + (x**2 + width**2) ** 0.5)


def sign(x: ca.SX, width: Number) -> ca.SX:
    """Smooth sign x / sqrt(x^2 + width^2), in (-1, 1)."""
    return x / ca.sqrt(x**2 + width**2)
