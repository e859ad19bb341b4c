"""Units of parameters by their paths, and which of them are positive."""

from __future__ import annotations

import re

# Fields of the robot's parts; those behind `signed` may have any sign.
_UNITS = {
    "mass": "kg",
    "inertia": "kg m^2",
    "centre_of_mass": "m",
    "length": "m",
    "exit_point": "m",
    "start": "m",
    "end": "m",
    "stiffness": "N/m",
    "rest_length": "m",
    "areas": "m^2",
    "radial_compliance": "1/Pa",
    "c_a": "N m s/rad",
    "c_b": "N m s/rad",
    "c_w": "N m s/rad",
    "c_r": "N m s/rad",
    "gravity": "m/s^2",
    "up": "",
    "time_constant": "s",
    "vent_time_constant": "s",
    "response_time": "s",
    "creep_time": "s",
    "time": "s",
    "minimum": "Pa",
    "maximum": "Pa",
    "rate_limit": "Pa/s",
    "vent_rate_limit": "Pa/s",
    "supply_pressure": "Pa",
    "exhaust_pressure": "Pa",
    "atmosphere": "Pa",
    "dead_volume": "m^3",
    "conductance": "m^3/(s Pa)",
    "amplitude": "Pa",
    "break_in": "Pa",
    "band": "Pa",
    "blend": "Pa",
}
_SIGNED = {"centre_of_mass", "exit_point", "start", "end", "up", "exhaust_pressure", "minimum"}


def _field(name: str) -> tuple[str, str]:
    """Part and field of a path, without numbers."""
    plain = re.sub(r"\[\d+\]", "", name)
    part, _, field = plain.rpartition(".")
    return part.partition(".")[0], field


def unit_of(name: str) -> str:
    """The SI unit of a parameter, or '' where its path does not tell."""
    part, field = _field(name)
    if part == "springs" and field == "damping":
        return "N s/m"
    return "" if part == "forces" else _UNITS.get(field, "")


def is_positive(name: str) -> bool:
    """Whether the parameter is positive by its meaning."""
    part, field = _field(name)
    if part == "springs" and field == "damping":
        return True
    return part != "forces" and field in _UNITS and field not in _SIGNED
