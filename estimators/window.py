r"""A window of past steps: what is kept of it, and the least-squares problem over it.

About reference points z_k, with changes d_k, the problem of a moving horizon is

.. math::
    \min\ |d_0 - m_0|^2_{P_0^{-1}} + \sum_k |w_k|^2_{Q_k^{-1}} + |e_k - H_k d_k|^2_{R_k^{-1}},\quad
    d_{k+1} = F_k d_k + c_k + w_k

The Kalman filter goes through it forwards, the costates back (Bryson and Frazier 1963; Bierman,
Factorization Methods, section X): d_k = m_k + P_k mu_k, with m_k and P_k before the readings of
step k. Nothing but the innovations' covariances is inverted, so that P and Q may be singular. One
pass is a Gauss-Newton step on the whole window (Bell 1994, the iterated Kalman smoother).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np


@dataclass(frozen=True, eq=False)
class Window:
    """The last k + 1 steps.

    Attributes:
        z: estimates of (x; the estimated entries of theta), shape (k + 1, n_z).
        predicted: the same before the readings of their step and of later ones.
        mean: of the first, from all that is older, shape (n_z,).
        P: its covariance.
        u: commands of the steps between, shape (k, n_u).
        u_read: commands at the readings, shape (k + 1, n_u).
        y: readings of all sensors, NaN where there are none, shape (k + 1, n_y).
        count: how many readings each is the average of, shape (k + 1, n_y).
    """

    z: np.ndarray
    predicted: np.ndarray
    mean: np.ndarray
    P: np.ndarray
    u: np.ndarray
    u_read: np.ndarray
    y: np.ndarray
    count: np.ndarray

    @classmethod
    def empty(cls) -> Window:
        """No window at all."""
        return cls.starting(np.zeros(0), np.zeros((0, 0)), 0, 0)

    @classmethod
    def starting(cls, z: np.ndarray, P: np.ndarray, n_u: int, n_y: int) -> Window:
        """One step, without readings."""
        none, once, path = np.full((1, n_y), np.nan), np.ones((1, n_y)), z[np.newaxis]
        return cls(path, path, z, P, np.zeros((0, n_u)), np.zeros((1, n_u)), none, once)

    def __len__(self) -> int:
        """Number of steps in it."""
        return len(self.z)

    def longer(self, z: np.ndarray, u: np.ndarray) -> Window:
        """With one more step, without readings."""
        return replace(
            self,
            z=np.vstack([self.z, z]),
            predicted=np.vstack([self.predicted, z]),
            u=np.vstack([self.u, u]),
            u_read=np.vstack([self.u_read, u]),
            y=np.vstack([self.y, np.full(self.y.shape[1], np.nan)]),
            count=np.vstack([self.count, np.ones(self.y.shape[1])]),
        )

    def later(self, mean: np.ndarray, P: np.ndarray) -> Window:
        """Without its first step, of whose end mean and covariance are known."""
        steps = ("z", "predicted", "u", "u_read", "y", "count")
        kept = {name: getattr(self, name)[1:] for name in steps}
        return replace(self, mean=mean, P=P, **kept)

    def reading(self, y: np.ndarray, place: np.ndarray, u: np.ndarray) -> Window:
        """With readings at the last step; a second one of the same quantity is averaged."""
        new, seen = y[np.isfinite(y)], place[np.isfinite(y)]
        old, count = self.y[-1, seen], self.count[-1, seen]
        again = np.isfinite(old)
        values, counts, commands = self.y.copy(), self.count.copy(), self.u_read.copy()
        values[-1, seen] = np.where(again, (count * old + new) / (count + 1), new)
        counts[-1, seen] = count + again
        commands[-1] = u
        return replace(self, y=values, count=counts, u_read=commands)


class Passed(NamedTuple):
    """The filter's pass over a window: for each step what `stage.stage` gives, m and P before."""

    m: list[np.ndarray]
    P: list[np.ndarray]
    F: list[np.ndarray]
    H: list[np.ndarray]
    SH: list[np.ndarray]
    Se: list[np.ndarray]
    d: list[np.ndarray]
    P_d: list[np.ndarray]


class Solved(NamedTuple):
    """Changes d and costates mu of every step, shape (k + 1, n) or (k + 1, n, columns)."""

    d: np.ndarray
    mu: np.ndarray


def backwards(p: Passed, forces: Any = None) -> Solved:
    """The solution from the filter's pass.

    Args:
        p: the pass.
        forces: gradient of a linear reward added to the problem, shape (k + 1, n) or
            (k + 1, n, columns): then only the change of the solution by it, one for each column.
    """
    n = len(p.m)
    pushed = np.zeros((n, *p.m[0].shape)) if forces is None else forces
    means, innovations = (p.m, p.Se) if forces is None else _pushed_on(p, forces)
    d, mu = np.zeros(pushed.shape), np.zeros(pushed.shape)
    costate = np.zeros(pushed.shape[1:])
    for k in reversed(range(n)):
        ahead = costate + pushed[k]
        mu[k] = ahead + p.H[k].T @ (innovations[k] - p.SH[k] @ (p.P[k] @ ahead))
        d[k] = means[k] + p.P[k] @ mu[k]
        if k:
            costate = p.F[k - 1].T @ mu[k]
    return Solved(d, mu)


def _pushed_on(p: Passed, forces: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Changes of the filter's means by the forces before, and of S^-1 e."""
    mean, means, innovations = np.zeros(forces.shape[1:]), [], []
    for k in range(len(p.m)):
        means.append(mean)
        innovations.append(-p.SH[k] @ mean)
        ahead = mean + p.P[k] @ forces[k]
        mean = p.F[k] @ (ahead - p.P[k] @ (p.SH[k].T @ (p.H[k] @ ahead)))
    return means, innovations


def stationarity(p: Passed, free: Solved) -> float:
    """How far a solution without forces is from a path's stationary point, in standard deviations.

    By another way than it was found: d_k = d + P_d F^T mu_(k+1) with mean and covariance after the
    readings of step k, of the filter's own update.
    """
    worst = 0.0
    for k, (d, P_d) in enumerate(zip(p.d, p.P_d, strict=True)):
        later = P_d @ (p.F[k].T @ free.mu[k + 1]) if k + 1 < len(p.d) else 0.0
        sigma = np.sqrt(np.diag(p.P[k]))
        off = np.abs(d + later - free.d[k]) / np.where(sigma > 0, sigma, 1.0)
        worst = max(worst, float(np.max(off)))
    return worst
