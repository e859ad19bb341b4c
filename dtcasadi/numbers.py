"""A robot's numbers as CasADi matrices, any of them replaced by a named block of theta.

Paths name a field as scene errors do: `discs[4].mass`, `springs.stiffness` (of all springs),
`damping[2].c_a`, `gravity`, and those of the actuator: `actuator.time_constant`. Parts are counted
from 1; disc 1 is the root.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from .actuators import Actuator
from .actuators.parameters import named
from .contact.compliant import NUMBERS, CompliantContact
from .errors import ModelError
from .forces.damping import SegmentDamping
from .forces.gravity import Gravity
from .forces.inflation import ChamberNumbers
from .forces.protocol import Body, Force, constant, numbers_in, with_numbers
from .forces.springs import Springs
from .rim import rim_points
from .robot import Robot

_PATH = re.compile(
    r"(discs|threads|springs|chambers|damping|forces|obstacles)(?:\[(\d{1,6})\])?\.([a-z][a-z_0-9]*)"
)
Getter = Callable[[str, int, str], ca.SX]
_FIELDS = {
    "discs": ("mass", "inertia", "centre_of_mass"),
    "threads": ("length", "exit_point"),
    "springs": ("start", "end", "stiffness", "rest_length", "damping"),
    "chambers": ("areas", "radial_compliance"),
    "damping": ("c_a", "c_b", "c_w", "c_r"),
    "obstacles": ("geometry", "stiffness", "friction", "slip_speed", "dissipation"),
}
# A parameter `inertia` is its six independent entries, so that no estimate can break its symmetry.
INERTIA_ORDER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


class Slot(NamedTuple):
    """One number block of the robot that a path names."""

    part: str
    place: int  # from 0; 0 for robot-wide fields
    field: str


class Numbers(NamedTuple):
    """Every number of a robot, each a DM constant or a symbol."""

    discs: tuple[Body, ...]  # without what forces make them carry
    length: tuple[ca.SX, ...]
    exit_point: tuple[ca.SX, ...]
    bend: tuple[ca.SX, ...]
    twist: tuple[ca.SX, ...]
    springs: tuple[Springs, ...]  # per segment
    damping: tuple[SegmentDamping, ...]
    chambers: tuple[ChamberNumbers, ...]
    fields: tuple[Force, ...]  # gravity first
    forces: tuple[Force, ...]  # the robot's open list
    contacts: tuple[CompliantContact, ...]  # of each obstacle with each disc it may touch


def slots(robot: Robot, path: str) -> tuple[Slot, ...]:
    """The blocks a path names.

    Raises:
        ModelError: the path names no field that can be a parameter.
    """
    if path in ("gravity", "up"):
        return (Slot("robot", 0, path),)
    match = _PATH.fullmatch(path) if isinstance(path, str) else None
    if not match or match[3] not in _FIELDS.get(match[1], (match[3],)):
        known = [f"{part}.{field}" for part, fields in _FIELDS.items() for field in fields]
        raise ModelError(
            f"parameters: expected paths such as {', '.join(known)}, forces[1].magnitude, gravity, "
            f"up, got {path!r}"
        )
    part, number, field = match.groups()
    count = len(getattr(robot, part))
    if number is None and not count:
        raise ModelError(f"parameters: {path}: the robot has no {part}")
    if number is not None and not 1 <= int(number) <= count:
        raise ModelError(f"parameters: {path}: expected an index from 1 to {count}, got {number}")
    places = list(range(count)) if number is None else [int(number) - 1]
    if part == "obstacles":
        places = [place for place in places if not robot.obstacles[place].rigid]
    if part == "forces":
        places = _forces_with(robot, path, places, field)
    return tuple(Slot(part, place, field) for place in places)


def _forces_with(robot: Robot, path: str, places: Sequence[int], field: str) -> list[int]:
    """Those of the forces that have the number."""
    found = [place for place in places if field in numbers_in(robot.forces[place])]
    if not found:
        names = dict.fromkeys(n for place in places for n in numbers_in(robot.forces[place]))
        raise ModelError(f"parameters: {path}: expected one of {', '.join(names)}, got {field!r}")
    return found


def slot_value(robot: Robot, slot: Slot) -> np.ndarray:
    """A block's numbers as theta holds them, shape (n,)."""
    value = np.atleast_1d(_value(robot, slot))
    if _is_tensor(slot, value):
        return np.array([value[i, j] for i, j in INERTIA_ORDER])
    return value.ravel()


def _value(robot: Robot, slot: Slot) -> np.ndarray:
    """A field of the robot as an array."""
    owner = robot if slot.part == "robot" else getattr(robot, slot.part)[slot.place]
    return np.asarray(getattr(owner, slot.field), dtype=float)


def _is_tensor(slot: Slot, value: np.ndarray) -> bool:
    return slot.field == "inertia" and value.shape == (3, 3)


def numbers_of(robot: Robot, symbols: Mapping[Slot, ca.SX]) -> Numbers:
    """The robot's numbers, the named blocks replaced by symbols."""

    def get(part: str, index: int, field: str) -> ca.SX:
        slot = Slot(part, index, field)
        value = _value(robot, slot)
        if slot not in symbols:
            return constant(value)
        if _is_tensor(slot, value):
            return _inertia(symbols[slot])
        if value.ndim < 2:
            return symbols[slot]
        return ca.reshape(symbols[slot], *value.shape[::-1]).T

    segments = range(robot.n_discs - 1)
    forces = tuple(
        with_numbers(force, {name: get("forces", k, name) for name in numbers_in(force)})
        for k, force in enumerate(robot.forces)
    )
    gravity = Gravity(get("robot", 0, "gravity"), get("robot", 0, "up"))
    return Numbers(
        discs=tuple(
            Body(*(get("discs", i, f) for f in _FIELDS["discs"])) for i in range(robot.n_discs)
        ),
        length=tuple(get("threads", i, "length") for i in segments),
        exit_point=tuple(get("threads", i, "exit_point") for i in segments),
        bend=tuple(constant(robot.threads[i].bend) for i in segments),
        twist=tuple(constant(robot.threads[i].twist) for i in segments),
        springs=tuple(_springs(robot, i, get) for i in segments),
        damping=tuple(
            SegmentDamping((i + 1, i + 2), *(get("damping", i, f) for f in _FIELDS["damping"]))
            for i in segments
        ),
        chambers=tuple(
            ChamberNumbers(
                get("chambers", k, "areas"),
                constant(np.array(chamber.centroids).T),
                get("chambers", k, "radial_compliance"),
            )
            for k, chamber in enumerate(robot.chambers)
        ),
        fields=(gravity, *(force for force in forces if type(force).field is not Force.field)),
        forces=forces,
        contacts=tuple(_contacts(robot, get)),
    )


def _contacts(robot: Robot, get: Getter) -> Iterator[Any]:
    """Contacts of every obstacle, disc by disc."""
    for k, obstacle in enumerate(robot.obstacles):
        if obstacle.rigid:
            continue
        numbers = {name: get("obstacles", k, name) for name in NUMBERS}
        for disc in obstacle.touching(robot.n_discs):
            points = rim_points(robot.discs[disc - 1], obstacle.rim_points)
            contact = CompliantContact.of(obstacle, disc, points)
            yield with_numbers(contact, {**numbers, "points": constant(points)})


def _springs(robot: Robot, segment: int, get: Getter) -> Springs:
    """All springs of a segment, stacked."""
    discs = (segment + 1, segment + 2)
    mine = [m for m, s in enumerate(robot.springs) if s.discs == discs]
    if not mine:
        empty = ca.DM(0, 1)
        return Springs(discs, ca.DM(3, 0), ca.DM(3, 0), empty, empty, empty)
    columns = {f: [get("springs", m, f) for m in mine] for f in _FIELDS["springs"]}
    stack = {f: ca.horzcat if f in ("start", "end") else ca.vertcat for f in columns}
    return Springs(discs, **{f: stack[f](*values) for f, values in columns.items()})


def _inertia(entries: ca.SX) -> ca.SX:
    """The symmetric tensor from its six entries."""
    tensor = [[None] * 3 for _ in range(3)]
    for n, (i, j) in enumerate(INERTIA_ORDER):
        tensor[i][j] = tensor[j][i] = entries[n]
    return ca.blockcat(tensor)


class Theta(NamedTuple):
    """Layout of the free parameters."""

    blocks: dict[str, slice]
    values: np.ndarray
    slots: tuple[tuple[Slot, slice], ...]


def theta_layout(
    robot: Robot,
    actuator: Actuator,
    frames: Sequence[int],
    wrenches: Sequence[int],
    parameters: Sequence[str],
) -> Theta:
    """Blocks in order: frames (A, B column-major per segment), wrench (6 per disc), parameters.

    Raises:
        ModelError: an unknown path, or a number named twice.
    """
    blocks: dict[str, slice] = {}
    values: list[np.ndarray] = []
    taken: list[tuple[Slot, slice]] = []
    size = 0

    def add(name: str, parts: list[np.ndarray]) -> None:
        nonlocal size
        block = np.concatenate(parts)
        blocks[name] = slice(size, size + len(block))
        values.append(block)
        size += len(block)

    if frames:
        threads = [robot.threads[i] for i in frames]
        add("frames", [m.ravel(order="F") for t in threads for m in (t.bend, t.twist)])
    if wrenches:
        add("wrench", [np.zeros(6) for _ in wrenches])
    for path in parameters:
        if isinstance(path, str) and path.startswith("actuator."):
            whole, numbers = named(actuator, path.removeprefix("actuator."))
            found = [(Slot("actuator", 0, whole), numbers)]
        else:
            found = [(slot, slot_value(robot, slot)) for slot in slots(robot, path)]
        again = {slot for slot, _ in taken}.intersection(slot for slot, _ in found)
        if again or path in blocks:
            raise ModelError(f"parameters: {path} names a number that is already a parameter")
        start = size
        add(path, [part for _, part in found])
        for slot, part in found:
            taken.append((slot, slice(start, start + len(part))))
            start += len(part)
    theta0 = np.concatenate(values) if values else np.zeros(0)
    theta0.flags.writeable = False
    return Theta(blocks, theta0, tuple(taken))
