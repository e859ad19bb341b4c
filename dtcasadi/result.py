"""What a simulation returns."""

import errno
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from .checks import shown
from .contact.record import Contacts, contacts_of
from .contact.report import Touched
from .errors import SimulationError
from .events import Passed
from .files import written
from .model import Model
from .recentring import unwound

Dense = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


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
        events: guard functions that passed zero, in the order of time.
        steps: accepted steps.
        step_sizes: their sizes, shape (steps,) [s].
        rejected: steps tried again with a smaller size.
        evaluations: calls of the state equation.
        wall_time: time spent integrating [s].
        dense: x, u and theta between the steps; `at` is made of it.
        touched: rigid contacts of each step; `contacts` is made of it.
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
    events: tuple[Passed, ...]
    steps: int
    step_sizes: np.ndarray
    rejected: int
    evaluations: int
    wall_time: float
    dense: Dense = field(repr=False)
    touched: Touched | None = None

    def __repr__(self) -> str:
        """How it went, on one line."""
        outcome = "success" if self.success else "failed"
        return f"Run({outcome}: {self.message})"

    @property
    def y(self) -> np.ndarray:
        """The states, by SciPy's name."""
        return self.x

    @property
    def theta(self) -> np.ndarray:
        """Parameters at the start, shape (n_theta,)."""
        return self.thetas[:, 0]

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
        """Gauge pressures in the chambers, shape (n_u, n) [Pa]."""
        return self.air["pressure"]

    @property
    def air(self) -> dict[str, np.ndarray]:
        """What happens in the chambers, shape (n_u, n) each.

        `pressure` and `effective_pressure` (what moves the robot) [Pa]; `supply_flow` (in),
        `exhaust_flow` and `leak_flow` (out) [kg/s].
        """
        function, n = self.model.air, len(self.t)
        values = function(self.x, self.u, self.thetas)
        return {
            name: np.array(value).reshape(self.model.n_u, n)
            for name, value in zip(function.name_out(), values, strict=True)
        }

    @property
    def multipliers(self) -> np.ndarray:
        """Multipliers of the constraints, eq (7), shape (m, n) [N]; rows as `constraint_terms`."""
        pressure = self.air["effective_pressure"]
        tau = np.zeros(self.q.shape)
        values = self.model.multipliers(self.q, self.qd, pressure, tau, self.thetas)
        return np.array(values).reshape(-1, len(self.t))

    @property
    def contacts(self) -> Contacts:
        """Which disc touched which obstacle where and how hard, at the run's times."""
        return contacts_of(self)

    def at(self, times: Sequence[float] | np.ndarray) -> "Run":
        """The same run seen at other times (dense output): t, x, u and thetas there.

        This package's methods: quintic Hermite in q between the steps, error O(h^6), and straight
        lines with rigid contact; SciPy's: their own interpolants. Each state is in the coordinates
        of the step it is in.

        Raises:
            SimulationError: times that do not increase, or outside the run.
        """
        try:
            moments = np.asarray(times, dtype=float)
        except (TypeError, ValueError):
            moments = np.array([np.nan])
        first, last = self.t[0], self.t[-1]
        inside = moments.ndim == 1 and np.all((moments >= first) & (moments <= last))
        if not inside or np.any(np.diff(moments) < 0):
            expected = f"increasing times from {first:g} to {last:g} s"
            raise SimulationError(f"times: expected {expected}, got {shown(times)}")
        x, u, thetas = self.dense(moments)
        return replace(self, t=moments, x=x, u=u, thetas=thetas)

    def coordinates(self, chart: str | Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates and rates in a chart of choice, whatever was re-centred on the way.

        Angles are joined from step to step by whole turns.

        Args:
            chart: a chart, or one per segment.

        Returns:
            q [rad] and qd [rad/s], shape (n, len(t)) each with the n of that chart.

        Raises:
            ChartError: an unknown chart, or a pose that it cannot represent.
        """
        return unwound(self.model, self.x, self.thetas, chart)

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
        `recentrings` with `recentred_segments`, one row per re-centring padded with zeros;
        `events` [s] with `event_names`; `contact_*` for the columns of `contacts` of a robot that
        something can touch.

        Raises:
            OSError: the file cannot be written; an older one is left as it was.
        """
        target = Path(path)
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
        target = target if target.suffix == ".npz" else target.with_name(target.name + ".npz")
        arrays = {f"energy_{name}": values for name, values in self.energy.items()}
        arrays |= {name: np.array(getattr(self, name)) for name in _SAVED}
        arrays["events"] = np.array([event.t for event in self.events])
        arrays["event_names"] = np.array([event.name for event in self.events], dtype=str)
        arrays["recentrings"] = np.array([time for time, _ in self.recentrings])
        if self.model.robot.touchable:
            arrays |= {f"contact_{name}": column for name, column in vars(self.contacts).items()}
        width = max((len(segments) for _, segments in self.recentrings), default=0)
        rows = [segments + (0,) * (width - len(segments)) for _, segments in self.recentrings]
        arrays["recentred_segments"] = np.array(rows, dtype=int)
        names = {"state_names": np.array(self.model.state_names)}
        with written(target) as file:
            np.savez_compressed(file, **arrays, **names)  # type: ignore[arg-type]
        return target


_SAVED = (
    *("t", "x", "u", "q", "qd", "pressure", "thetas", "success", "message", "method", "choice"),
    *("condition", "steps", "step_sizes", "rejected", "evaluations", "wall_time"),
)
