"""The table `[control]` of a scene file, optional; it goes with `[[sensors]]` and `[estimation]`.

Keys marked * may be left out.

    [control]                   fields of `dtcasadi.control.Control`
    step, plant_step *, delay *                 [s]
    horizon, method *, terminal * = "riccati" | "none", blocks *
    outputs = ["tip", ...]      names of sensors; channels * = [["y"], ...]
    weight *                    [1/unit^2 of the output], one number or one for each channel
    change *, level *           [1/Pa^2]; _per_kpa2
    minimum *, maximum * [Pa], rate * [Pa/s]    one number or one for each command
    measured * = ["tip", ...]   sensors that the estimator reads

    [control.reference]         what is asked for: where the true robot rests at these pressures
    times, values [Pa], kind * = "step" | "linear"

    [[control.keep_out]] *      output, centre, radius or normal, offset [m]; linear *, quadratic *
"""

from typing import Any

import numpy as np

from .control import Control, KeepOut
from .errors import SceneError
from .scene_settings import read_profile
from .scene_tables import Table, given
from .scene_units import LENGTH, PRESSURE, PRESSURE_RATE, PURE, TIME, Factor, Unit

PRICE = Unit("1/Pa^2", per_kpa2=Factor(1, 1e6))
_NAMES = "a list of names"


def read_control(table: Table | None, n_chambers: int | None) -> Control | None:
    """The numbers of `[control]`; None where there is no such table."""
    if table is None:
        return None
    n = n_chambers or 1
    fields: dict[str, Any] = {
        "step_s": table.number("step", TIME, positive=True),
        "plant_step_s": table.number("plant_step", TIME, default=None, positive=True),
        "delay_s": table.number("delay", TIME, default=None, nonnegative=True),
        "horizon": table.integer("horizon", 1, 10_000),
        "method": table.text("method", "a one-step method", str.isidentifier, default=None),
        "terminal": table.choice("terminal", ("riccati", "none"), default=None),
        "outputs": _names(table, "outputs"),
        "measured": _names(table, "measured", default=None),
        "weight": _numbers(table, "weight", PURE),
        "change": table.row("change", n, PRICE, default=None),
        "level": table.row("level", n, PRICE, default=None),
        "minimum": table.row("minimum", n, PRESSURE, default=None),
        "maximum": table.row("maximum", n, PRESSURE, default=None),
        "rate": table.row("rate", n, PRESSURE_RATE, default=None),
    }
    blocks = table.array("blocks", (None,), default=None)
    fields["blocks"] = None if blocks is None else tuple(int(k) for k in blocks)
    channels = table.take("channels", "a list of lists of names", default=None)
    fields["channels"] = None if channels is None else _listed(table, channels[0])
    reference = table.table("reference")
    if reference is not None:
        fields["reference"] = read_profile(reference, n_chambers, PRESSURE)
    contents = table.tables("keep_out", default=())
    parts = [
        Table(table.faults, f"control.keep_out[{number}]", content)
        for number, content in enumerate(contents, 1)
    ]
    found = [_keep_out(part) for part in parts]
    fields["keep_out"] = tuple(zone for zone in found if zone is not None)
    table.close()
    if not table.sound or not all(part.sound for part in parts) or "reference" not in fields:
        return None
    if fields["reference"] is None:
        return None
    try:
        return Control(**given(fields))
    except SceneError as error:
        table.faults.add(table.path, "a control problem", str(error))
        return None


def _keep_out(part: Table) -> KeepOut | None:
    fields: dict[str, Any] = {"output": part.text("output", "a sensor", str.isidentifier)}
    if part.holds("radius", LENGTH):
        fields["centre"] = part.array("centre", (3,), LENGTH)
        fields["radius"] = part.number("radius", LENGTH, positive=True)
    else:
        fields["normal"] = part.array("normal", (3,))
        fields["offset"] = part.number("offset", LENGTH)
    for name in ("linear", "quadratic"):
        fields[name] = part.number(name, default=None, nonnegative=True)
    part.close()
    return KeepOut(**given(fields)) if part.sound else None


def _names(table: Table, key: str, **default: Any) -> tuple[str, ...] | None:
    found = table.take(key, _NAMES, **default)
    if found is None:
        return None
    names = [found[0]] if isinstance(found[0], str) else found[0]
    if isinstance(names, list) and all(isinstance(name, str) for name in names):
        return tuple(names)
    table.fault(key, _NAMES, repr(names)[:60])
    return None


def _listed(table: Table, lists: Any) -> tuple[tuple[str, ...], ...] | None:
    fits = isinstance(lists, list) and all(
        isinstance(names, list) and all(isinstance(name, str) for name in names) for names in lists
    )
    if fits:
        return tuple(tuple(names) for names in lists)
    table.fault("channels", "a list of lists of names", repr(lists)[:60])
    return None


def _numbers(table: Table, key: str, unit: Unit) -> float | np.ndarray | None:
    """One number, or a list of any length."""
    if isinstance(table.peek(key, unit), list):
        return table.array(key, (None,), unit)
    return table.number(key, unit, default=None, nonnegative=True)
