"""Following an equilibrium while the loads change: prediction, correction, events.

`arc` is pseudo-arc-length continuation (Keller 1977; Seydel, Practical Bifurcation and Stability
Analysis, section 4.5): the loads' parameter s is an unknown and a step goes along the tangent of
the curve (q, s), so it passes limit points, where s turns back. `step` changes s and solves for q.

A limit point is where the tangent's s changes sign, any other event where the number of growing
modes changes: a bifurcation when a real eigenvalue passes zero, the onset of flutter when a pair
passes the imaginary axis. Counting finds events of any multiplicity, in symmetric robots too.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from ..recentring import off_centre
from .loads import LoadPath
from .search import GROUND, Found, Mode, Search, Why
from .stability import Stability, stability

METHODS = ("arc", "step")
# Longest change of a coordinate in a step [rad], and how far off its prediction may be.
REACH, OFF = 0.1, 0.3
# Cosine between the tangents at both ends of a step: less is a corner, or another branch.
_STRAIGHT = 0.8
# Newton steps of a correction; more mean that the prediction was bad.
_MOST = 8
_SMALLEST = 1e-7  # step, of the longest one
_PRECISION = 1e-10  # place of an event, of the step that it lies in


# Points that a curve may have, of those asked for: limit points and steep parts need more.
_ROOM = 20
_DEPTH = 4  # a step is searched for up to 2^_DEPTH - 1 events


class Point(NamedTuple):
    """A point of a branch: its equilibrium, the tangent (dq, ds) there, and its stability."""

    found: Found
    tangent: np.ndarray
    small: Stability


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


class Trace(NamedTuple):
    """Points, events with the number of the point before them, and how it ended."""

    points: list[Point]
    events: list[tuple[int, Event]]
    message: str
    success: bool


@dataclass(frozen=True, eq=False)
class Tracer:
    """Steps along one curve of equilibria.

    Attributes:
        search: the model's search.
        path: the loads as functions of s.
        span: change of s that counts like a turn of one radian.
        arc: whether s is an unknown of the correction, or given.
        way: 1 or -1: which way s goes where it is given.
    """

    search: Search
    path: LoadPath
    span: float
    arc: bool = True
    way: float = 1.0

    def point(self, found: Found, along: np.ndarray) -> Point:
        """The tangent at an equilibrium, on the side of `along`, shape (n_q + 1,)."""
        small = stability(found.M, found.D, found.K)
        tangent = self._followed(found, along) if small.loose else self._tangent(found, along)
        size = np.sqrt(tangent @ self.metric(tangent)) if self.arc else tangent[-1] * self.way
        return Point(found, tangent / size, small)

    def _tangent(self, found: Found, along: np.ndarray) -> np.ndarray:
        n = len(found.q)
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n], matrix[:n, n], matrix[n] = found.K, found.slope, self._weights(along)
        rhs = np.zeros(n + 1)
        rhs[n] = 1.0
        try:
            return np.linalg.solve(matrix, rhs)
        except np.linalg.LinAlgError:  # other branches meet this one here: straight on
            return along

    def _followed(self, found: Found, along: np.ndarray) -> np.ndarray:
        """Where directions without stiffness are equilibria too: straight on among all of them."""
        matrix = np.column_stack([found.K, found.slope * self.span])
        _, sizes, rows = np.linalg.svd(matrix)
        free = rows[np.append(sizes, 0.0) <= GROUND * sizes[0]]
        scaled = np.append(along[:-1], along[-1] / self.span)
        scaled = free.T @ (free @ scaled)
        return np.append(scaled[:-1], scaled[-1] * self.span)

    def ahead(self, point: Point, h: float) -> Point | None:
        """The point a step h along the tangent, if there is one that belongs to the same curve."""
        found, tangent = point.found, point.tangent
        n = len(found.q)
        weights = self._weights(tangent)
        guess = found.q + h * tangent[:n]
        after = self.search.run(
            replace(self.path, theta=found.theta),
            guess,
            found.s + h * tangent[n],
            mode=Mode.NEAREST,
            normal=weights[:n],
            weight=weights[n],
            most=_MOST,
        )
        change = np.max(np.abs(h * tangent[:n]))
        if after.why is not Why.FOUND or np.max(np.abs(after.q - guess)) > OFF * max(change, REACH):
            return None
        result = self.point(after, tangent)
        if not np.all(np.isfinite(result.tangent)):
            return None
        size = np.sqrt(
            (tangent @ self.metric(tangent)) * (result.tangent @ self.metric(result.tangent))
        )
        return result if tangent @ self.metric(result.tangent) >= _STRAIGHT * size else None

    def step(self, point: Point, h: float, longest: float) -> tuple[Point, float] | None:
        """The next point and the step that led there, halved until it succeeds."""
        while h >= _SMALLEST * longest:
            after = self.ahead(point, h)
            if after is not None:
                return after, h
            h /= 2
        return None

    def longest(self, point: Point, ds: float, limits: tuple[float, float]) -> float:
        """The step that changes s by no more than ds and no coordinate by more than `REACH`.

        Where s is given, the step ends with the range of s.
        """
        turn, rate = np.max(np.abs(point.tangent[:-1])), abs(point.tangent[-1])
        if not self.arc:
            left = limits[1] - point.found.s if self.way > 0 else point.found.s - limits[0]
            return left if left < 1.001 * ds else ds
        return float(min(REACH / turn if turn else np.inf, ds / rate if rate else np.inf))

    def landed(self, point: Point, after: Point, s: float) -> Point | None:
        """The point at a given s between two points."""
        one, other = point.found, after.found
        share = (s - one.s) / (other.s - one.s)
        guess = one.q + share * (other.q - one.q)
        path, still = replace(self.path, theta=one.theta), np.zeros(len(guess))
        found = self.search.run(path, guess, s, mode=Mode.NEAREST, normal=still, most=_MOST)
        near = found.why is Why.FOUND and np.max(np.abs(found.q - guess)) < REACH
        return self.point(found, after.tangent) if near else None

    def centred(self, point: Point) -> Point:
        """The same point with charts re-centred where one has left 45 degrees."""
        model, found = self.search.model, point.found
        n = model.n_q
        x = np.zeros(model.n_x)
        x[:n], x[n : 2 * n] = found.q, point.tangent[:n]
        if not model.recentres or not off_centre(model, x):
            return point
        x, theta, _ = model.recentre(x, found.theta)  # maps the tangent as it maps rates
        path, still = replace(self.path, theta=theta), np.zeros(n)
        found = self.search.run(path, x[:n], found.s, mode=Mode.NEAREST, normal=still)
        return self.point(found, np.append(x[n : 2 * n], point.tangent[n]))

    def events(self, a: Point, h: float, b: Point) -> Iterator[Event]:
        """What lies between a and the point b, a step h ahead of it, in order."""

        def at(x: float) -> Point:
            found = self.ahead(a, x)
            if found is None:
                raise _LostError
            return found

        try:
            yield from self._between(at, (0.0, a), (h, b), _DEPTH)
        except _LostError:  # next to a corner; what was found before it stands
            return

    def _between(
        self,
        at: Callable[[float], Point],
        a: tuple[float, Point],
        b: tuple[float, Point],
        depth: int,
    ) -> Iterator[Event]:
        (start, first), (end, last) = a, b
        turns = self.arc and first.tangent[-1] * last.tangent[-1] < 0
        if depth == 0 or not (turns or first.small.growing != last.small.growing):
            return
        x, gap = _place(at, a, b, turns), 1e-3 * (end - start)
        before = (x - gap, at(x - gap)) if x - gap > start else a
        after = (x + gap, at(x + gap)) if x + gap < end else b
        if before is not a:
            yield from self._between(at, a, before, depth - 1)
        kind, multiplicity = ("limit", 1) if turns else _kind(before[1].small, after[1].small)
        if multiplicity:
            yield Event(kind, multiplicity, at(x), before[1].small.floppy)
        if after is not b:
            yield from self._between(at, after, b, depth - 1)

    def metric(self, vector: np.ndarray) -> np.ndarray:
        """The vector, its s in units of `span` squared: the metric of the curve's length."""
        weighted = np.array(vector)
        weighted[-1] /= self.span**2
        return weighted

    def _weights(self, along: np.ndarray) -> np.ndarray:
        """The constraint of a correction, weights . (dq, ds) = 0."""
        if self.arc:
            return self.metric(along)
        return np.append(np.zeros(len(along) - 1), 1.0)


def follow(
    tracer: Tracer,
    first: Point,
    limits: tuple[float, float],
    points: int,
    *,
    watch: bool = True,
) -> Trace:
    """The curve from a point to where s leaves its range.

    Args:
        tracer: how to take steps.
        first: where to start; its tangent says which way.
        limits: range of s.
        points: about how many points, see `dtcasadi.branch`.
        watch: whether to look for events.
    """
    low, high = limits
    trace: list[Point] = [tracer.centred(first)]
    events: list[tuple[int, Event]] = []
    ds = (high - low) / points
    h = np.inf
    while True:
        point = trace[-1]
        longest = tracer.longest(point, ds, limits)
        step = tracer.step(point, min(longest, 2 * h), longest)
        if step is None:
            return Trace(trace, events, _stopped(tracer, point, len(trace)), False)
        after, h = step
        found = list(tracer.events(point, h, after)) if watch else []
        end = min(max(after.found.s, low), high)
        if end != after.found.s:
            landed = tracer.landed(point, after, end)
            if landed is None:
                return Trace(trace, events, _stopped(tracer, point, len(trace)), False)
            after = landed
        events += [(len(trace) - 1, e) for e in found if low <= e.point.found.s <= high]
        trace.append(tracer.centred(after))
        s = after.found.s
        if s in limits:
            return Trace(trace, events, f"reached s = {s:g} in {len(trace)} points", True)
        if len(trace) > _ROOM * points:
            return Trace(trace, events, f"stopped at s = {s:g} after {len(trace)} points", False)


def _stopped(tracer: Tracer, point: Point, count: int) -> str:
    where = f"stopped at s = {point.found.s:.6g} after {count} points: no equilibrium further on"
    if tracer.arc:
        return f"{where} belongs to the same curve; try more points"
    return f"{where} was found in small steps; method='arc' passes limit points"


class _LostError(Exception):
    """A point between two points of a branch was not found."""


def _place(
    at: Callable[[float], Point], a: tuple[float, Point], b: tuple[float, Point], turns: bool
) -> float:
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
