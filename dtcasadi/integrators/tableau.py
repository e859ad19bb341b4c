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
        """Order conditions of both solutions; a mistyped number cannot be imported.

        Raises:
            ValueError: the coefficients do not have the order they claim.
        """
        a, b = np.array(self.a, dtype=float), np.array(self.b, dtype=float)
        if a.shape != (len(b), len(b)) or np.any(np.triu(a) != 0):
            raise ValueError(f"{self.name}: expected a strictly lower triangular matrix")
        solutions = [(b, self.order)]
        if self.b_error is not None:
            solutions.append((b - np.asarray(self.b_error), self.error_order))
        for weights, order in solutions:
            if np.max(np.abs(_order_defects(a, weights, order))) > 1e-11:
                raise ValueError(f"{self.name}: the coefficients are not of order {order}")
        for name, value in (("a", a), ("b", b)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def c(self) -> np.ndarray:
        """Stage times in units of the step, shape (s,)."""
        return self.a.sum(axis=1)


def _order_defects(a: np.ndarray, b: np.ndarray, order: int) -> np.ndarray:
    """The 17 conditions up to order 5 (Hairer, Norsett, Wanner, table II.2.1), up to `order`."""
    c = a.sum(axis=1)
    ac, ac2, aac = a @ c, a @ c**2, a @ a @ c
    by_order = (
        [b.sum() - 1],
        [b @ c - 1 / 2],
        [b @ c**2 - 1 / 3, b @ ac - 1 / 6],
        [b @ c**3 - 1 / 4, b @ (c * ac) - 1 / 8, b @ ac2 - 1 / 12, b @ aac - 1 / 24],
        [
            b @ c**4 - 1 / 5,
            b @ (c**2 * ac) - 1 / 10,
            b @ (c * ac2) - 1 / 15,
            b @ (c * aac) - 1 / 30,
            b @ ac**2 - 1 / 20,
            b @ a @ c**3 - 1 / 20,
            b @ a @ (c * ac) - 1 / 40,
            b @ a @ ac2 - 1 / 60,
            b @ a @ aac - 1 / 120,
        ],
    )
    return np.array([defect for defects in by_order[:order] for defect in defects])


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
