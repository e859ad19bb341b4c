"""Explicit Runge-Kutta tableaux as frozen values that prove themselves when imported."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Tableau:
    """Coefficients of an explicit method, notation of Hairer, Norsett, Wanner, section II.1.

    x_next = x + h sum b_i k_i,  k_i = f(t + c_i h, x + h sum_j<i a_ij k_j).

    Attributes:
        name: what `simulate(method=...)` calls it.
        order: order of consistency.
        a: strictly lower triangular, shape (s, s).
        b: weights, shape (s,).
        source: where the coefficients are from.
        b_error: weights of the embedded error estimate h sum b_error_i k_i, shape (s,); None
            without one.
        error_order: order of the lower of the two embedded solutions.
    """

    name: str
    order: int
    a: np.ndarray
    b: np.ndarray
    source: str
    b_error: np.ndarray | None = None
    error_order: int = 0

    def __post_init__(self) -> None:
        """Sum conditions of order 1 to 3 and the shape; a mistyped number cannot be imported."""
        a, b = np.asarray(self.a, dtype=float), np.asarray(self.b, dtype=float)
        s = len(b)
        assert a.shape == (s, s) and np.all(np.triu(a) == 0), self.name
        c = a.sum(axis=1)
        conditions = [b.sum() - 1, b @ c - 1 / 2, b @ c**2 - 1 / 3, b @ a @ c - 1 / 6]
        count = {1: 1, 2: 2}.get(self.order, 4)
        assert np.allclose(conditions[:count], 0, atol=1e-12), self.name
        if self.b_error is not None:
            assert abs(np.sum(self.b_error)) < 1e-12, self.name
        object.__setattr__(self, "a", a)
        object.__setattr__(self, "b", b)

    @property
    def c(self) -> np.ndarray:
        """Stage times in units of the step, shape (s,)."""
        return self.a.sum(axis=1)


def _lower(*rows: list[float]) -> np.ndarray:
    """A strictly lower triangular matrix from its rows below the first."""
    s = len(rows) + 1
    a = np.zeros((s, s))
    for i, row in enumerate(rows, 1):
        a[i, : len(row)] = row
    return a


EULER = Tableau("euler", 1, np.zeros((1, 1)), np.array([1.0]), "Euler 1768")
HEUN = Tableau("heun", 2, _lower([1.0]), np.array([0.5, 0.5]), "Heun 1900")
RK4 = Tableau(
    "rk4",
    4,
    _lower([0.5], [0.0, 0.5], [0.0, 0.0, 1.0]),
    np.array([1, 2, 2, 1]) / 6,
    "Kutta 1901",
)
