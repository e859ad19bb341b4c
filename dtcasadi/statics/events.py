"""What lies between two points of a branch.

A limit point is where the tangent's s changes sign, any other event where the number of growing
modes changes: a bifurcation when a real eigenvalue passes zero, the onset of flutter when a pair
passes the imaginary axis. Counting finds events of any multiplicity, in symmetric robots too.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from .continuation import Point, Tracer
from .stability import Stability

_PRECISION = 1e-10  # place of an event, of the step that it lies in
_DEPTH = 4  # a step is searched for up to 2^_DEPTH - 1 events
# A point of the branch, and how far it lies ahead of the step's start.
_Place = tuple[float, Point]


class Event(NamedTuple):
    """Something between two points.

    `limit`, `bifurcation` or `flutter`, how many modes take part, where, and the directions without
    stiffness that were there before, shape (n_q, n).
    """

    kind: str
    multiplicity: int
    point: Point
    floppy: np.ndarray

    @property
    def shapes(self) -> np.ndarray:
        """Directions that lose their stiffness in a bifurcation, orthonormal columns."""
        n, loose = self.floppy.shape
        count = self.multiplicity if self.kind == "bifurcation" else 0
        null = np.linalg.svd(self.point.found.K)[2][n - count - loose :].T
        if loose:
            basis = np.linalg.qr(self.floppy)[0]
            null = np.linalg.svd(null - basis @ (basis.T @ null))[0][:, :count]
        return null * np.sign(null[np.argmax(np.abs(null), axis=0), np.arange(count)])


def events(tracer: Tracer, a: Point, h: float, b: Point) -> Iterator[Event]:
    """What lies between a and the point b, a step h ahead of it, in order."""

    def at(x: float) -> Point:
        found = tracer.ahead(a, x)
        if found is None:
            raise _LostError
        return found

    try:
        yield from _between(at, (0.0, a), (h, b), tracer.arc, _DEPTH)
    except _LostError:  # next to a corner; what was found before it stands
        return


class _LostError(Exception):
    """A point between two points of a branch was not found."""


def _between(
    at: Callable[[float], Point], a: _Place, b: _Place, arc: bool, depth: int
) -> Iterator[Event]:
    (start, first), (end, last) = a, b
    turns = arc and first.tangent[-1] * last.tangent[-1] < 0
    if depth == 0 or not (turns or first.small.growing != last.small.growing):
        return
    x, gap = _place(at, a, b, turns), 1e-3 * (end - start)
    before = (x - gap, at(x - gap)) if x - gap > start else a
    after = (x + gap, at(x + gap)) if x + gap < end else b
    if before is not a:
        yield from _between(at, a, before, arc, depth - 1)
    kind, multiplicity = ("limit", 1) if turns else _kind(before[1].small, after[1].small)
    if multiplicity:
        yield Event(kind, multiplicity, at(x), before[1].small.floppy)
    if after is not b:
        yield from _between(at, after, b, arc, depth - 1)


def _place(at: Callable[[float], Point], a: _Place, b: _Place, turns: bool) -> float:
    """Where an event lies between a and b."""
    rank = min(a[1].small.growing, b[1].small.growing)

    def measure(point: Point) -> float:
        return point.tangent[-1] if turns else point.small.growth(rank)

    def beyond(point: Point) -> bool:
        return bool(point.tangent[-1] < 0) if turns else point.small.growing > rank

    precision = _PRECISION * (b[0] - a[0])
    coarse = (b[0] - a[0]) / 100
    while b[0] - a[0] > precision:
        loose = a[1].small.loose or b[1].small.loose
        if b[0] - a[0] < coarse and not loose and measure(a[1]) * measure(b[1]) < 0:
            return float(brentq(lambda x: measure(at(x)), a[0], b[0], xtol=precision))
        # Without damping nothing decays and the measure is zero on one side, and a mode without
        # stiffness hides it in round-off: halve on.
        middle = (a[0] + b[0]) / 2
        point = at(middle)
        if beyond(point) == beyond(a[1]):
            a = (middle, point)
        else:
            b = (middle, point)
    return (a[0] + b[0]) / 2


def _kind(before: Stability, after: Stability) -> tuple[str, int]:
    """What a change of the growing modes is, and how many modes took part."""
    pairs = abs(after.fluttering - before.fluttering)
    real = abs(after.divergent - before.divergent)
    return ("flutter", pairs) if pairs else ("bifurcation", real)
