"""What sensors can tell of a motion: empirical observability Gramians."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dtcasadi import checks
from dtcasadi.batch import batch
from dtcasadi.errors import EstimationError
from dtcasadi.waist import Discrete

from .augmented import layout_of, widened
from .base import refusal
from .sigma import spread_out


@dataclass(frozen=True, eq=False)
class Motion:
    """What the robot does, step by step.

    Attributes:
        x: states, shape (n, n_x).
        theta: parameters, shape (n, n_theta).
        u: commands, shape (n, n_u).
    """

    x: np.ndarray
    theta: np.ndarray
    u: np.ndarray


@dataclass(frozen=True, eq=False)
class Gramians:
    """Information of each sensor in windows of a motion, in units of what is known before.

    Attributes:
        names: of the numbers that are not known exactly, shape (n_z,).
        sigma: their deviations before, shape (n_z,).
        parts: sensor -> its Gramians, shape (windows, n_z, n_z). Those of sensors read together are
            the sum.
        owner: sensor whose bias each number is, or ''.
        starts: step at which each window begins, shape (windows,).
        steps: length of a window.
    """

    names: tuple[str, ...]
    sigma: np.ndarray
    parts: dict[str, np.ndarray]
    owner: tuple[str, ...]
    starts: tuple[int, ...]
    steps: int


def gramians(
    discrete: Discrete,
    motion: Motion,
    *,
    P0: Sequence[float] | np.ndarray,
    augment: Sequence[str] = (),
    windows: int = 4,
    distance: float = 0.1,
    many: Callable[..., Any] = batch,
) -> Gramians:
    r"""Empirical Gramians along a motion, from runs that start a little to both sides of it.

    .. math::
        W_{ij} = \sum_k \frac{(y_k^{+i} - y_k^{-i})^T R_v^{-1} (y_k^{+j} - y_k^{-j})}{4 d^2}

    over the samples k of a window, y^{+i} the readings of a run that starts d deviations of number
    i off (Lall, Marsden, Glavaski, International Journal of Robust and Nonlinear Control 12, 2002;
    Krener and Ide, CDC 2009). No derivatives are taken: saturations and friction count as they
    are. 1 / W of a single number is the variance that the readings alone leave of it, over the one
    before.

    Args:
        discrete: the model with its sensors.
        motion: what the robot does; centres of coordinates are those at a window's start.
        P0: variances before, of x or of x and the numbers in `augment`; those of 0 are known.
        augment: blocks of theta that are to be found besides x.
        windows: pieces of equal length that the motion is cut into.
        distance: d.
        many: as in `UKF`.

    Raises:
        EstimationError: an argument cannot be used, or a run beside the motion is not finite.
    """
    layout = layout_of(discrete, augment)
    P = widened("P0", P0, layout)
    deviation = np.sqrt(np.diag(P))
    if np.any(P != np.diag(np.diag(P))) or not np.any(deviation):
        raise refusal("P0", "variances that are not all zero", "something else")
    windows = checks.index("windows", windows, 1, len(motion.x) - 1, error=refusal)
    unsure = deviation > 0
    step = many(discrete.step, native=discrete.native("step"))
    view = _View(discrete, many)
    steps = (len(motion.x) - 1) // windows
    starts = tuple(range(0, steps * windows, steps))
    root = distance * np.diag(deviation)[:, unsure]
    found = [_window(motion, layout, (start, steps), root, step, view) for start in starts]
    parts = {
        name: np.array([each[name] for each in found]) / distance**2 for name in discrete.sensors
    }
    names = tuple(np.array(layout.names)[unsure].tolist())
    owner = tuple(next((s for s in parts if n.startswith(f"{s}.bias[")), "") for n in names)
    return Gramians(names, deviation[unsure], parts, owner, starts, steps)


class _View:
    """All sensors at once, and who is due when."""

    def __init__(self, discrete: Discrete, many: Callable[..., Any]):
        sensors = discrete.sensors
        if not sensors:
            raise refusal("discrete", "a model with sensors", "one without")
        self.read = many(discrete.together(tuple(sensors)).output)
        rows = np.cumsum([0, *(sensor.n_y for sensor in sensors.values())])
        self.rows = dict(zip(sensors, map(slice, rows[:-1], rows[1:]), strict=True))
        self._every = {
            name: max(1, round((sensor.period_s or 0) / discrete.step_s))
            for name, sensor in sensors.items()
        }
        self._white = {n: np.linalg.inv(np.linalg.cholesky(s.R_v)) for n, s in sensors.items()}

    def due(self, k: int) -> list[str]:
        """Sensors that take a sample at a step."""
        return [name for name, every in self._every.items() if k % every == 0]

    def information(self, name: str, slopes: np.ndarray) -> np.ndarray:
        """What a sample says, from the readings' changes, shape (n_y, m)."""
        whitened = self._white[name] @ slopes[self.rows[name]]
        return whitened.T @ whitened


def _window(
    motion: Motion, layout: Any, span: tuple[int, int], root: np.ndarray, step: Any, view: _View
) -> dict[str, np.ndarray]:
    """Sums of d^2 W of each sensor in one window."""
    start, steps = span
    n, m = layout.n_x, root.shape[1]
    free = np.array(layout.free, dtype=int)
    x = spread_out(motion.x[start], root[:n], 1.0)
    moves = spread_out(np.zeros(len(free)), root[n:], 1.0)
    sums = {name: np.zeros((m, m)) for name in view.rows}
    # Only numbers that stay where they are along the motion may change the run's centres.
    changing = motion.theta - motion.theta[start]
    changing[:, [k for k in range(changing.shape[1]) if k not in free]] = 0.0
    for k in range(start, start + steps):
        theta = np.repeat((motion.theta[start] + changing[k])[:, np.newaxis], 2 * m + 1, axis=1)
        theta[free] += moves
        due = view.due(k)
        if due:
            y = view.read(x, motion.u[k], theta)
            slopes = (y[:, 1 : m + 1] - y[:, m + 1 :]) / 2
            for name in due:
                sums[name] += view.information(name, slopes)
        x, status = step(x, motion.u[k], theta)
        if np.any(status) or not np.all(np.isfinite(x)):
            raise EstimationError(
                f"observability: a run beside the motion is not finite in step {k}; try a smaller "
                "distance or more windows"
            )
    return sums
