"""The `[robot.tube]` and `[robot.rod]` tables of a scene file, listed in `dtcasadi.scene`."""

from typing import Any, NamedTuple

import numpy as np

from .beam import MAX_DISCS
from .robot import Robot
from .rod import Cell, Rod
from .scene_tables import Table, given
from .scene_units import (
    ANGLE,
    AREA,
    BENDING,
    COMPLIANCE,
    DENSITY,
    FORCE,
    LENGTH,
    LINE_DENSITY,
    MASS,
    MODULUS,
    PRESSURE,
    PURE,
    TIME,
    Unit,
)
from .tube import FABRICS, Tube

Beam = Tube | Rod
BEAMS = ("tube", "rod")

# Keys with one positive number each, in the order of the fields of `Tube` and of `Rod`.
_TUBE = {
    "length": LENGTH,
    "radius": LENGTH,
    "wall_thickness": LENGTH,
    "youngs_modulus": MODULUS,
}
_ROD = {
    "length": LENGTH,
    "bending_stiffness": BENDING,
    "shear_stiffness": FORCE,
    "twisting_stiffness": BENDING,
    "mass_per_length": LINE_DENSITY,
}


class BeamPart(NamedTuple):
    """A beam, its number of discs and the robot it is cut into; None where faults hide them."""

    beam: Beam | None
    n_discs: int | None
    robot: Robot | None


def read_beam(table: Table, up: np.ndarray, gravity: float) -> BeamPart | None:
    """The beam that a `[robot]` table describes, if it does."""
    kinds = [kind for kind in BEAMS if table.holds(kind)]
    if not kinds:
        return None
    part = table.table(kinds[0])
    if part is None:
        return BeamPart(None, None, None)
    n_discs = part.integer("n_discs", 2, MAX_DISCS)
    shared = {
        "payload": _number(part, "payload", MASS, nonnegative=True),
        "bend": _bend(part),
        "twist": _number(part, "twist", ANGLE),
        "retardation_time": _number(part, "retardation_time", TIME, nonnegative=True),
        "up": up,
        "gravity": gravity,
    }
    beam = (_read_tube if kinds[0] == "tube" else _read_rod)(part, given(shared))
    robot = None if beam is None else part.make(beam.robot, n_discs)
    return BeamPart(beam, n_discs if part.sound else None, robot)


def _read_tube(part: Table, shared: dict[str, Any]) -> Tube | None:
    sizes = [part.number(key, unit, positive=True) for key, unit in _TUBE.items()]
    material = [part.number("poissons_ratio"), part.number("density", DENSITY, positive=True)]
    options = {
        "fabric": part.choice("fabric", FABRICS, default=None),
        "chambers": part.integer("chambers", 0, 256, default=1),
        "strip_turns": part.array("strip_turns", (None,), ANGLE, default=None),
        "rated_pressure": _number(part, "rated_pressure", PRESSURE, positive=True),
        "radial_compliance": _number(part, "radial_compliance", COMPLIANCE, nonnegative=True),
        "posts": part.integer("posts", 4, 64, default=4),
    }
    part.close()
    return part.make(Tube, *sizes, *material, **given(options), **shared)


def _read_rod(part: Table, shared: dict[str, Any]) -> Rod | None:
    sizes = [part.number(key, unit, positive=True) for key, unit in _ROD.items()]
    radius = given({"radius": _number(part, "radius", LENGTH, positive=True)})
    cells = []
    for number, content in enumerate(part.tables("cells", default=()), 1):
        cell = Table(part.faults, f"{part.path}.cells[{number}]", content)
        area = cell.number("area", AREA, positive=True)
        centroid = cell.array("centroid", (2,), LENGTH)
        rated = _number(cell, "rated_pressure", PRESSURE, positive=True)
        cell.close()
        cells.append(cell.make(Cell, area, centroid, rated))
    part.close()
    if None in cells:
        part.sound = False
    return part.make(Rod, *sizes, cells=cells, **radius, **shared)


def _number(part: Table, key: str, unit: Unit = PURE, **bounds: bool) -> Any:
    """A number in SI units that may be left out."""
    return part.number(key, unit, default=None, **bounds)


def _bend(part: Table) -> Any:
    """An angle about x, or a pair about x and y."""
    if isinstance(part.peek("bend", ANGLE), list):
        return part.array("bend", (2,), ANGLE)
    return _number(part, "bend", ANGLE)
