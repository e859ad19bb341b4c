"""The unscented Kalman filter of a discrete model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import chi2

from dtcasadi import checks
from dtcasadi.batch import batch
from dtcasadi.waist import Discrete

from .augmented import layout_of, noise_of, pushed_by, start_of
from .base import Estimate, ProcessNoise, chance, names_of, refusal
from .sigma import gathered, root_of, spread_out, triangle

Many = Callable[..., Any]


class UKF:
    r"""Unscented Kalman filter in square-root form for x and for any blocks of theta.

    Takes the motion and the sensors as they are, through 2 m + 1 points round the estimate that all
    go through the step at once (`dtcasadi.batch`), m the numbers that are not known exactly and the
    forces that process noise acts through. Covariances are products of roots from QR
    factorizations, so they stay positive (`estimators.sigma`; Simon, Optimal State Estimation,
    section 14.3; van der Merwe and Wan, ICASSP 2001). Verbs and arguments are those of `EKF`; no
    derivatives are needed.

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
        self._distance = checks.number("distance", distance, positive=True, error=refusal)
        Q, noise = noise_of(discrete, layout, augment, Q_w)
        self._noise_root = root_of(Q).T
        self._push, pushed = pushed_by(discrete, noise)
        self._pushed = np.array(pushed, dtype=int)
        self._many, self._free = many, np.array(layout.free, dtype=int)
        self._step = many(discrete.step, native=discrete.native("step"))
        self._outputs: dict[tuple[str, ...], tuple[Many, np.ndarray]] = {}

    def predict(self, est: Estimate, u: Sequence[float] | np.ndarray) -> Estimate:
        """The estimate a step later, under the command u; re-centred where a coordinate asks.

        A step that fails for any of the points leaves x, P and theta, and says so in `failure`.

        Raises:
            ModelError: an array of a wrong shape.
        """
        n, root = self._layout.n_x, root_of(est.P)
        whole = np.zeros((len(root) + len(self._push), root.shape[1] + len(self._push)))
        whole[: len(root), : root.shape[1]] = root
        whole[len(root) :, root.shape[1] :] = np.diag(self._push)
        centre = np.concatenate([self._packed(est), np.zeros(len(self._push))])
        points = spread_out(centre, whole, self._distance)
        theta = self._thetas(est, points)
        if len(self._push):
            theta[self._pushed] += points[len(root) :]
        x_next, status = self._step(points[:n], np.asarray(u, dtype=float), theta)
        if np.any(status) or not np.all(np.isfinite(x_next)):
            return est.failing("predict: the step did not converge to finite states")
        cloud = gathered(np.vstack([x_next, points[n : len(root)]]), self._distance)
        U = triangle(np.vstack([cloud.root, self._noise_root]))
        x, theta, T = self.discrete.recentre(cloud.mean[:n], est.theta)
        moved = theta is not est.theta and not np.array_equal(theta, est.theta)
        if moved:
            U[:, :n] = U[:, :n] @ T.T
        return est.replaced(
            x=x, P=U.T @ U, theta=theta, failure="", recentred=est.recentred + int(moved)
        )

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
        output, R_root = self._sensor(names)
        y = np.asarray(y, dtype=float)
        if y.shape != (len(R_root),):
            raise refusal("y", f"shape ({len(R_root)},)", y.shape)
        kept = np.isfinite(y)
        used, skipped = int(kept.sum()), est.skipped + int((~kept).sum())
        if not used:
            return est.replaced(skipped=skipped, nis=0.0, used=0, believed=True, failure="")
        root = root_of(est.P)
        points = spread_out(self._packed(est), root, self._distance)
        seen = output(points[: len(est.x)], np.asarray(u, dtype=float), self._thetas(est, points))
        cloud = gathered(seen[kept], self._distance)
        if not np.all(np.isfinite(cloud.root)):
            failure = f"update with {'+'.join(names)}: the result is not finite"
            return est.failing(failure, skipped=skipped, used=used)
        # Rows: of the readings beside of z, whose own deviations are the columns of the root.
        m = root.shape[1]
        rest = np.zeros((len(cloud.root) - m + len(R_root), len(root)))
        rows = np.hstack([np.vstack([cloud.root, R_root.T[:, kept]]), np.vstack([root.T, rest])])
        U = triangle(rows)
        U_y, U_yz, U_z = U[:used, :used], U[:used, used:], U[used:, used:]
        e = solve_triangular(U_y, y[kept] - cloud.mean, trans="T")
        counts = {"nis": float(e @ e), "used": used, "skipped": skipped, "failure": ""}
        if self._gate is not None and counts["nis"] > chi2.isf(self._gate, used):
            return est.replaced(gated=est.gated + 1, believed=False, **counts)
        z = self._packed(est) + U_yz.T @ e
        theta = est.theta.copy()
        theta[self._free] = z[len(est.x) :]
        return est.replaced(x=z[: len(est.x)], P=U_z.T @ U_z, theta=theta, believed=True, **counts)

    def _packed(self, est: Estimate) -> np.ndarray:
        return np.concatenate([est.x, est.theta[self._free]])

    def _thetas(self, est: Estimate, points: np.ndarray) -> np.ndarray:
        """Theta of every point."""
        theta = np.repeat(est.theta[:, np.newaxis], points.shape[1], axis=1)
        n = self._layout.n_x
        theta[self._free] = points[n : n + len(self._free)]
        return theta

    def _sensor(self, names: tuple[str, ...]) -> tuple[Many, np.ndarray]:
        """The readings of many points, and the root of their noise."""
        if names not in self._outputs:
            sensor = self.discrete.together(names)
            self._outputs[names] = (self._many(sensor.output), np.linalg.cholesky(sensor.R_v))
        return self._outputs[names]


def serial(function: ca.Function, *, native: ca.Function | None = None) -> Many:
    """One point after the other in CasADi's virtual machine, as `batch` gives them at once."""

    def each(*arrays: np.ndarray) -> Any:
        n = max(np.shape(array)[1] for array in arrays if np.ndim(array) == 2)
        columns = [[a if np.ndim(a) == 1 else a[:, k] for a in arrays] for k in range(n)]
        results = [function.call([ca.DM(a) for a in column]) for column in columns]
        parts = [np.hstack([r[i].full() for r in results]) for i in range(function.n_out())]
        return parts[0] if len(parts) == 1 else tuple(parts)

    return each
