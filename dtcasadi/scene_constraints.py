"""The `[[robot.constraints]]` tables of a scene file.

Keys marked * may be left out.

    [[robot.constraints]] *     see `dtcasadi.constraints` for each
    kind = "pinned"             disc, point, place
    kind = "guided"             disc, point, place, along or normal
    kind = "strap"              discs = [i, j], start, end, length
    kind = "joined"             discs = [i, j], start, end
"""

from typing import Any

from .constraints.values import Constraint, Guided, Joined, Pinned, Strap
from .scene_forces import Key, read_key
from .scene_tables import Table, given
from .scene_units import LENGTH, PURE

MAX_CONSTRAINTS = 256
_PLACE = Key(LENGTH, (3,), needed=True)
_ENDS = {"start": _PLACE, "end": _PLACE}
KINDS: dict[str, tuple[Any, dict[str, Key]]] = {
    "pinned": (Pinned, {"point": _PLACE, "place": _PLACE}),
    "guided": (
        Guided,
        {"point": _PLACE, "place": _PLACE, "along": Key(PURE, (3,)), "normal": Key(PURE, (3,))},
    ),
    "strap": (Strap, {**_ENDS, "length": Key(LENGTH, sign="positive", needed=True)}),
    "joined": (Joined, _ENDS),
}


def read_constraints(table: Table, n_discs: int | None) -> tuple[Constraint, ...]:
    """The constraints of the robot's `[[robot.constraints]]` tables."""
    contents = table.tables("constraints", default=())
    if len(contents) > MAX_CONSTRAINTS:
        table.fault("constraints", f"at most {MAX_CONSTRAINTS}", len(contents))
        return ()
    last = n_discs or 10**6
    found = []
    for number, content in enumerate(contents, 1):
        part = Table(table.faults, f"{table.path}.constraints[{number}]", content)
        kind = part.choice("kind", tuple(KINDS))
        make, keys = KINDS.get(kind, (Pinned, {}))
        fields = given({name: read_key(part, name, key) for name, key in keys.items()})
        if kind in ("strap", "joined"):
            pair = part.array("discs", (2,))
            fields["discs"] = tuple(int(n) if n == n and int(n) == n else n for n in pair)
            if part.sound and pair[1] > last:
                part.fault("discs", f"discs from 1 to {last}", fields["discs"])
        elif kind:
            fields["disc"] = part.integer("disc", 2, last)
        part.close()
        found.append(part.make(make, **fields) if kind else None)
    return tuple(each for each in found if each is not None)
