"""Flow of air through an orifice, choked or subsonic."""

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np

from .. import checks
from .fields import Each, checked, refusal
from .smooth import Number, positive

# Air, and the reference atmosphere of ISO 8778 at which conductances are stated.
GAS_CONSTANT, HEAT_RATIO = 287.06, 1.4  # [J/(kg K)]; c_p / c_v
REFERENCE_PRESSURE, REFERENCE_TEMPERATURE = 1e5, 293.15  # [Pa], [K]
# Air of temperature REFERENCE_TEMPERATURE: m R T [J] is its pressure times its volume.
SPECIFIC = GAS_CONSTANT * REFERENCE_TEMPERATURE  # [J/kg]
# Share of the pressure below which a difference drives a flow in proportion to it (ISO 6358 speaks
# of pressure ratios of 0.999), and width in the pressure ratio of the passage into choked flow.
LAMINAR, SWITCH = 1e-3, 0.02
LARGEST_RATIO = 0.9
_FULL = 2 / (1 + math.sqrt(1 + SWITCH**2))  # makes the smooth subsonic share 1 without a difference


@dataclass(frozen=True)
class Orifice:
    r"""An orifice by sonic conductance and critical pressure ratio, ISO 6358.

    Mass flow from p1 down to p2 (absolute), the upstream air at temperature T1:

    .. math::
        \dot m = C \rho_0 p_1 \sqrt{T_0 / T_1}\, \varphi(p_2 / p_1), \quad
        \varphi(r) = 1 \text{ for } r \le b, \quad
        \sqrt{1 - \left(\frac{r - b}{1 - b}\right)^2} \text{ above}

    (ISO 6358-1; Beater, Pneumatic Drives, section 4.2). At both ends of the subsonic range it is
    smoothed: |p1 - p2| becomes sqrt((p1 - p2)^2 + (LAMINAR p)^2), and max(r - b, 0) a smooth one of
    width SWITCH (1 - b). The flow stays odd in p1 - p2, zero without a difference and never larger
    than the choked one.

    Attributes:
        conductance: sonic conductance C [m^3/(s Pa)]: flow of air at reference conditions per
            pressure upstream when choked; 1 l/(s bar) is 1e-8.
        critical_ratio: b, the pressure ratio below which the flow is choked; 0.528 for a nozzle,
            0.2 to 0.5 for valves.

    Raises:
        ActuatorError: a field out of range.
    """

    conductance: Each
    critical_ratio: Each = 0.3

    def __post_init__(self) -> None:
        """Check both fields."""
        checked("orifice", self, ("conductance",), positive=True)
        checked("orifice", self, ("critical_ratio",), nonnegative=True)
        if np.max(self.critical_ratio) > LARGEST_RATIO:
            expected = f"a number up to {LARGEST_RATIO:g}"
            raise refusal("orifice.critical_ratio", expected, self.critical_ratio)

    @classmethod
    def from_hole(cls, diameter: float, discharge_coefficient: float = 0.8) -> "Orifice":
        r"""A sharp hole as an ideal nozzle of reduced area.

        .. math::
            C \rho_0 \sqrt{T_0} = c_d A \sqrt{\frac{\gamma}{R}}
            \left(\frac{2}{\gamma + 1}\right)^{\frac{\gamma + 1}{2 (\gamma - 1)}}

        (Anderson, Modern Compressible Flow, section 5.4.)

        Args:
            diameter: of the hole [m].
            discharge_coefficient: c_d, area of the jet over that of the hole.
        """
        diameter = checks.number("orifice.diameter", diameter, positive=True, error=refusal)
        share = checks.number(
            "orifice.discharge_coefficient", discharge_coefficient, positive=True, error=refusal
        )
        density = REFERENCE_PRESSURE / SPECIFIC
        power = (HEAT_RATIO + 1) / (2 * (HEAT_RATIO - 1))
        choked = math.sqrt(HEAT_RATIO / SPECIFIC) * (2 / (HEAT_RATIO + 1)) ** power
        ratio = (2 / (HEAT_RATIO + 1)) ** (HEAT_RATIO / (HEAT_RATIO - 1))
        return cls(share * math.pi / 4 * diameter**2 * choked / density, ratio)

    def flow(self, p1: ca.SX, p2: ca.SX, warmth1: Number = 1.0, warmth2: Number = 1.0) -> ca.SX:
        """Flow from p1 to p2 (absolute) as pressure times volume at T0 [Pa m^3/s = J/s].

        Args:
            p1: pressure on one side [Pa].
            p2: pressure on the other [Pa].
            warmth1: T1 / T0 on one side.
            warmth2: T2 / T0 on the other.
        """
        # Products rather than quotients of numbers: they are cheaper.
        mean, difference = 0.5 * (p1 + p2), p1 - p2
        size = ca.sqrt(difference**2 + (LAMINAR * mean) ** 2)
        high, low = mean + 0.5 * size, mean - 0.5 * size
        b, direction = self.critical_ratio, difference / size
        subsonic = _FULL * positive((low / high - b) * (1 / (1 - b)), SWITCH)
        choked = (REFERENCE_PRESSURE * self.conductance) * high
        flow = choked * ca.sqrt(1 - subsonic**2) * direction
        if warmth1 is warmth2:
            return flow
        upstream = (warmth1 + warmth2 + direction * (warmth1 - warmth2)) / 2
        return flow / ca.sqrt(upstream)
