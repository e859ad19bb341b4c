"""Gathers the steps of a run made by this package's loop into a trajectory."""

import numpy as np

from ..model import Model
from .problem import Problem, Trajectory


class Recorder:
    """Times, states and parameters of a run in the making."""

    def __init__(self, problem: Problem):
        self._problem = problem
        self._t = [np.array([problem.pieces[0].t_start])]
        self._x = [problem.x0[np.newaxis]]
        self._ends: list[np.ndarray] = []
        self._thetas = [(1, problem.theta)]  # counts of samples
        self.size = 0
        self.recentrings: list[tuple[float, tuple[int, ...]]] = []
        self.rejected = 0
        self.evaluations = 0

    def add(self, t: np.ndarray, x: np.ndarray, theta: np.ndarray) -> None:
        """Accepted steps, x of shape (m, n_x), taken with theta."""
        self._t.append(t.copy())
        self._x.append(x.copy())
        self._ends.append(x.copy())
        self.size += 2 * x.size
        self._thetas.append((len(t), theta))

    def replace_last(self, x: np.ndarray, theta: np.ndarray, segments: tuple[int, ...]) -> None:
        """The last state in re-centred coordinates."""
        self._x[-1][-1] = x
        count, old = self._thetas[-1]
        self._thetas[-1:] = [(count - 1, old), (1, theta)]
        self.recentrings.append((float(self._t[-1][-1]), segments))

    def finish(self, method: str, failure: str, note: str = "") -> Trajectory:
        """The trajectory so far."""
        t, x = np.concatenate(self._t), np.concatenate(self._x).T
        n_x = x.shape[0]
        ends = np.concatenate(self._ends).T if self._ends else np.zeros((n_x, 0))
        counts, thetas = zip(*self._thetas, strict=True)
        thetas_all = np.repeat(np.array(thetas).T, counts, axis=1)
        problem = self._problem
        return Trajectory(
            t,
            x,
            ends,
            thetas_all,
            lambda nodes: _quintic(problem, t, x, ends, thetas_all, nodes),
            method,
            failure,
            note,
            self.evaluations,
            self.rejected,
            tuple(self.recentrings),
        )


def _quintic(
    problem: Problem,
    t: np.ndarray,
    x: np.ndarray,
    ends: np.ndarray,
    thetas: np.ndarray,
    nodes: np.ndarray,
) -> np.ndarray:
    """States inside the steps: q by quintic Hermite from q, qd, qdd at both ends, qd its slope.

    Actuator states by cubic Hermite.
    """
    model = problem.model
    n, h = model.n_q, np.diff(t)
    starts = x[:, :-1]
    first = _rates(problem, t[:-1], starts, thetas[:, :-1], at_start=True)
    second = _rates(problem, t[1:], ends, thetas[:, :-1], at_start=False)
    s = ((nodes.reshape(-1, 3).T - t[:-1]) / h)[:, np.newaxis, :]
    q0, v0, a0 = starts[:n], h * starts[n : 2 * n], h**2 * first[n : 2 * n]
    q1, v1, a1 = ends[:n], h * ends[n : 2 * n], h**2 * second[n : 2 * n]
    c3 = 10 * (q1 - q0) - 6 * v0 - 4 * v1 - (3 * a0 - a1) / 2
    c4 = -15 * (q1 - q0) + 8 * v0 + 7 * v1 + (3 * a0 - 2 * a1) / 2
    c5 = 6 * (q1 - q0) - 3 * (v0 + v1) - (a0 - a1) / 2
    q = q0 + s * (v0 + s * (a0 / 2 + s * (c3 + s * (c4 + s * c5))))
    v = (v0 + s * (a0 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / h
    z0, z1 = starts[2 * n :], ends[2 * n :]
    d0, d1 = h * first[2 * n :], h * second[2 * n :]
    z = z0 + s * (d0 + s * (3 * (z1 - z0) - 2 * d0 - d1 + s * (2 * (z0 - z1) + d0 + d1)))
    return np.concatenate([q, v, z], axis=1).transpose(1, 2, 0).reshape(model.n_x, -1)


def _rates(
    problem: Problem, t: np.ndarray, x: np.ndarray, thetas: np.ndarray, *, at_start: bool
) -> np.ndarray:
    """State derivatives at one end of every step, shape (n_x, n - 1)."""
    ode = problem.model.compiled("ode")
    starts = np.array([piece.t_start for piece in problem.pieces])
    after = np.searchsorted(starts, t, side="right" if at_start else "left")
    owners = np.maximum(after - 1, 0)
    rates = np.empty_like(x)
    for k in range(x.shape[1]):
        ode.inputs.x[:], ode.inputs.theta[:] = x[:, k], thetas[:, k]
        ode.inputs.u[:] = problem.pieces[owners[k]](t[k])
        ode.run()
        rates[:, k] = ode.outputs.xdot
    return rates


def segment_of(model: Model, coordinate: int) -> int:
    """Number of the segment (from 1) a coordinate belongs to."""
    ends = np.cumsum([chart.words.n_q for chart in model.charts])
    return int(np.searchsorted(ends, coordinate, side="right")) + 1
