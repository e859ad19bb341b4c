"""The tables `[[sensors]]` and `[estimation]` of a scene file, both optional.

Keys marked * may be left out.

    [[sensors]]                 what is measured; see `dtcasadi.sensors`
    kind = "pressure" | "imu" | "marker" | "orientation" | "bend" | "lengths" | "coordinates"
    name, period * [s], latency * [s], dropout *
    noise                       or gyroscope_noise [rad/s], accelerometer_noise [m/s^2] of an imu
    disc                        of an imu, marker, orientation, bend
    point *, position *         of a marker; of an imu, with
                                orientation * (angles as bend), biases * = true
    numbers = [1, ...]          of coordinates
    discs = [[i, j], ...], start, end       of lengths: points on discs i and j

    [estimation]                fields of `dtcasadi.estimation.Estimation`, step in [s]

    [estimation.bounds] *       of the moving horizon estimator, in SI units, `inf` for none:
    "wrench[2]" = [0, inf]      name of a state or of an entry of the contact wrench
"""

import re
from typing import Any

import numpy as np

from . import checks
from .errors import ModelError, SceneError
from .estimation import Estimation
from .sampled import NAME_PATTERN, Sampled
from .scene_rotation import read_rotation
from .scene_tables import Table, given
from .scene_units import ANGLE, ANGLE_RATE, LENGTH, MASS, PRESSURE, TIME
from .sensors import IMU, Bend, Coordinates, Lengths, Marker, Orientation, PressureSensor

KINDS = ("pressure", "imu", "marker", "orientation", "bend", "lengths", "coordinates")
MAX_SENSORS = 256
_UNITS = {
    "pressure": PRESSURE,
    "marker": LENGTH,
    "orientation": ANGLE,
    "bend": ANGLE,
    "lengths": LENGTH,
    "coordinates": ANGLE,
}


def read_sensors(top: Table, n_discs: int | None, n_chambers: int | None) -> tuple[Sampled, ...]:
    """The sensors of `[[sensors]]`."""
    contents = top.tables("sensors", default=())
    if len(contents) > MAX_SENSORS:
        top.fault("sensors", f"at most {MAX_SENSORS}", len(contents))
        return ()
    found: list[Sampled] = []
    for number, content in enumerate(contents, 1):
        part = Table(top.faults, f"sensors[{number}]", content)
        sensor = _read_sensor(part, n_discs or 2, n_chambers or 1)
        if sensor is not None:
            if any(sensor.name == other.name for other in found):
                part.fault("name", "a name of its own", repr(sensor.name))
            found.append(sensor)
    return tuple(found)


def _read_sensor(part: Table, n_discs: int, n_chambers: int) -> Sampled | None:
    kind = part.choice("kind", KINDS)
    fits = re.compile(NAME_PATTERN).fullmatch
    fields: dict[str, Any] = {
        "name": part.text("name", "lower-case words joined by _", fits),
        "period_s": part.number("period", TIME, default=None, positive=True),
        "latency_s": part.number("latency", TIME, default=None, nonnegative=True),
        "dropout": part.number("dropout", default=None, nonnegative=True),
    }
    if kind == "imu":
        gyro = part.number("gyroscope_noise", ANGLE_RATE, positive=True)
        accelerometer = part.number("accelerometer_noise", positive=True)
        fields["noise"] = np.repeat([gyro, accelerometer], 3)
    elif kind:
        fields["noise"] = part.number("noise", _UNITS[kind], positive=True)
    if kind in ("imu", "marker", "orientation", "bend"):
        fields["disc"] = part.integer("disc", 1, n_discs)
    make: Any = {
        "pressure": PressureSensor,
        "imu": IMU,
        "marker": Marker,
        "orientation": Orientation,
        "bend": Bend,
        "lengths": Lengths,
        "coordinates": Coordinates,
    }.get(kind)
    if kind == "marker":
        fields["point"] = part.array("point", (3,), LENGTH, default=None)
    elif kind == "imu":
        fields["position"] = part.array("position", (3,), LENGTH, default=None)
        fields["orientation"] = read_rotation(part, "orientation")
        found = part.take("biases", "true or false", default=None)
        if found is not None:
            if not isinstance(found[0], bool):
                part.fault("biases", "true or false", repr(found[0]))
            fields["biases"] = found[0]
    elif kind == "pressure":
        fields["chambers"] = tuple(range(1, n_chambers + 1))
    elif kind == "coordinates":
        numbers = part.array("numbers", (None,))
        fields["numbers"] = tuple(int(k) for k in numbers) if part.sound else ()
    elif kind == "lengths":
        discs = part.array("discs", (None, 2))
        ends = [part.array(key, (len(discs), 3), LENGTH) for key in ("start", "end")]
        rows = zip(discs.astype(int) if part.sound else (), *ends, strict=False)
        fields["spans"] = tuple(((int(a), p), (int(b), q)) for (a, b), p, q in rows)
    part.close()
    if not part.sound or make is None:
        return None
    try:
        return make(**given(fields))
    except ModelError as error:
        part.faults.add(part.path, "a sensor", str(error))
        return None


def read_estimation(table: Table | None) -> Estimation | None:
    """The numbers of `[estimation]`; None where there is no such table."""
    if table is None:
        return None
    names = {
        "step_s": ("step", TIME),
        "angle_sigma": ("angle_sigma", ANGLE),
        "rate_sigma": ("rate_sigma", ANGLE_RATE),
        "pressure_sigma": ("pressure_sigma", PRESSURE),
        "contact_from": ("contact_from", TIME),
        "contact_to": ("contact_to", TIME),
        "offset": ("offset", ANGLE),
        "truth_hysteresis": ("truth_hysteresis", PRESSURE),
        "truth_payload": ("truth_payload", MASS),
    }
    fields: dict[str, Any] = {
        name: table.number(key, unit, default=None, nonnegative=True)
        for name, (key, unit) in names.items()
    }
    for name in ("force_sigma", "force_walk", "moment_sigma", "moment_walk"):
        fields[name] = table.row(name, 3, default=None)
    for name in ("force_noise", "rate_noise", "gate", "truth_stiffness"):
        fields[name] = table.number(name, default=None, nonnegative=True)
    fields["contact_force"] = table.array("contact_force", (3,), default=None)
    for name, most in (("disc", 4096), ("seed", 2**31), ("caution", 20), ("truth_discs", 4096)):
        fields[name] = table.integer(name, 0, most, default=-1)
        fields[name] = None if fields[name] < 0 else fields[name]
    fields["method"] = table.text(
        "method", "the name of a one-step method", str.isidentifier, default=None
    )
    bounds = table.table("bounds", default=None)
    if bounds is not None:
        fields["bounds"] = bounds.named(checks.limits)
    table.close()
    if not (table.sound and (bounds is None or bounds.sound)):
        return None
    try:
        return Estimation(**given(fields))
    except SceneError as error:
        table.faults.add(table.path, "numbers of an estimation", str(error))
        return None
