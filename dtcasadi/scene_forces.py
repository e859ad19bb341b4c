"""The `[[robot.forces]]` tables of a scene file; their keys are listed in `dtcasadi.scene`."""

from typing import Any, NamedTuple

from . import checks
from .forces import (
    Couple,
    Drag,
    FabricBunching,
    FollowerLoad,
    Force,
    Payload,
    PointLoad,
    WallSpring,
)
from .scene_springs import Discs, read_strands
from .scene_tables import Table, given
from .scene_units import (
    FORCE,
    INERTIA,
    LENGTH,
    MASS,
    MOMENT,
    PURE,
    QUADRATIC_DRAG,
    SEGMENT_DAMPING,
    SPRING_DAMPING,
    STIFFENING,
    STIFFNESS,
    VELOCITY,
    Unit,
)

MAX_FORCES = 20_000


class Key(NamedTuple):
    """How a key's numbers are read: shape () for one, (3,), (3, 3), or "row" of 3 or one for all.

    `sign` is `positive` or `nonnegative`, where only such a number makes sense.
    """

    unit: Unit = PURE
    shape: tuple[int, ...] | str = ()
    sign: str = ""
    needed: bool = False


class Kind(NamedTuple):
    """A force's class and its keys beside those that say where it acts."""

    make: type[Force]
    keys: dict[str, Key]
    between: bool = False  # neighbouring discs


_POINT = {"point": Key(LENGTH, (3,))}
_POINT_FORCE = {
    "magnitude": Key(FORCE, needed=True),
    "direction": Key(PURE, (3,), needed=True),
    **_POINT,
}
_WALL = {
    "stiffness": Key(STIFFNESS, sign="nonnegative", needed=True),
    "stiffening": Key(STIFFENING, sign="nonnegative"),
    "smoothing": Key(LENGTH, sign="positive"),
}
KINDS = {
    "point_load": Kind(PointLoad, _POINT_FORCE),
    "follower_load": Kind(FollowerLoad, _POINT_FORCE),
    "couple": Kind(
        Couple,
        {"magnitude": Key(MOMENT, needed=True), "direction": Key(PURE, (3,), needed=True)},
    ),
    "payload": Kind(
        Payload,
        {
            "mass": Key(MASS, sign="nonnegative", needed=True),
            "inertia": Key(INERTIA, (3, 3)),
            **_POINT,
        },
    ),
    "drag": Kind(
        Drag,
        {
            "linear": Key(SPRING_DAMPING, "row"),
            "quadratic": Key(QUADRATIC_DRAG, "row"),
            "angular": Key(SEGMENT_DAMPING, "row"),
            "flow": Key(VELOCITY, (3,)),
            **_POINT,
        },
    ),
    "wall_spring": Kind(
        WallSpring, {"rest_length": Key(LENGTH, sign="positive"), **_WALL}, between=True
    ),
    "fabric_bunching": Kind(
        FabricBunching,
        {"gap": Key(LENGTH, sign="positive", needed=True), **_WALL},
        between=True,
    ),
}


def read_forces(table: Table, discs: Discs) -> list[Force]:
    """The forces of all `[[robot.forces]]` tables."""
    forces: list[Force] = []
    for number, content in enumerate(table.tables("forces", default=()), 1):
        part = Table(table.faults, f"{table.path}.forces[{number}]", content)
        name = part.choice("kind", tuple(KINDS))
        if name:
            forces += _read_force(part, KINDS[name], discs, MAX_FORCES - len(forces))
    return forces


def _read_force(part: Table, kind: Kind, discs: Discs, room: int) -> list[Force]:
    strands = read_strands(part, discs) if kind.between else None
    on = None if kind.between else _read_disc_numbers(part, discs.number)
    values = given({name: read_key(part, name, key) for name, key in kind.keys.items()})
    if kind.make is Couple:
        values |= given({"follower": part.truth("follower", default=None)})
    part.close()
    if strands is not None:
        places = strands.ends(discs, room, f"{MAX_FORCES} forces")
    else:
        places = [(disc,) for disc in on or ()]
        if len(places) > room:
            part.fault("disc", f"at most {MAX_FORCES} forces in all", MAX_FORCES + 1)
    made = [part.make(kind.make, *place, **values) for place in places]
    return [force for force in made if force is not None]


def read_key(part: Table, name: str, key: Key) -> Any:
    """A key's numbers; None where it is absent."""
    options: dict[str, Any] = {} if key.needed else {"default": None}
    if key.shape == ():
        return part.number(name, key.unit, **options, **({key.sign: True} if key.sign else {}))
    if key.shape == "row":
        return part.row(name, 3, key.unit, **options)
    return part.array(name, key.shape, key.unit, **options)  # type: ignore[arg-type]


def _read_disc_numbers(part: Table, n_discs: int | None) -> list[int]:
    """The discs a force acts on, each with a force of its own; [] where they are not known."""
    expected = 'a disc number, or "all"'
    found = part.take("disc", expected)
    if found is None or n_discs is None:
        return []
    if found[0] == "all":
        return list(range(2, n_discs + 1))
    value = found[0]
    if type(value) is not int:
        part.fault("disc", expected, checks.shown(value))
    elif not 2 <= value <= n_discs:
        part.fault("disc", f"a disc number from 2 to {n_discs}", value)
    else:
        return [value]
    return []
