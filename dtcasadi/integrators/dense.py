"""Dense output: states between the accepted steps."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .problem import Problem


@dataclass(frozen=True, eq=False)
class Quintic:
    """q by quintic Hermite from q, qd, qdd at both ends of a step, qd its slope; O(h^6) in q.

    Actuator states by cubic Hermite. Any method's steps can be joined so: all it takes is the state
    equation at their ends (Hairer, Norsett, Wanner I, section II.6).

    Attributes:
        problem: whose state equation gives the rates.
        t: times of the steps, shape (n,) [s].
        x: states at the start of each step, and the last, shape (n_x, n).
        ends: states at the end of each step in the step's own coordinates, shape (n_x, n - 1).
        thetas: parameters of each step, shape (n_theta, n).
    """

    problem: Problem
    t: np.ndarray
    x: np.ndarray
    ends: np.ndarray
    thetas: np.ndarray

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """States at some times, shape (m,) -> (n_x, m), in the coordinates of the step they are in.

        A time between two steps belongs to the later one.
        """
        owner = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.t) - 2)
        steps, place = np.unique(owner, return_inverse=True)
        n, h = self.problem.model.n_q, np.diff(self.t)[steps]
        starts, ends = self.x[:, steps], self.ends[:, steps]
        first = self._rates(steps, starts, at_start=True)
        second = self._rates(steps, ends, at_start=False)
        bend = (h**k * part for part, k in _orders(n, starts, first))
        curve = quintic(*bend, *(h**k * part for part, k in _orders(n, ends, second)))
        z0, z1 = starts[2 * n :], ends[2 * n :]
        line = cubic(z0, h * first[2 * n :], z1, h * second[2 * n :])
        s = (times - self.t[owner]) / h[place]
        bent = _polynomial(s, curve, place)
        slope = _polynomial(s, slopes(curve), place) / h[place]
        other = _polynomial(s, line, place)
        return np.concatenate([bent, slope, other])

    def _rates(self, steps: np.ndarray, x: np.ndarray, *, at_start: bool) -> np.ndarray:
        """State derivatives at one end of some steps, shape (n_x, m)."""
        pieces = self.problem.pieces
        ode = self.problem.model.compiled("ode")
        t = self.t[steps if at_start else steps + 1]
        starts = np.array([piece.t_start for piece in pieces])
        after = np.searchsorted(starts, t, side="right" if at_start else "left")
        rates = np.empty_like(x)
        for k, piece in enumerate(np.maximum(after - 1, 0)):
            ode.inputs.x[:], ode.inputs.theta[:] = x[:, k], self.thetas[:, steps[k]]
            ode.inputs.u[:] = pieces[piece](t[k])
            ode.run()
            rates[:, k] = ode.outputs.xdot
        return rates


@dataclass(frozen=True, eq=False)
class Chord:
    """Straight lines between the ends of steps through rigid contact.

    The state equation knows nothing of impulses, so it cannot give the curve's slopes there.

    Attributes:
        t: times of the steps, shape (n,) [s].
        x: states at the start of each step, and the last, shape (n_x, n).
        ends: states at the end of each step, shape (n_x, n - 1).
    """

    t: np.ndarray
    x: np.ndarray
    ends: np.ndarray

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """States at some times, shape (m,) -> (n_x, m), as those of `Quintic`."""
        owner = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.t) - 2)
        s = (times - self.t[owner]) / np.diff(self.t)[owner]
        return (1 - s) * self.x[:, owner] + s * self.ends[:, owner]


def _orders(n: int, x: np.ndarray, xdot: np.ndarray) -> Iterator[tuple[np.ndarray, int]]:
    """q, qd and qdd with their orders of differentiation."""
    yield from ((x[:n], 0), (x[n : 2 * n], 1), (xdot[n : 2 * n], 2))


def quintic(q0: Any, v0: Any, a0: Any, q1: Any, v1: Any, a1: Any) -> tuple[Any, ...]:
    """Coefficients of s^0 ... s^5 on [0, 1] with these values and derivatives at its ends."""
    c3 = 10 * (q1 - q0) - 6 * v0 - 4 * v1 - (3 * a0 - a1) / 2
    c4 = -15 * (q1 - q0) + 8 * v0 + 7 * v1 + (3 * a0 - 2 * a1) / 2
    c5 = 6 * (q1 - q0) - 3 * (v0 + v1) - (a0 - a1) / 2
    return q0, v0, a0 / 2, c3, c4, c5


def cubic(z0: Any, d0: Any, z1: Any, d1: Any) -> tuple[Any, ...]:
    """Coefficients of s^0 ... s^3 on [0, 1] with these values and slopes at its ends."""
    return z0, d0, 3 * (z1 - z0) - 2 * d0 - d1, 2 * (z0 - z1) + d0 + d1


def slopes(coefficients: Sequence[Any]) -> tuple[Any, ...]:
    """Coefficients of the derivative."""
    return tuple(k * c for k, c in enumerate(coefficients) if k)


def _polynomial(
    s: np.ndarray, coefficients: tuple[np.ndarray, ...], place: np.ndarray
) -> np.ndarray:
    """Horner's rule with the coefficients of step place[k] at s[k]."""
    value = coefficients[-1][:, place]
    for coefficient in coefficients[-2::-1]:
        value = coefficient[:, place] + s * value
    return value
