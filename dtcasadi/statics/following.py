"""A curve of equilibria from a point to where its parameter leaves a range."""

from typing import NamedTuple

import numpy as np

from .continuation import Point, Tracer
from .events import Event, events

# Points that a curve may have, of those asked for: limit points and steep parts need more.
_ROOM = 20


class Trace(NamedTuple):
    """Points, events with the number of the point before them, and how it ended."""

    points: list[Point]
    events: list[tuple[int, Event]]
    message: str
    success: bool


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
    special: list[tuple[int, Event]] = []
    ds = (high - low) / points
    h = np.inf
    while True:
        point = trace[-1]
        longest = tracer.longest(point, ds, limits)
        step = tracer.step(point, min(longest, 2 * h), longest)
        if step is None:
            return Trace(trace, special, _stopped(tracer, point, len(trace)), False)
        after, h = step
        found = list(events(tracer, point, h, after)) if watch else []
        end = min(max(after.found.s, low), high)
        if end != after.found.s:
            landed = tracer.landed(point, after, end)
            if landed is None:
                return Trace(trace, special, _stopped(tracer, point, len(trace)), False)
            after = landed
        special += [(len(trace) - 1, e) for e in found if low <= e.point.found.s <= high]
        trace.append(tracer.centred(after))
        s = after.found.s
        if s in limits:
            way = [point.found.s for point in trace]
            far = max(way, key=lambda value: abs(value - way[0]))
            turned = "" if far in limits else f" (turned back at s = {far:g})"
            message = f"reached s = {s:g} in {len(trace)} points{turned}"
            return Trace(trace, special, message, True)
        if _closed(tracer, trace):
            message = f"came back to its first point after {len(trace)} points"
            return Trace(trace, special, message, True)
        if len(trace) > _ROOM * points:
            return Trace(trace, special, f"stopped at s = {s:g} after {len(trace)} points", False)


def _stopped(tracer: Tracer, point: Point, count: int) -> str:
    where = f"stopped at s = {point.found.s:.6g} after {count} points: no equilibrium further on"
    if tracer.arc:
        return f"{where} belongs to the same curve; try more points"
    return f"{where} was found in small steps; method='arc' passes limit points"


def _closed(tracer: Tracer, trace: list[Point]) -> bool:
    """Whether the last step has come by the first point, the same way."""
    first, before, last = (trace[k].found.s for k in (0, -2, -1))
    if len(trace) < 5 or (before - first) * (last - first) > 0:
        return False
    if (last - before) * trace[0].tangent[-1] < 0:
        return False
    start, one, other = (_frames(tracer, trace[k]) for k in (0, -2, -1))
    return bool(np.max(np.abs(other - start)) <= np.max(np.abs(other - one)))


def _frames(tracer: Tracer, point: Point) -> np.ndarray:
    """Rotations and origins of the discs, lengths in units of the robot's."""
    model, found = tracer.search.model, point.found
    R, r = model.poses(found.q, found.theta + found.s * tracer.path.d_theta)
    return np.hstack([np.array(R), np.array(r) / model.robot.length])
