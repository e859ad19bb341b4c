"""A command (pressure, valve opening, ...) against time, piecewise constant or linear."""

from dataclasses import dataclass, field
from typing import Literal, NamedTuple, Self

import numpy as np

from . import checks
from .errors import ProfileError


class Piece(NamedTuple):
    """A profile between two neighbouring breakpoints, affine on the closed [t_start, t_end].

    Attributes:
        t_start: its first instant [s].
        t_end: its last instant [s]; the value there is the one that holds before a step.
        start: value at t_start, shape (n_u,).
        slope: rate of change, shape (n_u,); zero for a step profile.
    """

    t_start: float
    t_end: float
    start: np.ndarray
    slope: np.ndarray

    def __call__(self, t: float) -> np.ndarray:
        """Value at t, shape (n_u,)."""
        return self.start + (t - self.t_start) * self.slope


@dataclass(frozen=True, eq=False)
class Profile:
    """Command values at given times; outside them the first and the last one are held.

    A `step` profile is continuous from the right: at `times[k]` the value `values[k]` holds. An
    integrator must arrive at such an instant with the value before it, so it walks `pieces`, each
    smooth on its closed interval, instead of calling the profile at the end of a step.

    Attributes:
        times: strictly increasing, shape (n,), n >= 1 [s].
        values: shape (n, n_u), or (n,) for a single command; stored as (n, n_u).
        kind: `step` or `linear`.

    Raises:
        ProfileError: naming the field, what was expected and what was given.
    """

    times: np.ndarray
    values: np.ndarray
    kind: Literal["step", "linear"] = "step"
    # Rate of change from times[k] on, shape (n, n_u); the last row is zero.
    _slopes: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check every field."""
        if self.kind not in ("step", "linear"):
            raise ProfileError("kind", "step or linear", checks.shown(self.kind))
        times, values = (
            checks.array("times", self.times, (None,), error=ProfileError),
            _rows(self.values),
        )
        if not len(times):
            raise ProfileError("times", "at least one time", "none")
        if np.any(np.diff(times) <= 0):
            raise ProfileError("times", "strictly increasing times", checks.shown(times))
        if len(values) != len(times):
            raise ProfileError("values", f"{len(times)} rows, one for each time", len(values))
        slopes = np.zeros_like(values)
        if self.kind == "linear":
            with np.errstate(over="ignore"):
                slopes[:-1] = np.diff(values, axis=0) / np.diff(times)[:, np.newaxis]
        if not np.all(np.isfinite(slopes)):
            raise ProfileError("times", "intervals that give finite slopes", checks.shown(times))
        for name, value in (("times", times), ("values", values), ("_slopes", slopes)):
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    @classmethod
    def constant(cls, value: float | np.ndarray) -> Self:
        """The same command at all times, a number or shape (n_u,)."""
        return cls(np.zeros(1), [value])  # type: ignore[arg-type]

    @property
    def n_u(self) -> int:
        """Number of commands."""
        return self.values.shape[1]

    @property
    def breakpoints(self) -> np.ndarray:
        """Times at which the value (`step`) or its rate (`linear`) changes, shape (n_b,) [s]."""
        kept = self.values if self.kind == "step" else self._slopes
        before = kept[:1] if self.kind == "step" else np.zeros((1, self.n_u))
        return self.times[np.any(np.diff(kept, axis=0, prepend=before) != 0, axis=1)]

    def __call__(self, t: float) -> np.ndarray:
        """Value at t, shape (n_u,); at a step the new one."""
        return self.sample(np.array([t], dtype=float))[:, 0]

    def sample(self, times: np.ndarray) -> np.ndarray:
        """Values at many times, shape (n_u, len(times))."""
        k = np.maximum(np.searchsorted(self.times, times, side="right") - 1, 0)
        elapsed = np.clip(times, self.times[0], self.times[-1]) - self.times[k]
        return (self.values[k] + elapsed[:, np.newaxis] * self._slopes[k]).T

    def pieces(self, t_start: float, t_end: float) -> tuple[Piece, ...]:
        """The smooth pieces that cover [t_start, t_end], in order, split at the breakpoints.

        Raises:
            ProfileError: t_end is not after t_start.
        """
        if not t_start < t_end:
            raise ProfileError("t_end", f"a time after t_start = {t_start:g}", t_end)
        inner = self.breakpoints
        inner = inner[(inner > t_start) & (inner < t_end)]
        edges = [float(t_start), *inner.tolist(), float(t_end)]
        return tuple(self._piece(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True))

    def _piece(self, t_start: float, t_end: float) -> Piece:
        """The piece on an interval without a breakpoint inside."""
        k = int(np.searchsorted(self.times, t_start, side="right")) - 1
        slope = self._slopes[k] if k >= 0 else np.zeros(self.n_u)
        return Piece(t_start, t_end, self(t_start), slope)


def _rows(values: np.ndarray) -> np.ndarray:
    """The values as finite numbers of shape (n, n_u)."""
    try:
        single = np.ndim(values) == 1
    except ValueError:  # rows of different lengths
        single = False
    if single:
        return checks.array("values", values, (None,), error=ProfileError).reshape(-1, 1)
    return checks.array("values", values, (None, None), error=ProfileError)
