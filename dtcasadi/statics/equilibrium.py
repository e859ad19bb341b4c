"""Where a robot rests: `equilibrium` and what it returns."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from .. import checks
from ..errors import StaticsError
from ..model import Model
from ..ratings import warn_above_rating
from ..recentring import chart_limit
from .continuation import Tracer
from .following import follow
from .loads import LoadPath, load_error, ramped
from .search import Found, Mode, Search, Why, search_of
from .stability import Stability, stability

# How far a pose that gives way is pushed [rad], and how many such poses are left in one search.
NUDGE, NUDGES = 0.05, 8
_RAMP = 40  # points on the way from no loads to all
_WORDS = {
    Why.FOUND: "found",
    Why.MOST: "too many iterations",
    Why.STUCK: "stuck",
    Why.NOT_FINITE: "not finite",
    Why.SINGULAR: "singular chart",
}


class _OfStability:
    """A figure of an equilibrium's stability; StaticsError where there is no equilibrium."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name, self.__doc__ = name, getattr(Stability, name).__doc__

    def __get__(self, found: "Equilibrium | None", owner: type) -> Any:
        """Its value (or this descriptor from the class, for its documentation)."""
        if found is None:
            return self
        if found.stability is None:
            raise StaticsError(f"expected an equilibrium, got: {found.message}")
        return getattr(found.stability, self._name)


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A pose in which a robot can rest, or the news that none was found.

        gravity(q) + spring(q) + ... = inflation(q, pressure) + tau,    qd = qdd = 0

    `eigenvalues`, `frequencies`, `mode_shapes` and `floppy` are those of its `stability`; without
    an equilibrium they raise StaticsError.

    Attributes:
        model: the model.
        q: coordinates, shape (n_q,) [rad]; NaN where none was found.
        theta: parameters that go with q, shape (n_theta,); re-centring changes A, B in it.
        pressure: chamber pressures, shape (n_u,) [Pa].
        tau: generalized forces applied, shape (n_q,) [N m].
        success: whether q is an equilibrium. Its residual has been checked.
        status: `found`, `too many iterations`, `stuck`, `not finite` or `singular chart`.
        message: one sentence.
        residual: largest generalized force that is not balanced, at the last pose tried [N m].
        load: largest sum of absolute parts of a generalized force there [N m]: what the residual
            is to be compared with.
        stability: what small motion about it does; None where none was found.
        iterations: Newton steps.
        evaluations: computations of the balance and its derivatives.
        recentrings: how many segments were re-centred on the way.
        wall_time: time spent [s].
    """

    model: Model
    q: np.ndarray
    theta: np.ndarray
    pressure: np.ndarray
    tau: np.ndarray
    success: bool
    status: str
    message: str
    residual: float
    load: float
    stability: Stability | None
    iterations: int
    evaluations: int
    recentrings: int
    wall_time: float

    @property
    def stable(self) -> bool:
        """Whether it is an equilibrium about which no small motion grows."""
        return self.stability is not None and self.stability.stable

    @property
    def kind(self) -> str:
        """`stable`, `neutral`, `divergence` or `flutter`, see `Stability`; `none` without one."""
        return "none" if self.stability is None else self.stability.kind

    eigenvalues = _OfStability()
    frequencies = _OfStability()
    squared_frequencies = _OfStability()
    mode_shapes = _OfStability()
    floppy = _OfStability()

    @cached_property
    def thread_tension(self) -> np.ndarray:
        """Pull of each thread, shape (n_discs - 1,) [N]; a real thread would go slack below 0."""
        still = np.zeros(self.model.n_q)
        tension = self.model.thread_tension(self.q, still, self.pressure, self.tau, self.theta)
        return np.array(tension).ravel()

    @cached_property
    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Disc frames in the root frame, R (n_discs, 3, 3), and origins r (n_discs, 3) [m]."""
        n = self.model.n_discs
        R, r = self.model.poses(self.q, self.theta)
        return np.array(R).reshape(3, n, 3).transpose(1, 0, 2), np.array(r).T


def equilibrium(
    model: Model,
    pressure: float | Sequence[float] | np.ndarray = 0.0,
    *,
    guess: Sequence[float] | np.ndarray | Equilibrium | None = None,
    theta: np.ndarray | None = None,
    tau: Sequence[float] | np.ndarray | None = None,
) -> Equilibrium:
    """Find a pose in which the robot rests.

    Without a guess the robot is let go at its rest pose and followed, without inertia, to where it
    stays; a pose that gives way (divergence) is left by a nudge along its mode. With a guess, the
    equilibrium next to it is found, stable or not; if that fails the robot is let go there. Charts
    that can re-centre do so on the way, so that no pose is singular. See `dtcasadi.statics.search`
    for the method.

    Args:
        model: the model; its actuator has no part in this.
        pressure: chamber pressure, one for all or one for each [Pa].
        guess: coordinates to start from, shape (n_q,) [rad], or an earlier equilibrium, of which
            A and B are taken too.
        theta: parameters, shape (n_theta,); default: the robot's own.
        tau: generalized forces to apply, shape (n_q,) [N m].

    Returns:
        The equilibrium, its stability, and how it was found. If there is none to be found, a result
        with `success` False, a sentence, and no pose.

    Raises:
        StaticsError: an argument cannot be used; the text says what was expected.

    Warns:
        PressureWarning: a chamber's pressure is beyond what it is rated for.
    """
    start = time.perf_counter()
    path, q = checked(model, pressure, guess, theta, tau)
    warn_above_rating(model.robot, path.pressure[:, np.newaxis])
    search = search_of(model)
    count = Counter()
    hint = "try another guess"
    if guess is None:
        found, small = _settled(search, path, q, count)
        if small is None and found.why is not Why.SINGULAR:
            found, small, hint = _approached(search, path, found, count)
    else:
        found = count(search.run(path, q, mode=Mode.NEAREST))
        if found.why is not Why.FOUND:
            found = count(search.run(path, q))
        small = stability_of(found)
    outcome = result(model, path, found, small, count, time.perf_counter() - start)
    if found.why in (Why.FOUND, Why.SINGULAR):
        return outcome
    return replace(outcome, message=f"{outcome.message}; {hint}")


class Counter:
    """Adds up what several searches cost."""

    def __init__(self) -> None:
        self.iterations = self.evaluations = self.recentrings = 0

    def __call__(self, found: Found) -> Found:
        """Count a search and hand it on."""
        self.iterations += found.iterations
        self.evaluations += found.evaluations
        self.recentrings += found.recentrings
        return found


def checked(
    model: Model, pressure: object, guess: object, theta: object, tau: object
) -> tuple[LoadPath, np.ndarray]:
    """Constant loads and coordinates to start from, of the right shapes.

    Raises:
        StaticsError: one is not.
    """
    if not isinstance(model, Model):
        raise StaticsError(f"model: expected a Model, got {checks.shown(model)}")
    if np.ndim(pressure) == 0:  # type: ignore[arg-type]
        pressure = np.full(model.n_u, checks.number("pressure", pressure, error=load_error))
    if isinstance(guess, Equilibrium):
        theta = guess.theta if theta is None else theta
        guess = guess.q
    still = np.zeros(model.n_q)
    path = LoadPath.constant(
        checks.array("pressure", pressure, (model.n_u,), error=load_error),
        still if tau is None else checks.array("tau", tau, (model.n_q,), error=load_error),
        model.theta0
        if theta is None
        else checks.array("theta", theta, model.theta0.shape, error=load_error),
    )
    q = still if guess is None else checks.array("guess", guess, (model.n_q,), error=load_error)
    return path, q


def _settled(
    search: Search, path: LoadPath, q: np.ndarray, count: Counter
) -> tuple[Found, Stability | None]:
    """Let go at q and followed to where nothing gives way; at worst a pose that does."""
    found = count(search.run(path, q))
    small = stability_of(found)
    for _ in range(NUDGES):
        if small is None or not small.divergent:
            break
        push = small.growing_shape
        start = found.q + NUDGE * push / np.max(np.abs(push))
        after = count(search.run(replace(path, theta=found.theta), start))
        if after.why is not Why.FOUND:
            break
        found, small = after, stability_of(after)
    return found, small


def _approached(
    search: Search, path: LoadPath, failed: Found, count: Counter
) -> tuple[Found, Stability | None, str]:
    """The loads put on from nothing, along one curve; without success the failure and a hint."""
    ramp = ramped(search.model, path)
    still = np.zeros(search.model.n_q)
    start, small = _settled(search, ramp, still, count)
    if small is None:
        return failed, None, "nor is there one without loads"
    tracer = Tracer(search, ramp, 1.0)
    first = tracer.point(start, np.append(still, 1.0))
    trace = follow(tracer, first, (0.0, 1.0), _RAMP, watch=False)
    for point in trace.points:
        count(point.found)
    last = trace.points[-1]
    if trace.success and last.found.s == 1.0:
        end = replace(path, theta=last.found.theta)
        found = count(search.run(end, last.found.q, mode=Mode.NEAREST))
        return found, stability_of(found), ""
    most = max(point.found.s for point in trace.points)
    return failed, None, f"put on from nothing, the loads can be balanced up to {most:.3g} of them"


def stability_of(found: Found) -> Stability | None:
    """The stability of what a search found, if it found something."""
    return stability(found.M, found.D, found.K) if found.why is Why.FOUND else None


def result(
    model: Model,
    path: LoadPath,
    found: Found,
    small: Stability | None,
    count: Counter,
    wall_time: float,
) -> Equilibrium:
    """The outcome of a search for people."""
    pressure, tau, theta = replace(path, theta=found.theta).at(found.s)
    success = small is not None
    return Equilibrium(
        model=model,
        q=found.q if success else np.full(model.n_q, np.nan),
        theta=theta,
        pressure=pressure,
        tau=tau,
        success=success,
        status=_WORDS[found.why],
        message=_sentence(model, found, small),
        residual=found.residual,
        load=found.load,
        stability=small,
        iterations=count.iterations,
        evaluations=count.evaluations,
        recentrings=count.recentrings,
        wall_time=wall_time,
    )


def _sentence(model: Model, found: Found, small: Stability | None) -> str:
    if found.why is Why.SINGULAR:
        where = chart_limit(model, found.q)
        hint = "try chart='cardan' with damping='physical'"
        return f"no equilibrium found that the chart can hold: {where}; {hint}"
    balance = f"{found.residual:.1e} of {found.load:.3g} N m unbalanced"
    if small is None:
        reason = {
            Why.MOST: f"none after {found.iterations} iterations",
            Why.STUCK: "no step brings the forces closer to balance",
            Why.NOT_FINITE: "the forces are not finite",
        }[found.why]
        return f"no equilibrium found: {reason}, {balance}"
    if small.kind == "neutral":
        manner = f"neutral, {_many(small.floppy.shape[1], 'direction')} without stiffness"
    elif small.stable:
        manner = "stable"
    else:
        ways = {"divergence": small.divergent, "flutter": small.fluttering}
        growing = [f"{_many(n, 'mode')} of {kind}" for kind, n in ways.items() if n]
        manner = f"unstable, {' and '.join(growing)}"
    return f"equilibrium: {manner}; {balance}"


def _many(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
