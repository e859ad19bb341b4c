"""The `[[robot.springs]]` tables of a scene file; their keys are listed in `dtcasadi.scene`."""

from typing import NamedTuple

import numpy as np

from . import checks
from .presets import rim
from .robot import Disc, Spring
from .scene_tables import Table
from .scene_units import ANGLE, LENGTH, SPRING_DAMPING, STIFFNESS

MAX_SPRINGS = 20_000
# The ways to say where springs end, each key with its unit.
_FORMS = (
    {"at": ANGLE},
    {"start_at": ANGLE, "end_at": ANGLE},
    {"start": LENGTH, "end": LENGTH},
)

Ends = list[tuple[np.ndarray, np.ndarray]]


class Discs(NamedTuple):
    """The discs of a robot as far as they could be read."""

    discs: list[Disc | None]
    radii: list[float | None]  # None: not round
    number: int | None  # None: faults hide it


def read_springs(table: Table, discs: Discs) -> list[Spring]:
    """The springs of all `[[robot.springs]]` tables."""
    springs: list[Spring] = []
    for number, content in enumerate(table.tables("springs", default=()), 1):
        part = Table(table.faults, f"{table.path}.springs[{number}]", content)
        springs += _read_spring_table(part, discs, MAX_SPRINGS - len(springs))
    return springs


def read_span(part: Table, n_discs: int | None, meaning: str) -> tuple[int, int] | None:
    """(first, last) disc of the key `discs`, where "all" is (1, n_discs); None if not known."""
    expected = f'"all" or {meaning}'
    found = part.take("discs", expected)
    if found is None:
        return None
    value = found[0]
    if value == "all":
        return None if n_discs is None else (1, n_discs)
    if not isinstance(value, list) or len(value) != 2 or any(type(v) is not int for v in value):
        part.fault("discs", expected, checks.shown(value))
        return None
    if n_discs is None:
        return None
    if not all(1 <= disc <= n_discs for disc in value):
        part.fault("discs", f"disc numbers from 1 to {n_discs}", checks.shown(value))
        return None
    return value[0], value[1]


class Strands(NamedTuple):
    """Where straight things between neighbouring discs end, as a table says it."""

    part: Table
    pairs: list[tuple[int, int]] | None  # None: not known
    places: Ends
    radius: float | None

    def ends(self, discs: Discs, room: int, most: str) -> list[tuple]:
        """(pair, start, end) of each; none where the table has faults or there are too many."""
        if self.pairs is None or not self.part.sound or None in discs.discs:
            return []
        count = len(self.pairs) * len(self.places)
        if count > room:
            self.part.fault("discs", f"at most {most} in all", count)
            return []
        return [
            (
                pair,
                *(_end(self.part, discs, self.radius, *on) for on in zip(pair, place, strict=True)),
            )
            for pair in self.pairs
            for place in self.places
        ]


def read_strands(part: Table, discs: Discs) -> Strands:
    """The keys `discs`, `at` or its siblings, and `radius`."""
    span = read_span(part, discs.number, "the first and the last disc number")
    if span and not span[0] < span[1]:
        part.fault("discs", "the first and a later disc", list(span))
    pairs = None if span is None else [(i, i + 1) for i in range(*span)]
    places = _read_places(part)
    radius = part.number("radius", LENGTH, default=None, positive=True)
    return Strands(part, pairs, places, radius)


def _read_spring_table(part: Table, discs: Discs, room: int) -> list[Spring]:
    strands = read_strands(part, discs)
    constants = {
        "stiffness": part.number("stiffness", STIFFNESS, nonnegative=True),
        "rest_length": part.number("rest_length", LENGTH, default=None, nonnegative=True),
        "damping": part.number("damping", SPRING_DAMPING, default=0.0, nonnegative=True),
    }
    part.close()
    ends = strands.ends(discs, room, f"{MAX_SPRINGS} springs")
    springs = [part.make(Spring, *each, **constants) for each in ends]
    return [spring for spring in springs if spring is not None]


def _read_places(part: Table) -> Ends:
    """For each spring on a pair of discs its two ends, each an angle on the rim or a point."""
    given = [form for form in _FORMS if any(part.holds(key, unit) for key, unit in form.items())]
    if len(given) != 1:
        for form in _FORMS:  # so that they count as known
            for key, unit in form.items():
                part.take(key, "", unit, default=None)
        got = " and ".join(next(iter(form)) for form in given) or "nothing"
        part.fault("at", "at, or start_at with end_at, or start with end", got)
        return []
    (form,) = given
    if "start" in form:
        return [(part.array("start", (3,), LENGTH), part.array("end", (3,), LENGTH))]
    columns = [part.array(key, (None,), unit) for key, unit in form.items()]
    if len(columns[0]) != len(columns[-1]):
        part.fault("end_at", f"{len(columns[0])} angles, as in start_at", len(columns[-1]))
        return []
    return list(zip(columns[0], columns[-1], strict=True))


def _end(
    part: Table, discs: Discs, radius: float | None, disc: int, place: np.ndarray
) -> np.ndarray:
    """A point on a disc from a place: an angle on its rim, or the point itself."""
    if place.ndim:
        return place
    radius = discs.radii[disc - 1] if radius is None else radius
    if radius is None:
        part.fault("radius", f"a number, as disc {disc} is not round", "nothing")
        return place
    return rim(radius, float(place))
