"""Commands in every form a user may give them, as smooth pieces of time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from . import checks
from .errors import SimulationError
from .profile import Piece, Profile

CommandLike = float | Sequence[float] | np.ndarray | Profile | Callable[[float], np.ndarray]


@dataclass(frozen=True)
class FunctionPiece:
    """A user's function of time on [t_start, t_end]; its values are checked at every call."""

    function: Callable[[float], np.ndarray]
    n_u: int
    t_start: float
    t_end: float

    def __call__(self, t: float) -> np.ndarray:
        """Value at t, shape (n_u,).

        Raises:
            SimulationError: the function gave another shape, or a value that is not finite.
        """
        given = self.function(t)
        try:
            value = np.atleast_1d(np.asarray(given, dtype=float))
        except (TypeError, ValueError):  # text, a dictionary, rows of different lengths
            value = np.array([np.nan])
        if value.shape == (1,):
            value = np.repeat(value, self.n_u)
        if value.shape != (self.n_u,) or not np.all(np.isfinite(value)):
            each = "" if self.n_u == 1 else f", or {self.n_u}, one for each chamber"
            expected = f"a finite number{each}"
            raise _error(f"pressure({t:g})", expected, checks.shown(given))
        return value


def command_pieces(
    given: CommandLike, n_u: int, t_end: float
) -> tuple[Piece, ...] | tuple[FunctionPiece, ...]:
    """The command on [0, t_end] as pieces, split where it jumps or kinks.

    Args:
        given: a number for all chambers, one per chamber, a `Profile`, or a function of time.
        n_u: number of commands.
        t_end: duration [s].

    Raises:
        SimulationError: a value is not finite, or not one per chamber.
    """
    if callable(given) and not isinstance(given, Profile):
        return (FunctionPiece(given, n_u, 0.0, t_end),)
    if not isinstance(given, Profile):
        values = np.asarray(given)
        if values.ndim == 0:
            number = checks.number("pressure", given, error=_error)
            values = np.full(n_u, number)
        given = Profile.constant(checks.array("pressure", values, (n_u,), error=_error))
    if given.n_u != n_u:
        raise _error("pressure", f"{n_u} commands, one for each chamber", given.n_u)
    return given.pieces(0.0, t_end)


def sampled(
    pieces: Sequence[Piece] | Sequence[FunctionPiece], times: np.ndarray, n_u: int
) -> np.ndarray:
    """Commands at increasing times, shape (n_u, len(times)); at a jump the value after it."""
    values = np.zeros((n_u, len(times)))
    starts = np.array([piece.t_start for piece in pieces])
    owners = np.maximum(np.searchsorted(starts, times, side="right") - 1, 0)
    for k, (t, owner) in enumerate(zip(times, owners, strict=True)):
        values[:, k] = pieces[owner](t)
    return values


def _error(field: str, expected: str, got: object) -> SimulationError:
    return SimulationError(f"{field}: expected {expected}, got {got}")
