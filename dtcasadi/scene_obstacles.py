"""The tables `[robot.plates]` and `[[obstacle]]` of a scene file.

Keys marked * may be left out.

    [robot.plates] *            discs do not pass through each other: friction *, restitution *,
                                rim_points *

    [[obstacle]] *              what discs may touch; see `dtcasadi.contact`
    kind = "half_space"         point, normal
    kind = "sphere"             centre, radius
    kind = "capsule"            start, end, radius
    kind = "box"                centre, size, orientation * (angles as bend), rounding *
    penetration *, load * [N]   how deep a rim point sinks in under a load (default: the weight);
                                without: rigid, by method "moreau", with restitution * = 0
    friction * = 0.5, slip_speed * = 0.01 [m/s], dissipation * = 0 [s/m], rim_points * = 16
    discs *                     list of the discs that may touch it; default: all but the root
"""

from dataclasses import replace
from typing import Any

from .contact import Box, Capsule, HalfSpace, Obstacle, Plates, Sphere
from .robot import Robot
from .scene_forces import Key, read_key
from .scene_rotation import read_rotation
from .scene_tables import Table, given
from .scene_units import FORCE, LENGTH, PURE, SLOWNESS, VELOCITY

MAX_OBSTACLES = 64
_RADIUS = Key(LENGTH, sign="positive", needed=True)
_PLACE = Key(LENGTH, (3,), needed=True)
SHAPES: dict[str, tuple[Any, dict[str, Key]]] = {
    "half_space": (HalfSpace, {"point": _PLACE, "normal": Key(PURE, (3,), needed=True)}),
    "sphere": (Sphere, {"centre": _PLACE, "radius": _RADIUS}),
    "capsule": (Capsule, {"start": _PLACE, "end": _PLACE, "radius": _RADIUS}),
    "box": (
        Box,
        {"centre": _PLACE, "size": _PLACE, "rounding": Key(LENGTH, sign="positive")},
    ),
}
_CONTACT = {
    "penetration": Key(LENGTH, sign="positive"),
    "load": Key(FORCE, sign="positive"),
    "friction": Key(sign="nonnegative"),
    "slip_speed": Key(VELOCITY, sign="positive"),
    "dissipation": Key(SLOWNESS, sign="nonnegative"),
    "restitution": Key(sign="nonnegative"),
}


def with_obstacles(top: Table, robot: Robot | None) -> Robot | None:
    """The robot among the obstacles of the file's `[[obstacle]]` tables."""
    contents = top.tables("obstacle", default=())
    if len(contents) > MAX_OBSTACLES:
        top.fault("obstacle", f"at most {MAX_OBSTACLES}", len(contents))
        return None
    n_discs = robot.n_discs if robot else 10**6
    found: list[Obstacle] = []
    for number, content in enumerate(contents, 1):
        part = Table(top.faults, f"obstacle[{number}]", content)
        obstacle = _read_obstacle(part, n_discs)
        weight = 0.0 if robot is None else robot.weight
        if obstacle and robot:
            obstacle = part.make(obstacle.fitted, n_discs, weight)
        if obstacle:
            found.append(obstacle)
    if robot is None or len(found) < len(contents):
        return None
    return replace(robot, obstacles=tuple(found)) if found else robot


def read_plates(table: Table) -> Plates | None:
    """The robot's `[robot.plates]` table; None without one."""
    part = table.table("plates", default=None)
    if part is None:
        return None
    keys = ("friction", "restitution")
    fields = given({name: read_key(part, name, _CONTACT[name]) for name in keys})
    points = part.take("rim_points", "an integer", default=None)
    if points:
        fields["rim_points"] = points[0]
    part.close()
    return part.make(Plates, **fields)


def _read_obstacle(part: Table, n_discs: int) -> Obstacle | None:
    kind = part.choice("kind", tuple(SHAPES))
    make, keys = SHAPES.get(kind, (HalfSpace, {}))
    fields = given({name: read_key(part, name, key) for name, key in keys.items()})
    if kind == "box":
        fields |= given({"orientation": read_rotation(part, "orientation")})
    contact = given({name: read_key(part, name, key) for name, key in _CONTACT.items()})
    points = part.take("rim_points", "an integer", default=None)
    if points:
        contact["rim_points"] = points[0]
    discs = part.take("discs", "a list of disc numbers", default=None)
    if discs:
        contact["discs"] = tuple(discs[0]) if isinstance(discs[0], list) else discs[0]
    part.close()
    shape = part.make(make, **fields) if kind else None
    return part.make(Obstacle, shape, **contact) if shape else None
