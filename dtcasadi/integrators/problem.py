"""What an integration method is given and what it returns."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..commands import FunctionPiece
from ..errors import SimulationError
from ..model import Model
from ..profile import Piece

if TYPE_CHECKING:
    from ..events import Event, Passed


@dataclass(frozen=True, eq=False)
class Problem:
    """One initial-value problem.

    Attributes:
        model: whose compiled state equation is integrated.
        x0: initial state, shape (n_x,).
        theta: parameters, shape (n_theta,).
        pieces: intervals on which the command is smooth, each with its (t_start, t_end).
        rtol: relative tolerance.
        atol: absolute tolerance.
        step_s: step [s] of a method without error control, and the first one of others; or None.
        force: whether to take a step beyond the linear stability limit.
        events: guard functions to watch.
        advance: called with the time reached, for a progress bar.
    """

    model: Model
    x0: np.ndarray
    theta: np.ndarray
    pieces: tuple[Piece, ...] | tuple[FunctionPiece, ...]
    rtol: float
    atol: float
    step_s: float | None = None
    force: bool = False
    events: "tuple[Event, ...]" = ()
    advance: Callable[[float], object] = lambda t: None


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States at the accepted steps, up to the last good one.

    Attributes:
        t: times, shape (n,) [s].
        x: states, shape (n_x, n), after any re-centring at that time.
        x_end: states at the end of each step, before it, shape (n_x, n - 1).
        thetas: parameters in force from each time on, shape (n_theta, n).
        between: states at times inside the run, shape (m,) -> (n_x, m), each in the coordinates of
            the step it is in; never called when there is no step.
        method: what was run, for people.
        failure: empty when the end was reached, else why not.
        note: what else to tell, for example why a method was chosen.
        evaluations: calls of the state equation.
        rejected: steps tried again with a smaller size.
        recentrings: (time, segments from 1) of each re-centring.
        events: guard functions that passed zero.
        ended: name of the event that ended the run, or empty.
    """

    t: np.ndarray
    x: np.ndarray
    x_end: np.ndarray
    thetas: np.ndarray
    between: Callable[[np.ndarray], np.ndarray]
    method: str
    failure: str
    note: str = ""
    evaluations: int = 0
    rejected: int = 0
    recentrings: tuple[tuple[float, tuple[int, ...]], ...] = ()
    events: "tuple[Passed, ...]" = ()
    ended: str = ""

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States, shape (n_x, m), and the parameters they hold with, at times (m,) of the run."""
        step = np.searchsorted(self.t, times, side="right") - 1
        x = self.x[:, step]
        inside = times > self.t[step]
        if np.any(inside):
            x[:, inside] = self.between(times[inside])
        return x, self.thetas[:, step]


class Method(Protocol):
    """An integration method."""

    @property
    def name(self) -> str:
        """What `simulate(method=...)` calls it."""

    def prepare(self, model: Model) -> None:
        """Compile what the method needs of a model."""

    def integrate(self, problem: Problem) -> Trajectory:
        """Run the problem to its end or to where it fails."""


def refuse_events(name: str, problem: Problem) -> None:
    """For methods whose steps this package cannot repeat.

    Raises:
        SimulationError: there are events to watch.
    """
    if problem.events:
        raise SimulationError(
            f"events: method {name} cannot locate them; use a method of this package, such as auto "
            "with the pressure as numbers or a Profile"
        )
