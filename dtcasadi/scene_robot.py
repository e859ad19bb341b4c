"""The `[robot]` table of a scene file; its keys are listed in `dtcasadi.scene`."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from . import checks
from .robot import STANDARD_GRAVITY, Chamber, Damping, Disc, Robot, Thread
from .scene_beams import Beam, BeamPart, read_beam
from .scene_constraints import read_constraints
from .scene_forces import read_forces
from .scene_obstacles import read_plates
from .scene_rotation import read_rotation
from .scene_springs import Discs, read_span, read_springs
from .scene_tables import Table, given
from .scene_units import (
    ACCELERATION,
    AREA,
    COMPLIANCE,
    INERTIA,
    LENGTH,
    MASS,
    PRESSURE,
    SEGMENT_DAMPING,
)

MAX_DISCS, MAX_CHAMBERS, MAX_CORNERS = 4096, 256, 1024


class RobotPart(NamedTuple):
    """What the rest of a scene needs of its robot; None where faults hide it."""

    robot: Robot | None
    n_discs: int | None
    n_chambers: int | None
    beam: Beam | None = None


def read_robot(table: Table) -> RobotPart:
    """The robot of a `[robot]` table."""
    before = len(table.faults)
    up = table.array("up", (3,), default=np.array([0.0, 1.0, 0.0]))
    up = table.make(checks.unit, "up", up)
    gravity = table.number("gravity", ACCELERATION, default=STANDARD_GRAVITY, nonnegative=True)
    part = read_beam(table, up, gravity)
    if part:
        return _of_beam(table, part, before)
    discs = _read_discs(table)
    threads = _read_parts(table, "threads", discs.number, _read_thread)
    springs = read_springs(table, discs)
    chambers = _read_chambers(table, discs.number)
    damping = _read_damping(table, discs.number)
    forces = read_forces(table, discs)
    constraints, plates = read_constraints(table, discs.number), read_plates(table)
    table.close()
    robot = None
    if len(table.faults) == before:
        parts = (discs.discs, threads, springs, chambers, damping)
        acting = {"forces": forces, "constraints": constraints, "plates": plates}
        robot = table.make(Robot, *parts, up=up, gravity=gravity, **acting)
    return RobotPart(robot, discs.number, None if chambers is None else len(chambers))


def _of_beam(table: Table, part: BeamPart, before: int) -> RobotPart:
    """The robot that a tube or a rod is cut into, with its forces."""
    beam, n_discs, robot = part
    if beam is None or n_discs is None or robot is None:
        read_forces(table, Discs([], [], None))
        read_constraints(table, None)
        read_plates(table)
        table.close()
        return RobotPart(None, n_discs, None)
    forces = read_forces(table, Discs(list(robot.discs), [beam.radius] * n_discs, n_discs))
    constraints, plates = read_constraints(table, n_discs), read_plates(table)
    table.close()
    if len(table.faults) == before:
        robot = table.make(replace, robot, forces=forces, constraints=constraints, plates=plates)
    return RobotPart(robot, n_discs, len(robot.chambers), beam)


def _numbered(table: Table, key: str) -> tuple[list[tuple[Table, int]], bool]:
    """Each table of a repeated part with its `count`, and whether the counts hold no fault.

    The parts are numbered through: after a table with count = 3 comes number 4.
    """
    before, number, parts = len(table.faults), 1, []
    for content in table.tables(key):
        part = Table(table.faults, f"{table.path}.{key}[{number}]", content)
        count = part.integer("count", 1, MAX_DISCS, default=1)
        parts.append((part, count))
        number += count
        if number - 1 > MAX_DISCS:
            part.fault("count", f"at most {MAX_DISCS} {key} in all", number - 1)
            break
    return parts, len(table.faults) == before


def _read_discs(table: Table) -> Discs:
    parts, counted = _numbered(table, "discs")
    discs: list[Disc | None] = []
    radii: list[float | None] = []
    for part, count in parts:
        disc, radius = _read_disc(part)
        discs += [disc] * count
        radii += [radius] * count
    if counted and len(discs) < 2:
        table.fault("discs", "at least 2 discs, the root included", len(discs))
        counted = False
    return Discs(discs, radii, len(discs) if counted else None)


def _read_disc(part: Table) -> tuple[Disc | None, float | None]:
    """A disc, and its radius if it is round."""
    shape = part.choice("shape", ("hoop", "solid", "polygon", "custom"))
    mass = part.number("mass", MASS, positive=True)
    if shape in ("hoop", "solid"):
        radius = part.number("radius", LENGTH, positive=True)
        part.close()
        return part.make(Disc.hoop if shape == "hoop" else Disc.solid, mass, radius), radius
    if shape == "polygon":
        corners = part.array("vertices", (None, 2), LENGTH)
        if len(corners) > MAX_CORNERS:
            part.fault("vertices", f"at most {MAX_CORNERS} corners", len(corners))
        part.close()
        return part.make(Disc.polygon, mass, corners), None
    if shape == "custom":
        inertia = part.array("inertia", (3, 3), INERTIA)
        point, outline = (3,), (None, 3)
        fields = {
            "centre_of_mass": part.array("centre_of_mass", point, LENGTH, default=None),
            "area": part.number("area", AREA, default=None, nonnegative=True),
            "centroid": part.array("centroid", point, LENGTH, default=None),
            "outline": part.array("outline", outline, LENGTH, default=None),
        }
        part.close()
        return part.make(Disc, mass, inertia, **given(fields)), None
    return None, None


def _read_parts(
    table: Table, key: str, n_discs: int | None, read: Callable[[Table], Any]
) -> list[Any]:
    """A part that each segment has one of."""
    parts, counted = _numbered(table, key)
    made = [part for table, count in parts for part in [read(table)] * count]
    if counted and n_discs is not None and len(made) != n_discs - 1:
        table.fault(key, f"{n_discs - 1} for {n_discs} discs", len(made))
    return made


def _read_thread(part: Table) -> Thread | None:
    length = part.number("length", LENGTH, positive=True)
    fields = {
        "exit_point": part.array("exit_point", (3,), LENGTH, default=None),
        "bend": read_rotation(part, "bend"),
        "twist": read_rotation(part, "twist"),
    }
    part.close()
    return part.make(Thread, length, **given(fields))


def _read_chambers(table: Table, n_discs: int | None) -> list[Chamber | None] | None:
    before, chambers = len(table.faults), []
    contents = table.tables("chambers", default=())
    if len(contents) > MAX_CHAMBERS:
        table.fault("chambers", f"at most {MAX_CHAMBERS}", len(contents))
    if len(table.faults) > before:
        return None
    for number, content in enumerate(contents, 1):
        part = Table(table.faults, f"{table.path}.chambers[{number}]", content)
        span = read_span(part, n_discs, "the first and the last disc number")
        fields = {
            "areas": part.array("areas", (None,), AREA, default=None),
            "centroids": part.array("centroids", (None, 3), LENGTH, default=None),
            "rated_pressure": part.number("rated_pressure", PRESSURE, default=None, positive=True),
            "radial_compliance": part.number(
                "radial_compliance", COMPLIANCE, default=None, nonnegative=True
            ),
        }
        part.close()
        chambers.append(part.make(Chamber, span, **given(fields)) if span else None)
    return chambers


def _read_damping(table: Table, n_discs: int | None) -> Any:
    """One `[robot.damping]` for all segments, or `[[robot.damping]]` for each."""
    if isinstance(table.peek("damping"), list):
        return _read_parts(table, "damping", n_discs, _read_damping_table)
    whole = table.table("damping", default=None)
    return Damping() if whole is None else _read_damping_table(whole)


def _read_damping_table(part: Table) -> Damping | None:
    names = ("c_a", "c_b", "c_w", "c_r")
    fields = {
        name: part.number(name, SEGMENT_DAMPING, default=0.0, nonnegative=True) for name in names
    }
    part.close()
    return part.make(Damping, **fields)
