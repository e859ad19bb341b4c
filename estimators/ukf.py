"""The unscented Kalman filter of a discrete model."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from dtcasadi import checks
from dtcasadi.batch import batch
from dtcasadi.bound import Bound
from dtcasadi.compile import twin
from dtcasadi.waist import Discrete

from .augmented import layout_of, noise_of, pushed_by, start_of
from .base import Estimate, ProcessNoise, chance, names_of, refusal
from .clouds import reading_cloud, step_cloud
from .sigma import root_of, spread_out
from .steps import limits_of, raised_by

Many = Callable[..., Any]


class UKF:
    r"""Unscented Kalman filter in square-root form for x and for any blocks of theta.

    Takes the motion and the sensors as they are, through 2 m + 1 points round the estimate that all
    go through the step at once (`dtcasadi.batch`), m the numbers that are not known exactly and the
    forces that process noise acts through. Covariances are sums of squares of roots, so they stay
    positive; Joseph's form in the coordinates of the root of P costs a tenth of a QR factorization
    of all points (`estimators.clouds`; Simon, Optimal State Estimation, section 14.3). Verbs and
    arguments are those of `EKF`; no derivatives are needed.

    Attributes:
        discrete: the model.
        start: the estimate at the beginning.
        names: one name for each estimated number, shape (n_z,).
    """

    def __init__(
        self,
        discrete: Discrete,
        *,
        x0: Sequence[float] | np.ndarray,
        P0: Sequence[float] | np.ndarray,
        Q_w: ProcessNoise | Sequence[float] | np.ndarray,
        augment: Sequence[str] = (),
        gate: float | None = None,
        distance: float = 3**0.5,
        caution: int = 0,
        theta: np.ndarray | None = None,
        many: Callable[..., Many] = batch,
    ):
        """Check, and build what carries the points.

        Args:
            discrete: the model with its sensors.
            x0: states at the beginning, shape (n_x,).
            P0: their covariance, or its diagonal, as in `EKF`.
            Q_w: process noise, as in `EKF`; forces go through the step as points of their own.
            augment: blocks of theta to estimate besides x.
            gate: chance that a good measurement is refused as an outlier; None: all are believed.
            distance: of the points from the estimate, in standard deviations; the root of 3 gets
                the fourth moment of a Gaussian right.
            caution: how often the noise of a measurement is raised by the square of what the line
                through the points leaves out at the new estimate, and the update done again, as in
                `EKF`; where that is below a tenth of the noise nothing is done again. Points on the
                columns of one root do not see all that a wide start bends.
            theta: parameters, shape (n_theta,); default: the model's own.
            many: makes a Function of one point, with a second one in C kernels as `native`, one of
                many.

        Raises:
            EstimationError: an argument cannot be used; the text says what was expected.
        """
        self.discrete = discrete
        self._layout = layout = layout_of(discrete, augment)
        self.names = layout.names
        self.start = start_of(discrete, layout, x0, P0, theta)
        self._gate = chance(gate)
        distance = checks.number("distance", distance, positive=True, error=refusal)
        self._distance = np.array([distance])
        self._caution = checks.index("caution", caution, 0, 20, error=refusal)
        Q, noise = noise_of(discrete, layout, augment, Q_w)
        self._Q = Q
        self._push, pushed = pushed_by(discrete, noise)
        self._pushed = np.array(pushed, dtype=int)
        self._many, self._free = many, np.array(layout.free, dtype=int)
        self._step = many(discrete.step, native=discrete.native("step"))
        self._clouds: dict[int, Bound] = {}
        self._readings: dict[tuple[str, ...], _Reading] = {}

    def predict(self, est: Estimate, u: Sequence[float] | np.ndarray) -> Estimate:
        """The estimate a step later, under the command u; re-centred where a coordinate asks.

        A step that fails for any of the points leaves x, P and theta, and says so in `failure`.

        Raises:
            ModelError: an array of a wrong shape.
        """
        n, root, push = self._layout.n_x, root_of(est.P), self._push
        centre = self._packed(est)
        if len(push):
            whole = np.zeros((len(root) + len(push), root.shape[1] + len(push)))
            whole[: len(root), : root.shape[1]] = root
            whole[len(root) :, root.shape[1] :] = np.diag(push)
            root, centre = whole, np.concatenate([centre, np.zeros(len(push))])
        points = spread_out(centre, root, self._distance)
        theta = self._thetas(est, points)
        if len(push):
            theta[self._pushed] += points[self._layout.n_z :]
        images, status = self._step(points[:n], np.asarray(u, dtype=float), theta)
        if self._layout.n_z > n:
            images = np.vstack([images, points[n : self._layout.n_z]])
        mean, P = self._cloud(root)(images.T, self._distance, self._Q)
        if status.any() or not math.isfinite(P.sum()):
            return est.failing("predict: the step did not converge to finite states")
        x, theta, T = self.discrete.recentre(mean[:n], est.theta)
        moved = theta is not est.theta and not np.array_equal(theta, est.theta)
        if moved:
            P[:n] = T @ P[:n]
            P[:, :n] = P[:, :n] @ T.T
            P = (P + P.T) / 2
        return est.replaced(x=x, P=P, theta=theta, failure="", recentred=est.recentred + int(moved))

    def update(
        self,
        est: Estimate,
        y: Sequence[float] | np.ndarray,
        sensor: str | Sequence[str],
        u: Sequence[float] | np.ndarray,
    ) -> Estimate:
        """The estimate with a measurement taken in, as in `EKF.update`.

        Raises:
            ModelError: an unknown sensor.
            EstimationError: readings of a wrong shape.
        """
        names = names_of(sensor)
        reading = self._sensor(names)
        R = reading.R
        y = np.asarray(y, dtype=float)
        if y.shape != (len(R),):
            raise refusal("y", f"shape ({len(R)},)", y.shape)
        kept = np.isfinite(y)
        used = np.count_nonzero(kept)
        skipped = est.skipped + len(y) - used
        if not used:
            return est.replaced(skipped=skipped, nis=0.0, used=0, believed=True, failure="")
        root, z = root_of(est.P), self._packed(est)
        points = spread_out(z, root, self._distance)
        u = np.asarray(u, dtype=float)
        seen = reading.many(points[: len(est.x)], u, self._thetas(est, points))
        if used < len(y):  # as if read without noise of its own, by one that tells nothing
            seen[~kept], y = 0.0, np.where(kept, y, 0.0)
            R = np.where(np.outer(kept, kept), R, np.eye(len(y)))
        m = root.shape[1]
        if m not in reading.clouds:
            reading.clouds[m] = reading_cloud(len(root), m, len(y))
        cloud, given = reading.clouds[m], (seen.T, self._distance, root, y)
        change, P, (nis,), fit = cloud(*given, R)
        raised, caution = 0.0 * y, self._caution if nis <= reading.limits[used] else 0
        for _ in range(caution):
            left_out = np.where(kept, self._read(reading, est, z + change, u) - fit, 0.0)
            more = raised_by(left_out, R.diagonal(), raised)
            if more is None:
                break
            raised = more
            change, P, _, fit = cloud(*given, R + np.diag(raised))
        if not math.isfinite(P.sum() + nis):
            failure = f"update with {'+'.join(names)}: the result is not finite"
            return est.failing(failure, skipped=skipped, used=used)
        counts = {"nis": float(nis), "used": used, "skipped": skipped, "failure": ""}
        if not nis <= reading.limits[used]:
            return est.replaced(gated=est.gated + 1, believed=False, **counts)
        z, theta = z + change, est.theta
        if len(self._free):
            theta = est.theta.copy()
            theta[self._free] = z[len(est.x) :]
        return est.replaced(x=z[: len(est.x)], P=P, theta=theta, believed=True, **counts)

    def _read(self, reading: _Reading, est: Estimate, z: np.ndarray, u: np.ndarray) -> np.ndarray:
        """What would be read at z, shape (n_y,)."""
        theta, n = est.theta, len(est.x)
        if len(self._free):
            theta = theta.copy()
            theta[self._free] = z[n:]
        # Of one point, without the price of a call for many.
        return np.asarray(reading.once(z[:n], u, theta))

    def _packed(self, est: Estimate) -> np.ndarray:
        return np.concatenate([est.x, est.theta[self._free]]) if len(self._free) else est.x

    def _thetas(self, est: Estimate, points: np.ndarray) -> np.ndarray:
        """Theta of every point, or of all where it is the same."""
        if not len(self._free) and not len(self._pushed):
            return est.theta
        theta = np.repeat(est.theta[:, np.newaxis], points.shape[1], axis=1)
        n = self._layout.n_x
        theta[self._free] = points[n : n + len(self._free)]
        return theta

    def _cloud(self, root: np.ndarray) -> Bound:
        """What gathers the images of points along a root with as many columns."""
        m = root.shape[1]
        if m not in self._clouds:
            self._clouds[m] = step_cloud(self._layout.n_z, m)
        return self._clouds[m]

    def _sensor(self, names: tuple[str, ...]) -> _Reading:
        if names not in self._readings:
            sensor = self.discrete.together(names)
            R, limits = np.array(sensor.R_v), limits_of(self._gate, sensor.n_y)
            once = Bound(twin(sensor.output) if self._caution else sensor.output)
            self._readings[names] = _Reading(self._many(sensor.output), once, R, limits, {})
        return self._readings[names]


class _Reading(NamedTuple):
    """Readings of many points, of one; noise, largest nis by number, update by columns of root."""

    many: Many
    once: Bound
    R: np.ndarray
    limits: np.ndarray
    clouds: dict[int, Bound]


def serial(function: ca.Function, *, native: ca.Function | None = None) -> Many:
    """One point after the other in CasADi's virtual machine, as `batch` gives them at once."""

    def each(*arrays: np.ndarray) -> Any:
        n = max(np.shape(array)[1] for array in arrays if np.ndim(array) == 2)
        columns = [[a if np.ndim(a) == 1 else a[:, k] for a in arrays] for k in range(n)]
        results = [function.call([ca.DM(a) for a in column]) for column in columns]
        parts = [np.hstack([r[i].full() for r in results]) for i in range(function.n_out())]
        return parts[0] if len(parts) == 1 else tuple(parts)

    return each
