"""Guard functions of a simulation: where one changes sign, an event is located."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from . import checks
from .errors import SimulationError

GuardFunction = Callable[[float, np.ndarray, np.ndarray], object]


@dataclass(frozen=True)
class Event:
    """A guard function g(t, x, theta), whose zero is located to round-off in t.

    The step that passes the zero is repeated with other sizes until it ends just behind it, so the
    state there is as accurate as any other step's end. A step in which g passes zero twice is not
    noticed: bound it by tighter tolerances.

    Attributes:
        function: called with t [s], x (n_x,) and theta (n_theta,), gives one finite number. Where
            charts re-centre, coordinates only mean something together with theta: build g on
            `model.poses(q, theta)` and the like. A CasADi Function with these three inputs serves.
        name: what the result calls it.
        direction: +1 for rising zeros only, -1 for falling ones, 0 for both.
        terminal: whether the run ends there.

    Raises:
        SimulationError: not a function, or another direction.
    """

    function: GuardFunction
    name: str = "event"
    direction: int = 0
    terminal: bool = True

    def __post_init__(self) -> None:
        """Check the fields."""
        if not callable(self.function):
            raise _error("function", "a function of t, x, theta", checks.shown(self.function))
        if self.direction not in (-1, 0, 1):
            raise _error("direction", "-1, 0 or 1", checks.shown(self.direction))

    def value(self, t: float, x: np.ndarray, theta: np.ndarray) -> float:
        """G there.

        Raises:
            SimulationError: the function gave something else than a finite number.
        """
        given = self.function(t, x, theta)
        try:
            value = float(given)  # type: ignore[arg-type]
        except (TypeError, ValueError, RuntimeError):
            value = np.nan
        if not np.isfinite(value):
            raise _error(f"{self.name}({t:g})", "a finite number", checks.shown(given))
        return value


@dataclass(frozen=True, eq=False)
class Passed:
    """A zero of a guard function.

    Attributes:
        name: the event's.
        t: when [s].
        x: state there, shape (n_x,).
        theta: parameters it holds with, shape (n_theta,).
    """

    name: str
    t: float
    x: np.ndarray
    theta: np.ndarray


@dataclass(frozen=True, eq=False)
class Guards:
    """Functions whose sign changes stop the loop: `values`(t, x) -> shape (m,).

    Attributes:
        values: the functions' values; an exception in it ends the run and is raised again.
        directions: +1: rising only, -1: falling only, 0: both; shape (m,).
    """

    values: Callable[[float, np.ndarray], np.ndarray]
    directions: np.ndarray


NO_GUARDS = Guards(lambda t, x: np.zeros(0), np.zeros(0, dtype=np.int64))


def checked(events: object) -> tuple[Event, ...]:
    """The events of a run.

    Raises:
        SimulationError: something else than an `Event` or a sequence of them.
    """
    given = (events,) if isinstance(events, Event) else events
    if not isinstance(given, Sequence) or not all(isinstance(each, Event) for each in given):
        raise SimulationError(
            f"events: expected an Event or a list of them, got {checks.shown(events)}"
        )
    return tuple(given)


def guards_of(events: Sequence[Event], theta: np.ndarray) -> Guards:
    """The functions as the loop of steps calls them, while theta holds."""

    def values(t: float, x: np.ndarray) -> np.ndarray:
        return np.array([event.value(t, x, theta) for event in events])

    return Guards(values, np.array([event.direction for event in events], dtype=np.int64))


def _error(field: str, expected: str, got: object) -> SimulationError:
    return SimulationError(f"events: {field}: expected {expected}, got {got}")
