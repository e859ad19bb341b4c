"""The table `[model.actuator]` of a scene file; its keys are listed in `dtcasadi.scene`."""

from collections.abc import Mapping
from typing import Any

from .actuators import (
    Actuator,
    Delay,
    Direct,
    Gas,
    Hysteresis,
    Orifice,
    PressureValve,
    Regulator,
    Valve,
)
from .actuators.delay import MOST_LAGS
from .actuators.hysteresis import MOST_SHARP
from .scene_tables import Table, given
from .scene_units import (
    CONDUCTANCE,
    LENGTH,
    PRESSURE,
    PRESSURE_RATE,
    PURE,
    TIME,
    VOLUME,
    Unit,
)

Kind = Mapping[str, bool]
Keys = Mapping[str, tuple[Unit, Kind]]
_PLAIN: Kind = {}
_POSITIVE: Kind = {"positive": True}
_NONNEGATIVE: Kind = {"nonnegative": True}
_REGULATOR: Keys = {
    "time_constant": (TIME, _POSITIVE),
    "minimum": (PRESSURE, _PLAIN),
    "maximum": (PRESSURE, _PLAIN),
    "rate_limit": (PRESSURE_RATE, _POSITIVE),
    "vent_time_constant": (TIME, _POSITIVE),
    "vent_rate_limit": (PRESSURE_RATE, _POSITIVE),
    "blend": (PRESSURE, _POSITIVE),
}
_GAS: Keys = {
    "exhaust_pressure": (PRESSURE, _PLAIN),
    "exponent": (PURE, _POSITIVE),
    "dead_volume": (VOLUME, _NONNEGATIVE),
}
_HYSTERESIS: Keys = {
    "travel": (PURE, _POSITIVE),
    "creep_time": (TIME, _POSITIVE),
    "break_in": (PRESSURE, _NONNEGATIVE),
    "break_in_travel": (PURE, _POSITIVE),
}
_NAMES = ("direct", "regulator")


def read_actuator(table: Table, n_chambers: int | None) -> Any:
    """A name, or the value of a `[model.actuator]` table; None where there is none."""
    if not isinstance(table.peek("actuator"), dict):
        return table.choice("actuator", _NAMES, default=None)
    part = table.table("actuator")
    assert part is not None
    kind = part.choice("kind", (*_NAMES, "gas"))
    if not kind:
        return None
    source: Actuator | None = Direct()
    if kind == "regulator":
        source = part.make(Regulator, **_numbers(part, _REGULATOR, n_chambers))
    elif kind == "gas":
        source = _read_gas(part, n_chambers)
    hysteresis, delay = (part.table(key, default=None) for key in ("hysteresis", "delay"))
    if hysteresis is not None:
        source = _read_hysteresis(hysteresis, source, n_chambers)
    if delay is not None:
        source = _read_delay(delay, source)
    part.close()
    return source if part.sound else None


def _read_gas(part: Table, n: int | None) -> Gas | None:
    fields = _numbers(part, _GAS, n)
    fields["supply_pressure"] = _number(part, "supply_pressure", PRESSURE, n)
    fields |= given({"atmosphere": part.number("atmosphere", PRESSURE, default=None)})
    orifices = {key: part.table(key) for key in ("supply", "exhaust")}
    orifices["leak"] = part.table("leak", default=None)
    valve = part.table("valve", default=None)
    for key, own in orifices.items():
        if own is not None:
            fields[key] = _read_orifice(own, n)
    if valve is not None:
        fields["valve"] = _read_valve(valve, n)
    if any(fields.get(key, 0) is None for key in (*orifices, "valve")):
        return None
    return part.make(Gas, **fields)


def _read_orifice(part: Table, n: int | None) -> Orifice | None:
    """By its conductance, or by the diameter of a hole."""
    if part.holds("diameter", LENGTH):
        fields = {
            "diameter": part.number("diameter", LENGTH, positive=True),
            "discharge_coefficient": part.number(
                "discharge_coefficient", default=None, positive=True
            ),
        }
        part.close()
        return part.make(Orifice.from_hole, **given(fields))
    fields = {
        "conductance": _number(part, "conductance", CONDUCTANCE, n, positive=True),
        "critical_ratio": _number(part, "critical_ratio", PURE, n, default=None),
    }
    part.close()
    return part.make(Orifice, **given(fields))


def _read_valve(part: Table, n: int | None) -> Valve | PressureValve | None:
    command = part.choice("command", ("opening", "pressure"))
    fields = _numbers(part, {"response_time": (TIME, _POSITIVE)}, n)
    if command == "pressure":
        fields["band"] = _number(part, "band", PRESSURE, n, positive=True)
    lap = "underlap" if command == "pressure" else "overlap"
    fields[lap] = part.number(lap, default=None)
    part.close()
    return part.make(PressureValve if command == "pressure" else Valve, **given(fields))


def _read_hysteresis(part: Table, source: Actuator | None, n: int | None) -> Hysteresis | None:
    fields = _numbers(part, _HYSTERESIS, n)
    fields["amplitude"] = _number(part, "amplitude", PRESSURE, n, nonnegative=True)
    fields |= given({"sharpness": part.integer("sharpness", 2, MOST_SHARP, default=None)})
    part.close()
    return part.make(Hysteresis, source, **fields) if source else None


def _read_delay(part: Table, source: Actuator | None) -> Delay | None:
    fields = {
        "time": part.number("time", TIME, positive=True),
        "lags": part.integer("lags", 0, MOST_LAGS, default=None),
    }
    part.close()
    return part.make(Delay, source, **given(fields)) if source else None


def _numbers(part: Table, keys: Keys, n: int | None) -> dict[str, Any]:
    return given(
        {
            key: _number(part, key, unit, n, default=None, **kind)
            for key, (unit, kind) in keys.items()
        }
    )


def _number(part: Table, key: str, unit: Unit, n: int | None, **options: Any) -> Any:
    """A number for all chambers, or a list with one for each."""
    if isinstance(part.peek(key, unit), list):
        return part.array(key, (n,), unit)
    return part.number(key, unit, **options)
