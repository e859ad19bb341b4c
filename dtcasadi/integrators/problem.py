"""What an integration method is given and what it returns."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..commands import FunctionPiece
from ..model import Model
from ..profile import Piece


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
        step_s: step of a fixed-step method [s], or None.
        advance: called with the time reached, for a progress bar.
    """

    model: Model
    x0: np.ndarray
    theta: np.ndarray
    pieces: tuple[Piece, ...] | tuple[FunctionPiece, ...]
    rtol: float
    atol: float
    step_s: float | None
    advance: Callable[[float], object] = lambda t: None


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States at the accepted steps, up to the last good one.

    Attributes:
        t: times, shape (n,) [s].
        x: states, shape (n_x, n).
        message: empty when the end was reached, else why not.
        evaluations: calls of the state equation.
        between: states at times between the steps, shape (m,) -> (n_x, m).
    """

    t: np.ndarray
    x: np.ndarray
    message: str
    evaluations: int
    between: Callable[[np.ndarray], np.ndarray]


class Method(Protocol):
    """An integration method."""

    @property
    def name(self) -> str:
        """What `simulate(method=...)` calls it."""

    def prepare(self, model: Model) -> None:
        """Compile what the method needs of a model."""

    def integrate(self, problem: Problem) -> Trajectory:
        """Run the problem to its end or to where it fails."""
