"""The tables of a scene file beside `[robot]`; their keys are listed in `dtcasadi.scene`."""

import re
from typing import Any

import numpy as np

from . import checks
from .charts import CHARTS, Chart, charts_of
from .measure import Measure
from .profile import Profile
from .scene_actuator import read_actuator
from .scene_tables import LINE, Table, given, is_line, one_of
from .scene_units import ANGLE, ANGLE_RATE, PRESSURE, PURE, TIME, Unit

Charts = tuple[Chart, ...] | None  # None: faults hide them
DEFAULT_CHART = "cardan"
_COORDINATES = tuple(dict.fromkeys(n for c in CHARTS.values() for n in c.coordinate_names))
_NO_CHAMBERS = "no pressure for a robot without chambers"
# Of a scene that comes with the package: no path.
_SHIPPED = re.compile(r"([a-z0-9_]+/)?[a-z0-9_]+")
_METHOD = "the name of an integration method"


def read_model(
    table: Table, n_segments: int | None, n_chambers: int | None
) -> tuple[dict[str, Any], Charts]:
    """Options of `dtcasadi.build`, those that `[model]` gives, and the charts."""
    options: dict[str, Any] = {"chart": DEFAULT_CHART}
    charts = _read_chart(table, n_segments, options)
    for key, choices in {
        "velocity_terms": ("full", "paper", "none"),
        "damping": ("physical", "coordinate"),
        "inflation": ("last_disc", "volume"),
    }.items():
        options |= given({key: table.choice(key, choices, default=None)})
    options |= given({"actuator": read_actuator(table, n_chambers)})
    table.close()
    return options, charts


def read_initial(
    table: Table, n_segments: int | None, charts: Charts, n_chambers: int | None
) -> dict[str, Any]:
    """Fields of `Scene` from `[initial]`; `charts` are the model's."""
    own: dict[str, Any] = {}
    if table.take("chart", "", default=None):
        charts = _read_chart(table, n_segments, own)
    n_q = None if charts is None else sum(chart.words.n_q for chart in charts)
    still = np.zeros(n_q or 0)
    named = _read_named(table, charts)
    if named is not None and table.holds("q", ANGLE):
        table.fault("q", "either q or named coordinates", "both")
    q = table.array("q", (n_q,), ANGLE, default=still)
    qd = table.array("qd", (n_q,), ANGLE_RATE, default=still)
    fields = {
        "q0": q if named is None else named,
        "qd0": qd,
        "initial_chart": own.get("chart"),
        "initial_pressure": table.row("pressure", n_chambers, PRESSURE, default=None),
    }
    if n_chambers == 0 and table.holds("pressure", PRESSURE):
        table.fault("pressure", _NO_CHAMBERS, "one")
    table.close()
    return given(fields)


def read_command(top: Table, n_chambers: int | None, actuator: Any) -> Profile | None:
    """The command of `[pressure]`, or of `[opening]` for valves; zero where there is none."""
    asked = "pressure" if isinstance(actuator, str | None) else actuator.command
    other = {"pressure": "opening", "opening": "pressure"}[asked]
    table = top.table(asked, default=None)
    if top.take(other, "", default=None):
        got = f"[{other}], which goes with another actuator"
        top.fault(other, f"a table [{asked}], the actuator's command", got)
        return None
    if table is None:
        return Profile.constant(np.zeros(n_chambers or 0))
    if n_chambers == 0:
        table.fault("", _NO_CHAMBERS, "one")
        return None
    return read_profile(table, n_chambers, PRESSURE if asked == "pressure" else PURE)


def read_profile(table: Table, n_chambers: int | None, unit: Unit) -> Profile | None:
    """Values against time from a table."""
    if not table.holds("times", TIME) and not table.holds("values", unit):
        value = table.row("value", n_chambers, unit)
        for key, each in (("times", TIME), ("values", unit)):
            table.take(key, "", each, default=None)
        table.close()
        return table.make(Profile.constant, value)
    times = table.array("times", (None,), TIME)
    raw = table.peek("values", unit)
    nested = isinstance(raw, list) and any(isinstance(entry, list) for entry in raw)
    values = table.array("values", (None, n_chambers) if nested else (None,), unit)
    kind = table.choice("kind", ("step", "linear"), default="step")
    table.close()
    if not nested:
        values = np.repeat(values[:, np.newaxis], n_chambers or 1, axis=1)
    return table.make(Profile, times, values, kind)


def read_run(table: Table) -> dict[str, Any]:
    """Fields of `Scene` from `[run]`."""
    fields = {
        "t_end": table.number("t_end", TIME, positive=True),
        "rtol": table.number("rtol", default=None, positive=True),
        "atol": table.number("atol", default=None, positive=True),
        "step_s": table.number("step", TIME, default=None, positive=True),
        "fixed": table.choice("steps", ("adaptive", "fixed"), default="adaptive") == "fixed",
        "method": table.text("method", _METHOD, _is_method_name, default=None),
    }
    if fields["rtol"] is not None and fields["rtol"] >= 1:
        table.fault("rtol", "a number below 1", fields["rtol"])
    table.close()
    return given(fields)


def read_measure(table: Table) -> Measure:
    """The measure of `[measure]`."""
    fields = {
        "text": table.text("text", LINE, is_line, default=None),
        "smallest_step_s": table.number("smallest_step", TIME, default=None, positive=True),
        "bound_of": table.text("bound_of", "the name of a scene", _is_shipped, default=None),
    }
    table.close()
    return table.make(Measure, **given(fields)) or Measure()


def _read_chart(table: Table, n_segments: int | None, options: dict[str, Any]) -> Charts:
    """The chart of each segment; the key as given goes into the options."""
    expected = f"{one_of(CHARTS)}, or a list of them"
    found = table.take("chart", expected, default=None)
    value = options.get("chart", DEFAULT_CHART) if found is None else found[0]
    names = value if isinstance(value, list) else [value]
    if any(not isinstance(name, str) or name not in CHARTS for name in names):
        table.fault("chart", expected, checks.shown(value))
        return None
    if n_segments is None:
        return None
    if isinstance(value, list) and len(value) != n_segments:
        table.fault("chart", f"1 or {n_segments} names", len(value))
        return None
    options["chart"] = tuple(value) if isinstance(value, list) else value
    return charts_of(options["chart"], n_segments)


def _read_named(table: Table, charts: Charts) -> np.ndarray | None:
    """The pose from coordinates given by name, the others zero; None if none is given."""
    held = [name for name in _COORDINATES if table.holds(name, ANGLE)]
    common = [n for n in _COORDINATES if charts and all(n in c.coordinate_names for c in charts)]
    for name in [name for name in held if name not in common]:
        table.take(name, "", ANGLE, default=None)
        if charts is not None:
            kinds = one_of(dict.fromkeys(chart.name for chart in charts))
            table.fault(name, f"a coordinate of every segment (chart {kinds})", "another one")
    if charts is None:
        return None
    still = np.zeros(len(charts))
    angles = {name: table.row(name, len(charts), ANGLE, default=still) for name in common}
    if not held or not table.sound:
        return None
    names = [(i, name) for i, chart in enumerate(charts) for name in chart.coordinate_names]
    return np.array([angles.get(name, still)[i] for i, name in names])


def _is_shipped(text: str) -> bool:
    return len(text) <= 120 and _SHIPPED.fullmatch(text) is not None


def _is_method_name(text: str) -> bool:
    return text.isascii() and text.isidentifier() and len(text) <= 60
