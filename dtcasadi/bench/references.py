"""Numbers that beams, chains and pendulums are known to have, from closed forms or shooting.

Nothing here knows of discs and threads. Lengths are in units of the beam's length L, loads of
EI / L^2 (a force) and EI / L^3 (a weight per length), angular frequencies of sqrt(EI / mu L^4).
"""

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar
from scipy.special import ellipk, jn_zeros, jv, roots_laguerre

# Euler 1744: a clamped column with a free end.
EULER = math.pi**2 / 4


def elastica(force: float, weight: float) -> tuple[float, float, float]:
    """Drop, shortening and tip angle of an inextensible cantilever clamped horizontally.

    theta'' = -(force + weight (1 - s)) cos theta, theta(0) = 0, theta'(1) = 0, by shooting
    (Bisshopp and Drucker, Quart. Appl. Math. 3 (1945) 272, for the force alone).
    """

    def rates(s: float, y: np.ndarray) -> list[float]:
        angle, bend, _, _ = y
        pull = (force + weight * (1 - s)) * math.cos(angle)
        return [bend, -pull, math.sin(angle), 1 - math.cos(angle)]

    def end(bend: float) -> np.ndarray:
        options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
        return solve_ivp(rates, (0.0, 1.0), [0.0, bend, 0.0, 0.0], **options).y[:, -1]

    steepest = force + weight / 2  # the moment at the clamp of a beam that stays straight
    bend = brentq(lambda b: end(b)[1], 0.0, steepest, xtol=1e-13)
    angle, _, drop, shortening = end(bend)
    return float(drop), float(shortening), float(angle)


def greenhill() -> float:
    """Weight per length under which an upright column buckles: J_(-1/3)(2/3 sqrt(w)) = 0.

    Greenhill, Proc. Camb. Phil. Soc. 4 (1881) 65.
    """
    zero = brentq(lambda x: jv(-1 / 3, x), 1.0, 2.5, xtol=1e-14)
    return (1.5 * zero) ** 2


def beck() -> float:
    """Compressive follower force at which two undamped frequencies of a column become one.

    Beck, Z. angew. Math. Phys. 3 (1952) 225.
    """
    return _top()[0]


def beck_damped() -> float:
    """The same with vanishing internal (Kelvin-Voigt) damping.

    With E (1 + t d/dt) for E the characteristic equation holds for force / (1 + t lambda) and
    lambda^2 / (1 + t lambda). To first order in t its root leaves the imaginary axis where
    omega^2 = P d omega^2 / dP on the first branch (Ziegler's destabilization, Ing.-Arch. 20 (1952)
    49; Bolotin, Nonconservative Problems of the Theory of Elastic Stability, section 2.10).
    """
    step = 1e-5

    def balance(force: float) -> float:
        slope = (_first(force + step) - _first(force - step)) / (2 * step)
        return _first(force) - force * slope

    return float(brentq(balance, 5.0, 18.0, xtol=1e-10))


def _characteristic(force: float, square: float) -> float:
    """Of Beck's column; `square` is the square of the angular frequency."""
    root = math.sqrt(force**2 / 4 + square)
    a, b = math.sqrt(root + force / 2), math.sqrt(root - force / 2)
    wave = force * math.sqrt(square) * math.sin(a) * math.sinh(b)
    return force**2 + 2 * square + 2 * square * math.cos(a) * math.cosh(b) + wave


def _first(force: float) -> float:
    """Square of the first frequency under a follower force below Beck's."""
    grid = np.linspace(1.0, _top()[1], 200)
    signs = np.sign([_characteristic(force, x) for x in grid])
    k = int(np.flatnonzero(signs[1:] != signs[:-1])[0])
    return float(brentq(lambda x: _characteristic(force, x), grid[k], grid[k + 1], xtol=1e-13))


def _top() -> tuple[float, float]:
    """Force and squared frequency where the first two branches meet."""

    def force(square: float) -> float:
        return float(brentq(lambda p: _characteristic(p, square), 10.0, 25.0, xtol=1e-13))

    # The force is largest where the branches meet.
    found = minimize_scalar(
        lambda square: -force(square),
        bounds=(80.0, 170.0),
        method="bounded",
        options={"xatol": 1e-6},
    )
    return -float(found.fun), float(found.x)


def cantilever(n: int) -> np.ndarray:
    """First n angular frequencies: squares of the zeros of cos x cosh x + 1."""

    def wave(x: float) -> float:
        return math.cos(x) + 1 / math.cosh(x)

    zeros = [brentq(wave, k * math.pi, (k + 1) * math.pi, xtol=1e-14) for k in range(n)]
    return np.square(zeros)


def hanging_chain(n: int) -> np.ndarray:
    """First n angular frequencies in sqrt(g / L): half the zeros of the Bessel function J0."""
    return jn_zeros(0, n) / 2


def pendulums(n: int) -> np.ndarray:
    """Squared frequencies in g / l of n equal links l with equal masses at their ends.

    They are the zeros of the Laguerre polynomial L_n.
    """
    return roots_laguerre(n)[0]


def large_pendulum(angle: float) -> float:
    """Period over that of small swings, 2 K(sin^2(angle / 2)) / pi."""
    return float(2 / math.pi * ellipk(math.sin(angle / 2) ** 2))
