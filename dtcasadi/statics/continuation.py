"""Following an equilibrium while the loads change: prediction and correction.

`arc` is pseudo-arc-length continuation (Keller 1977; Seydel, Practical Bifurcation and Stability
Analysis, chapter 4): the loads' parameter s is an unknown and a step goes along the tangent of the
curve (q, s), so it passes limit points, where s turns back. `step` changes s and solves for q.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

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


class Point(NamedTuple):
    """A point of a branch: its equilibrium, the tangent (dq, ds) there, and its stability."""

    found: Found
    tangent: np.ndarray
    small: Stability


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
