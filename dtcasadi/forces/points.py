"""Where on a disc a force acts: a point in its frame, by default its centre of mass."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from .. import checks
from .protocol import Force

if TYPE_CHECKING:
    from ..robot import Disc

Kind = TypeVar("Kind", bound=Force)


def checked_point(point: Any) -> dict[str, np.ndarray]:
    """The field `point` of a force, checked where it is given."""
    return {} if point is None else {"point": checks.array("point", point, (3,))}


def at_centre(force: Kind, discs: "Sequence[Disc]") -> Kind:
    """The force at its disc's centre of mass where no point is given."""
    if force.point is not None:  # type: ignore[attr-defined]
        return force
    (disc,) = force.touched()
    return replace(force, point=discs[disc - 1].centre_of_mass)  # type: ignore[call-arg]
