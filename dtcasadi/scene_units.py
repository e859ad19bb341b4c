"""Units of the numbers in scene files: SI, or another one named by the key's suffix."""

import math
from typing import NamedTuple, TypeVar

import numpy as np

Numbers = TypeVar("Numbers", float, np.ndarray)


class Factor(NamedTuple):
    """A factor to SI units as a fraction of two exact numbers.

    35.2 mm becomes the double nearest to 0.0352 m, which a product with 1e-3 would miss.
    """

    numerator: float = 1.0
    denominator: float = 1.0

    def apply(self, value: Numbers) -> Numbers:
        """The value in SI units."""
        return value * self.numerator / self.denominator


class Unit:
    """An SI unit, and the suffixes of keys whose numbers are in another one."""

    def __init__(self, symbol: str, **suffixes: Factor) -> None:
        self.label = f" [{symbol}]" if symbol else ""
        self.suffixes = suffixes

    def variants(self, key: str) -> dict[str, Factor]:
        """Every way to write the key, with the factor of its numbers."""
        return {key: Factor()} | {f"{key}_{s}": factor for s, factor in self.suffixes.items()}


PURE = Unit("")
TIME = Unit("s", ms=Factor(1, 1e3))
MASS = Unit("kg", g=Factor(1, 1e3))
LENGTH = Unit("m", mm=Factor(1, 1e3), cm=Factor(1, 1e2))
AREA = Unit("m^2", mm2=Factor(1, 1e6), cm2=Factor(1, 1e4))
INERTIA = Unit("kg m^2", g_mm2=Factor(1, 1e9), kg_mm2=Factor(1, 1e6))
ANGLE = Unit("rad", deg=Factor(math.pi, 180))
ANGLE_RATE = Unit("rad/s", deg_per_s=Factor(math.pi, 180))
ACCELERATION = Unit("m/s^2")
VELOCITY = Unit("m/s", mm_per_s=Factor(1, 1e3), cm_per_s=Factor(1, 1e2))
SLOWNESS = Unit("s/m")
FORCE = Unit("N", mn=Factor(1, 1e3), kn=Factor(1e3))
MOMENT = Unit("N m", n_mm=Factor(1, 1e3))
STIFFENING = Unit("1/m^2", per_mm2=Factor(1e6))
QUADRATIC_DRAG = Unit("N s^2/m^2")
STIFFNESS = Unit("N/m", n_per_mm=Factor(1e3))
SPRING_DAMPING = Unit("N s/m", n_s_per_mm=Factor(1e3))
SEGMENT_DAMPING = Unit("N m s/rad", n_mm_s=Factor(1, 1e3))
PRESSURE = Unit("Pa", kpa=Factor(1e3), bar=Factor(1e5))
VOLUME = Unit("m^3", ml=Factor(1, 1e6), l=Factor(1, 1e3))
CONDUCTANCE = Unit("m^3/(s Pa)", l_per_s_bar=Factor(1, 1e8))
COMPLIANCE = Unit("1/Pa", per_kpa=Factor(1, 1e3), per_bar=Factor(1, 1e5))
PRESSURE_RATE = Unit("Pa/s", kpa_per_s=Factor(1e3), bar_per_s=Factor(1e5))
MODULUS = Unit("Pa", kpa=Factor(1e3), mpa=Factor(1e6), gpa=Factor(1e9))
DENSITY = Unit("kg/m^3")
LINE_DENSITY = Unit("kg/m", g_per_m=Factor(1, 1e3))
BENDING = Unit("N m^2")
