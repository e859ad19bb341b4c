"""A curve of equilibria under changing loads: `branch` and what it returns."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .. import checks
from ..errors import StaticsError
from ..model import Model
from .continuation import METHODS, Point, Tracer
from .equilibrium import Counter, Equilibrium, checked, equilibrium, result
from .events import Event
from .following import Trace, follow
from .loads import LoadPath, Parameter, load_error, load_path
from .search import Mode, Why, search_of

# Changes of a coordinate to try on leaving a bifurcation [rad].
_TURN_OFF = (0.02, 0.005, 0.05)


@dataclass(frozen=True, eq=False)
class BranchEvent:
    """A special point of a branch.

    Attributes:
        kind: `limit` (s turns back), `bifurcation` (other branches meet it), or `flutter` (its
            onset: a Hopf bifurcation, where motions begin that never rest).
        s: the parameter there.
        after: it lies between the points of this number and the next, from 0.
        multiplicity: how many modes take part.
        equilibrium: the equilibrium there.
        tangent: direction (dq, ds) of the branch there, shape (n_q + 1,).
        shapes: of a bifurcation the directions in which other branches may leave, orthonormal
            columns, shape (n_q, multiplicity); else (n_q, 0).
    """

    kind: str
    s: float
    after: int
    multiplicity: int
    equilibrium: Equilibrium
    tangent: np.ndarray
    shapes: np.ndarray


@dataclass(frozen=True, eq=False)
class Branch:
    """Equilibria along a curve.

    Attributes:
        model: the model.
        parameter: what s is, for people.
        s: the parameter at each point, shape (n,).
        points: the equilibria.
        events: limit points, bifurcations and onsets of flutter, in order.
        success: whether an end of the range was reached.
        message: one sentence: how it went, or where it stopped and why.
        method: `arc` or `step`.
        path: the loads as functions of s.
        limits: range of s in which it was followed.
        wall_time: time spent [s].
    """

    model: Model
    parameter: str
    s: np.ndarray
    points: tuple[Equilibrium, ...]
    events: tuple[BranchEvent, ...]
    success: bool
    message: str
    method: str
    path: LoadPath
    limits: tuple[float, float]
    wall_time: float

    def __repr__(self) -> str:
        """Size and outcome on one line."""
        return f"Branch({len(self.s)} points, {len(self.events)} events: {self.message})"

    @property
    def stable(self) -> np.ndarray:
        """Whether each point is stable, shape (n,)."""
        return np.array([point.stable for point in self.points], dtype=bool)

    @cached_property
    def tips(self) -> np.ndarray:
        """Centre of mass of the last disc at each point, shape (n, 3) [m]."""
        centre = self.model.robot.discs[-1].centre_of_mass
        poses = (point.poses for point in self.points)
        return np.array([r[-1] + R[-1] @ centre for R, r in poses]).reshape(-1, 3)

    def switch(
        self, event: int | None = None, *, side: int = 1, shape: int = 0, points: int = 100
    ) -> "Branch":
        """The branch that leaves this one at a bifurcation.

        Args:
            event: number of the event, from 0; default: the first bifurcation.
            side: 1 or -1: along the shape or against it.
            shape: which of the event's shapes, from 0.
            points: about how many points over the range of s.

        Returns:
            The other branch, from the bifurcation to an end of this one's range; `success` is False
            where none was found.

        Raises:
            StaticsError: the event is no bifurcation, or has no such shape.
        """
        begin = time.perf_counter()
        places = [k for k, each in enumerate(self.events) if each.kind == "bifurcation"]
        k = places[0] if event is None and places else event
        if k not in places:
            raise load_error("event", f"a bifurcation, one of events {places}", event)
        found = self.events[k]
        checks.index("shape", shape, 0, found.shapes.shape[1] - 1, error=load_error)
        if side not in (-1, 1):
            raise load_error("side", "1 or -1", checks.shown(side))
        tracer = Tracer(search_of(self.model), self.path, self.limits[1] - self.limits[0])
        first = _turned_off(tracer, found, side * found.shapes[:, shape])
        if first is None:
            trace = Trace([], [], "no other branch found at the bifurcation", False)
        else:
            trace = follow(tracer, first, self.limits, points)
        other = _branch(self.model, self.parameter, tracer, trace, self.limits, begin)
        events = tuple(replace(each, after=each.after + 1) for each in other.events)
        start = (found.equilibrium, *other.points)
        return replace(other, s=np.append(found.s, other.s), points=start, events=events)


def branch(
    model: Model,
    parameter: Parameter,
    start: float,
    stop: float,
    *,
    pressure: float | Sequence[float] | np.ndarray = 0.0,
    theta: np.ndarray | None = None,
    tau: Sequence[float] | np.ndarray | None = None,
    guess: Sequence[float] | np.ndarray | Equilibrium | None = None,
    back_to: float | None = None,
    points: int = 100,
    method: str = "arc",
) -> Branch:
    """Follow an equilibrium while a load or a parameter s goes from start to stop.

    Args:
        model: the model.
        parameter: what s is: `"pressure"` (of all chambers), `"tau"`, the name of a block of theta
            (all its entries have the value s), or one entry of these, counted from 1, such as
            `"pressure[2]"`, `"wrench[3]"`. Or a direction, changes per unit of s by these names,
            which are added to the other arguments: `{"wrench": [0, 1, 0, 0, 0, 0]}`.
        start: s at the first point.
        stop: s at the last point.
        pressure: chamber pressures that do not change [Pa].
        theta: parameters that do not change.
        tau: generalized forces that do not change [N m].
        guess: where to look for the first point, as for `equilibrium`.
        back_to: how far s may turn back, on the other side of start from stop; default: start.
        points: about how many points: no step changes s by more than (stop - start) / points.
        method: `arc` passes limit points; `step` changes s in equal steps, smaller where the
            equilibrium is not found, and ends at a limit point.

    Returns:
        The branch with the stability of every point and its events. Where it cannot be followed
        further it ends, with `success` False and a sentence.

    Raises:
        StaticsError: an argument cannot be used; the text says what was expected.
    """
    begin = time.perf_counter()
    path = load_path(model, parameter, checked(model, pressure, guess, theta, tau)[0])
    start = checks.number("start", start, error=load_error)
    stop = checks.number("stop", stop, error=load_error)
    if start == stop:
        raise load_error("stop", "a value other than start", stop)
    checks.index("points", points, 1, 10**6, error=load_error)
    if method not in METHODS:
        raise load_error("method", f"one of {', '.join(METHODS)}", checks.shown(method))
    way = float(np.sign(stop - start))
    back_to = start if back_to is None else checks.number("back_to", back_to, error=load_error)
    if (start - back_to) * way < 0:
        raise load_error("back_to", f"a value on the other side of start from {stop:g}", back_to)
    limits = (min(back_to, stop), max(back_to, stop))
    tracer = Tracer(search_of(model), path, abs(stop - start), method == "arc", way)
    first = _first(tracer, model, start, guess)
    if isinstance(first, Equilibrium):
        trace = Trace([], [], f"at s = {start:g}: {first.message}", False)
    else:
        trace = follow(tracer, first, limits, points)
    name = parameter if isinstance(parameter, str) else "s"
    return _branch(model, name, tracer, trace, limits, begin)


def _first(tracer: Tracer, model: Model, start: float, guess: object) -> Point | Equilibrium:
    """The first point, or the news that there is none."""
    pressure, tau, theta = tracer.path.at(start)
    if isinstance(guess, Equilibrium):
        frames = model.theta_blocks.get("frames", slice(0, 0))
        theta[frames] = guess.theta[frames]
        guess = guess.q
    found = equilibrium(model, pressure, guess=guess, theta=theta, tau=tau)  # type: ignore[arg-type]
    if not found.success:
        return found
    base = replace(tracer.path, theta=found.theta - start * tracer.path.d_theta)
    still = np.zeros(model.n_q)
    along = np.append(still, tracer.way)
    return tracer.point(tracer.search.run(base, found.q, start, normal=still), along)


def _turned_off(tracer: Tracer, event: BranchEvent, shape: np.ndarray) -> Point | None:
    """A point of another branch, off the bifurcation in a direction across this one."""
    q, n = event.equilibrium.q, len(shape)
    path = tracer.path
    theta = event.equilibrium.theta - event.s * path.d_theta
    across = np.append(shape, 0.0)
    tangent = event.tangent / np.sqrt(event.tangent @ tracer.metric(event.tangent))
    across -= (across @ tracer.metric(tangent)) * tangent
    weights = tracer.metric(across)
    for size in _TURN_OFF:
        step = size * across / np.max(np.abs(across[:n]))
        found = tracer.search.run(
            replace(path, theta=theta),
            q + step[:n],
            event.s + step[n],
            mode=Mode.NEAREST,
            normal=weights[:n],
            weight=weights[n],
        )
        if found.why is Why.FOUND and np.max(np.abs(found.q - q - step[:n])) < 5 * size:
            return tracer.point(found, across)
    return None


def _branch(
    model: Model,
    name: str,
    tracer: Tracer,
    trace: Trace,
    limits: tuple[float, float],
    begin: float,
) -> Branch:
    """What was traced, for people."""

    def public(point: Point) -> Equilibrium:
        count = Counter()
        return result(model, tracer.path, count(point.found), point.small, count, 0.0)

    return Branch(
        model=model,
        parameter=name,
        s=np.array([point.found.s for point in trace.points]),
        points=tuple(public(point) for point in trace.points),
        events=tuple(_event(after, e, public(e.point)) for after, e in trace.events),
        success=trace.success,
        message=trace.message,
        method="arc" if tracer.arc else "step",
        path=tracer.path,
        limits=limits,
        wall_time=time.perf_counter() - begin,
    )


def _event(after: int, event: Event, found: Equilibrium) -> BranchEvent:
    point = event.point
    return BranchEvent(
        event.kind,
        point.found.s,
        after,
        event.multiplicity,
        found,
        point.tangent,
        event.shapes,
    )


__all__ = ["Branch", "BranchEvent", "StaticsError", "branch"]
