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
    name: str = "pressure"
    delay: float = 0.0

    def __call__(self, t: float) -> np.ndarray:
        """Value at t - delay, before 0 that at 0, shape (n_u,).

        Raises:
            SimulationError: the function gave another shape, or a value that is not finite.
        """
        t = max(t - self.delay, 0.0) if self.delay else t
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
            raise _error(f"{self.name}({t:g})", expected, checks.shown(given))
        return value


def command_pieces(
    given: CommandLike,
    n_u: int,
    t_end: float,
    *,
    name: str = "pressure",
    delay: float = 0.0,
    before: np.ndarray | None = None,
) -> tuple[Piece, ...] | tuple[FunctionPiece, ...]:
    """The command on [0, t_end] as pieces, split where it jumps or kinks.

    Args:
        given: a number for all chambers, one per chamber, a `Profile`, or a function of time.
        n_u: number of commands.
        t_end: duration [s].
        name: what errors call it.
        delay: dead time before it arrives [s].
        before: what arrives until then, shape (n_u,); default: what the command says before 0 (a
            function: its value at 0).

    Raises:
        SimulationError: a value is not finite, or not one per chamber.
    """
    if callable(given) and not isinstance(given, Profile):
        return (FunctionPiece(given, n_u, 0.0, t_end, name, delay),)
    if not isinstance(given, Profile):
        values = np.asarray(given)
        if values.ndim == 0:
            number = checks.number(name, given, error=_error)
            values = np.full(n_u, number)
        elif values.shape == (n_u,) and n_u > 1:  # name the chamber whose command is not a number
            for k, value in enumerate(given, 1):  # type: ignore[arg-type]
                checks.number(f"{name}[{k}]", value, error=_error)
        given = Profile.constant(checks.array(name, values, (n_u,), error=_error))
    if given.n_u != n_u:
        raise _error(name, f"{n_u} commands, one for each chamber", given.n_u)
    return _delayed(given, t_end, delay, before) if delay else given.pieces(0.0, t_end)


def _delayed(
    profile: Profile, t_end: float, delay: float, before: np.ndarray | None
) -> tuple[Piece, ...]:
    """The profile's pieces, each `delay` later."""
    start = -delay if before is None else 0.0
    held = [] if before is None else [Piece(0.0, delay, before, np.zeros(profile.n_u))]
    if delay >= t_end and before is not None:
        return (held[0]._replace(t_end=t_end),)
    late = [
        piece._replace(t_start=piece.t_start + delay, t_end=piece.t_end + delay)
        for piece in profile.pieces(start, t_end - delay)
    ]
    late[0] = late[0]._replace(t_start=delay if held else 0.0)
    late[-1] = late[-1]._replace(t_end=t_end)
    return (*held, *late)


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
