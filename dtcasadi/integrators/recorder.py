"""Gathers the steps of a run made by this package's loop into a trajectory."""

from typing import Protocol

import numpy as np

from ..contact.start import rigid
from ..events import Passed
from ..model import Model
from .dense import Chord, Quintic
from .problem import Problem, Trajectory


class Sink(Protocol):
    """What a run gives its steps to, stretch by stretch.

    Attributes:
        size: numbers kept so far.
        recentrings: (time, segments from 1).
        events: guard functions that passed zero.
        ended: why the run is to end here, or empty.
        rejected: steps tried again.
        evaluations: calls of the state equation.
    """

    size: int
    recentrings: list[tuple[float, tuple[int, ...]]]
    events: list[Passed]
    ended: str
    rejected: int
    evaluations: int

    def add(self, t: np.ndarray, x: np.ndarray, theta: np.ndarray) -> None:
        """Accepted steps, x of shape (m, n_x), taken with theta."""

    def replace_last(self, x: np.ndarray, theta: np.ndarray, segments: tuple[int, ...]) -> None:
        """The last state in re-centred coordinates."""


class Recorder:
    """Times, states and parameters of a run in the making; a `Sink` that also counts its steps."""

    def __init__(self, problem: Problem):
        self._problem = problem
        self._t = [np.array([problem.pieces[0].t_start])]
        self._x = [problem.x0[np.newaxis]]
        self._ends: list[np.ndarray] = []
        self._thetas = [(1, problem.theta)]  # counts of samples
        self.size = self.steps = 0
        self.recentrings: list[tuple[float, tuple[int, ...]]] = []
        self.events: list[Passed] = []
        self.ended = ""
        self.rejected = 0
        self.evaluations = 0

    def add(self, t: np.ndarray, x: np.ndarray, theta: np.ndarray) -> None:
        """Accepted steps, x of shape (m, n_x), taken with theta."""
        self._t.append(t.copy())
        self._x.append(x.copy())
        self._ends.append(x.copy())
        self.size += 2 * x.size
        self.steps += len(t)
        self._thetas.append((len(t), theta))

    def latest(self, n: int) -> np.ndarray:
        """The last n times, fewer where there are not as many, shape (n,)."""
        parts, found = 1, len(self._t[-1])
        while found < n and parts < len(self._t):
            parts += 1
            found += len(self._t[-parts])
        return np.concatenate(self._t[-parts:])[-n:]

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
        between = (
            Chord(t, x, ends)
            if rigid(self._problem.model)
            else Quintic(self._problem, t, x, ends, thetas_all)
        )
        return Trajectory(
            t,
            x,
            ends,
            thetas_all,
            between,
            method,
            failure,
            note,
            self.evaluations,
            self.rejected,
            tuple(self.recentrings),
            tuple(self.events),
            self.ended,
        )


def segment_of(model: Model, coordinate: int) -> int:
    """Number of the segment (from 1) a coordinate belongs to."""
    ends = np.cumsum([chart.words.n_q for chart in model.charts])
    return int(np.searchsorted(ends, coordinate, side="right")) + 1
