"""A robot's numbers as CasADi matrices, any of them replaced by a named block of theta.

Paths name a field as scene errors do: `discs[4].mass`, `springs.stiffness` (of all springs),
`damping[2].c_a`, `gravity`. Parts are counted from 1; disc 1 is the root.
"""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from .errors import ModelError
from .forces.damping import DampingNumbers
from .forces.springs import Springs
from .robot import Robot

_PATH = re.compile(r"(discs|threads|springs|chambers|damping)(?:\[(\d{1,6})\])?\.([a-z_]+)")
_FIELDS = {
    "discs": ("mass", "inertia", "centre_of_mass"),
    "threads": ("length", "exit_point"),
    "springs": ("start", "end", "stiffness", "rest_length", "damping"),
    "chambers": ("areas",),
    "damping": ("c_a", "c_b", "c_w", "c_r"),
}
# A parameter `inertia` is its six independent entries, so that no estimate can break its symmetry.
INERTIA_ORDER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


class Slot(NamedTuple):
    """One number block of the robot that a path names."""

    part: str
    place: int  # from 0; 0 for robot-wide fields
    field: str


class DiscNumbers(NamedTuple):
    """Mass, inertia about the centre of mass and centre of mass of one disc."""

    mass: ca.SX
    inertia: ca.SX
    com: ca.SX


class Numbers(NamedTuple):
    """Every number of a robot, each a DM constant or a symbol."""

    discs: tuple[DiscNumbers, ...]
    length: tuple[ca.SX, ...]
    exit_point: tuple[ca.SX, ...]
    bend: tuple[ca.SX, ...]
    twist: tuple[ca.SX, ...]
    springs: tuple[Springs, ...]  # per segment
    damping: tuple[DampingNumbers, ...]
    areas: tuple[ca.SX, ...]  # per chamber
    gravity: ca.SX
    up: ca.SX


def slots(robot: Robot, path: str) -> tuple[Slot, ...]:
    """The blocks a path names.

    Raises:
        ModelError: the path names no field that can be a parameter.
    """
    if path in ("gravity", "up"):
        return (Slot("robot", 0, path),)
    match = _PATH.fullmatch(path) if isinstance(path, str) else None
    if not match or match[3] not in _FIELDS[match[1]]:
        known = [f"{part}.{field}" for part, fields in _FIELDS.items() for field in fields]
        raise ModelError(
            f"parameters: expected paths such as {', '.join(known)}, gravity, up, got {path!r}"
        )
    count = len(getattr(robot, match[1]))
    if match[2] is None:
        if not count:
            raise ModelError(f"parameters: {path}: the robot has no {match[1]}")
        return tuple(Slot(match[1], i, match[3]) for i in range(count))
    if not 1 <= int(match[2]) <= count:
        raise ModelError(f"parameters: {path}: expected an index from 1 to {count}, got {match[2]}")
    return (Slot(match[1], int(match[2]) - 1, match[3]),)


def slot_value(robot: Robot, slot: Slot) -> np.ndarray:
    """A block's numbers as theta holds them, shape (n,)."""
    owner = robot if slot.part == "robot" else getattr(robot, slot.part)[slot.place]
    value = np.atleast_1d(np.asarray(getattr(owner, slot.field), dtype=float))
    if slot.field == "inertia":
        return np.array([value[i, j] for i, j in INERTIA_ORDER])
    return value.ravel()


def numbers_of(robot: Robot, symbols: Mapping[Slot, ca.SX]) -> Numbers:
    """The robot's numbers, the named blocks replaced by symbols."""

    def get(part: str, index: int, field: str) -> ca.SX:
        slot = Slot(part, index, field)
        if slot in symbols:
            return _inertia(symbols[slot]) if field == "inertia" else symbols[slot]
        owner = robot if part == "robot" else getattr(robot, part)[index]
        return ca.sparsify(ca.DM(np.asarray(getattr(owner, field), dtype=float)))

    segments = range(robot.n_discs - 1)
    return Numbers(
        discs=tuple(
            DiscNumbers(*(get("discs", i, f) for f in _FIELDS["discs"]))
            for i in range(robot.n_discs)
        ),
        length=tuple(get("threads", i, "length") for i in segments),
        exit_point=tuple(get("threads", i, "exit_point") for i in segments),
        bend=tuple(ca.sparsify(ca.DM(robot.threads[i].bend)) for i in segments),
        twist=tuple(ca.sparsify(ca.DM(robot.threads[i].twist)) for i in segments),
        springs=tuple(_springs(robot, i, get) for i in segments),
        damping=tuple(
            DampingNumbers(*(get("damping", i, f) for f in _FIELDS["damping"])) for i in segments
        ),
        areas=tuple(get("chambers", i, "areas") for i in range(len(robot.chambers))),
        gravity=get("robot", 0, "gravity"),
        up=get("robot", 0, "up"),
    )


def _springs(robot: Robot, segment: int, get) -> Springs:  # noqa: ANN001
    """All springs of a segment, stacked."""
    mine = [m for m, s in enumerate(robot.springs) if s.discs[0] == segment + 1]
    if not mine:
        empty = ca.DM(0, 1)
        return Springs(ca.DM(3, 0), ca.DM(3, 0), empty, empty, empty)
    columns = {f: [get("springs", m, f) for m in mine] for f in Springs._fields}
    stack = {f: ca.horzcat if f in ("start", "end") else ca.vertcat for f in columns}
    return Springs(**{f: stack[f](*values) for f, values in columns.items()})


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
    robot: Robot, frames: Sequence[int], wrenches: Sequence[int], parameters: Sequence[str]
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
        mine = slots(robot, path)
        again = {slot for slot, _ in taken}.intersection(mine)
        if again or path in blocks:
            raise ModelError(f"parameters: {path} names a number that is already a parameter")
        parts = [slot_value(robot, slot) for slot in mine]
        start = size
        add(path, parts)
        for slot, part in zip(mine, parts, strict=True):
            taken.append((slot, slice(start, start + len(part))))
            start += len(part)
    theta0 = np.concatenate(values) if values else np.zeros(0)
    theta0.flags.writeable = False
    return Theta(blocks, theta0, tuple(taken))
