"""What a simulation returns."""

import errno
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .files import written
from .model import Model


@dataclass(frozen=True, eq=False)
class Run:
    """A finished simulation.

    Attributes:
        model: the model that was integrated.
        t: times of the steps, shape (n,) [s].
        x: states, shape (n_x, n).
        u: commands, shape (n_u, n).
        thetas: parameters in force from each time on, shape (n_theta, n); re-centring changes A, B.
        success: whether the end was reached; the states are finite either way.
        message: one sentence: how it went, or what failed, when, and what to try.
        method: the integration method.
        choice: which methods `auto` took, from when, and why; empty with another method.
        energy: t, kinetic, potential, supplied, dissipated and residual at no more than 200
            samples [s, J]; `residual` closes the balance.
        condition: condition number of M at `energy["t"]`.
        recentrings: (time [s], segments from 1) of each re-centring.
        steps: accepted steps.
        rejected: steps tried again with a smaller size.
        evaluations: calls of the state equation.
        wall_time: time spent integrating [s].
    """

    model: Model
    t: np.ndarray
    x: np.ndarray
    u: np.ndarray
    thetas: np.ndarray
    success: bool
    message: str
    method: str
    choice: str
    energy: dict[str, np.ndarray]
    condition: np.ndarray
    recentrings: tuple[tuple[float, tuple[int, ...]], ...]
    steps: int
    rejected: int
    evaluations: int
    wall_time: float

    @property
    def y(self) -> np.ndarray:
        """The states, by SciPy's name."""
        return self.x

    @property
    def theta(self) -> np.ndarray:
        """Parameters at the start, shape (n_theta,)."""
        return self.thetas[:, 0]

    @property
    def step_sizes(self) -> np.ndarray:
        """Sizes of the accepted steps, shape (n - 1,) [s]."""
        return np.diff(self.t)

    @property
    def q(self) -> np.ndarray:
        """Generalized coordinates, shape (n_q, n) [rad]."""
        return self.x[: self.model.n_q]

    @property
    def qd(self) -> np.ndarray:
        """Coordinate rates, shape (n_q, n) [rad/s]."""
        return self.x[self.model.n_q : 2 * self.model.n_q]

    @property
    def pressure(self) -> np.ndarray:
        """Chamber pressures, shape (n_u, n) [Pa]."""
        return self.model.pressure_of(self.x, self.u)

    def poses(self, at: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Disc frames in the root frame at some steps (indices; default: all).

        Returns:
            R, shape (m, n_discs, 3, 3), and origins r, shape (m, n_discs, 3) [m].
        """
        columns = range(len(self.t)) if at is None else at
        n = self.model.n_discs
        R, r = [], []
        for k in columns:
            rotation, origin = self.model.poses(self.q[:, k], self.thetas[:, k])
            R.append(np.array(rotation).reshape(3, n, 3).transpose(1, 0, 2))
            r.append(np.array(origin).T)
        return np.array(R).reshape(-1, n, 3, 3), np.array(r).reshape(-1, n, 3)

    def save(self, path: str | Path) -> Path:
        """Write the arrays of the run to a NumPy .npz file, whole or not at all.

        `np.load` reads them back: the fields of this class, `energy_*` for the balance, and
        `recentrings` with `recentred_segments`, one row per re-centring padded with zeros.

        Raises:
            OSError: the file cannot be written; an older one is left as it was.
        """
        target = Path(path)
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
        target = target if target.suffix == ".npz" else target.with_name(target.name + ".npz")
        arrays = {f"energy_{name}": values for name, values in self.energy.items()}
        arrays |= {name: np.array(getattr(self, name)) for name in _SAVED}
        arrays["recentrings"] = np.array([time for time, _ in self.recentrings])
        width = max((len(segments) for _, segments in self.recentrings), default=0)
        rows = [segments + (0,) * (width - len(segments)) for _, segments in self.recentrings]
        arrays["recentred_segments"] = np.array(rows, dtype=int)
        names = {"state_names": np.array(self.model.state_names)}
        with written(target) as file:
            np.savez_compressed(file, **arrays, **names)  # type: ignore[arg-type]
        return target


_SAVED = (
    *("t", "x", "u", "q", "qd", "pressure", "thetas", "success", "message", "method", "choice"),
    *("condition", "steps", "rejected", "evaluations", "wall_time"),
)
