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


def lower(*rows: list[float]) -> np.ndarray:
    """A strictly lower triangular matrix from its rows below the first."""
    s = len(rows) + 1
    a = np.zeros((s, s))
    for i, row in enumerate(rows, 1):
        a[i, : len(row)] = row
    return a


EULER = Tableau("euler", 1, np.zeros((1, 1)), np.array([1.0]), "Euler 1768")
HEUN = Tableau("heun", 2, lower([1.0]), np.array([0.5, 0.5]), "Heun 1900")
RK4 = Tableau(
    "rk4",
    4,
    lower([0.5], [0.0, 0.5], [0.0, 0.0, 1.0]),
    np.array([1, 2, 2, 1]) / 6,
    "Kutta 1901",
)
DOPRI5 = Tableau(
    "dopri5",
    5,
    lower(
        [1 / 5],
        [3 / 40, 9 / 40],
        [44 / 45, -56 / 15, 32 / 9],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ),
    np.array([35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84, 0]),
    "Dormand, Prince, J. Comput. Appl. Math. 6 (1980)",
    np.array(
        [
            *(71 / 57600, 0, -71 / 16695, 71 / 1920),
            *(-17253 / 339200, 22 / 525, -1 / 40),
        ]
    ),
    4,
)
TSIT5 = Tableau(
    "tsit5",
    5,
    lower(
        [0.161],
        [-0.008480655492356989, 0.335480655492357],
        [2.8971530571054935, -6.359448489975075, 4.3622954328695815],
        [5.325864828439257, -11.748883564062828, 7.4955393428898365, -0.09249506636175525],
        [
            *(5.86145544294642, -12.92096931784711, 8.159367898576159),
            *(-0.071584973281401, -0.028269050394068383),
        ],
        [
            *(0.09646076681806523, 0.01, 0.4798896504144996),
            *(1.379008574103742, -3.290069515436081, 2.324710524099774),
        ],
    ),
    np.array(
        [
            *(0.09646076681806523, 0.01, 0.4798896504144996),
            *(1.379008574103742, -3.290069515436081, 2.324710524099774, 0),
        ]
    ),
    "Tsitouras, Comput. Math. Appl. 62 (2011)",
    np.array(
        [
            *(-0.00178001105222577714, -0.0008164344596567469, 0.007880878010261995),
            *(-0.1447110071732629, 0.5823571654525552, -0.45808210592918697, 1 / 66),
        ]
    ),
    4,
)
