"""Reference motions of a model: two methods of different families, and how long they agree."""

from dataclasses import dataclass

import numpy as np

from ..errors import BenchError
from ..integrators import METHODS, Trajectory
from ..model import Model
from ..scene import Scene
from .motions import ARM, pose_of, problem_of

# SciPy's explicit method of order 8, or where a chart's singularity stops it this package's of
# order 5, which re-centres; and a linearly implicit one of order 4.
FIRST, INSTEAD, SECOND = ("DOP853", 1e-13), ("tsit5", 1e-13), ("rodas4", 1e-12)
# A trajectory's error counts up to the time where the references differ by more, in lengths.
AGREEMENT = 1e-10
SAMPLES = 50


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of a model, known at any time.

    Attributes:
        model: the model.
        found: its states.
    """

    model: Model
    found: Trajectory

    def poses(self, times: np.ndarray) -> np.ndarray:
        """The last disc's pose at times (m,), shape (m, 4, 3) in lengths; see `pose_of`."""
        states, thetas = self.found.at(times)
        columns = zip(states[: self.model.n_q].T, thetas.T, strict=True)
        return np.array([pose_of(self.model, *column) for column in columns]).reshape(-1, 4, 3)

    def samples(self, until: float) -> np.ndarray:
        """At most `SAMPLES` times of its own steps up to a time, the last among them."""
        t = self.found.t[self.found.t <= until * (1 + 1e-12)]
        return t[np.unique(np.linspace(0, len(t) - 1, SAMPLES + 1).round().astype(int))]


@dataclass(frozen=True, eq=False)
class Reference:
    """What a model's motions are compared with.

    Attributes:
        motion: the first reference.
        times: where both were compared, shape (m,) [s].
        gaps: pose error between them there, in lengths, shape (m,).
        names: the two methods.
        t_end: horizon [s].
    """

    motion: Motion
    times: np.ndarray
    gaps: np.ndarray
    names: tuple[str, str]
    t_end: float

    @property
    def trusted(self) -> float:
        """Time up to which the references agree to `AGREEMENT` [s]."""
        apart = np.flatnonzero(~(self.gaps <= AGREEMENT))
        return float(self.times[-1] if not len(apart) else self.times[max(apart[0] - 1, 0)])

    def errors(self, motion: Motion) -> tuple[float, float]:
        """Largest pose error along a run up to `trusted`, at its own steps, and that at its end.

        In lengths; infinite where the run ended before.
        """
        if motion.found.t[-1] < self.trusted * (1 - 1e-9):
            return np.inf, np.inf
        times = motion.samples(self.trusted)
        gaps = distances(motion.poses(times), self.motion.poses(times))
        if times[-1] < self.trusted * (1 - 1e-9):
            last = np.array([self.trusted])
            gaps = np.r_[gaps, distances(motion.poses(last), self.motion.poses(last))]
        return float(np.max(gaps)), float(gaps[-1])


def distances(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Pose errors of two rows of poses, shape (m,)."""
    return np.max(np.linalg.norm(one - other, axis=-1), axis=-1)


def solved(scene: Scene, model: Model, method: str, rtol: float) -> Motion:
    """A run at a tolerance."""
    METHODS[method].prepare(model)
    problem = problem_of(scene, model, rtol=rtol, atol=1e-2 * rtol)
    return Motion(model, METHODS[method].integrate(problem))


def reference_of(scene: Scene, model: Model) -> Reference:
    """Both references and where they part.

    Raises:
        BenchError: one of them does not reach the horizon.
    """
    first, names = solved(scene, model, *FIRST), (FIRST[0], SECOND[0])
    if first.found.failure:
        first, names = solved(scene, model, *INSTEAD), (INSTEAD[0], SECOND[0])
    second = solved(scene, model, *SECOND)
    for name, motion in zip(names, (first, second), strict=True):
        if motion.found.failure:
            raise BenchError(f"{scene.name}: no reference: {name}: {motion.found.failure}")
    times = second.samples(scene.t_end)
    gaps = distances(second.poses(times), first.poses(times))
    return Reference(first, times, gaps, names, scene.t_end)


__all__ = ["AGREEMENT", "ARM", "Motion", "Reference", "distances", "reference_of", "solved"]
