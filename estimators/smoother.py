"""The fixed-interval smoother: what a whole log says of every instant in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dtcasadi.bound import Bound
from dtcasadi.compile import twin
from dtcasadi.errors import EstimationError
from dtcasadi.logs import Log
from dtcasadi.waist import Discrete

from .base import Estimate
from .ekf import EKF
from .runner import Track, track


def smoothed(filter: EKF, log: Log, *, t_end: float | None = None) -> Track:
    """Filter a log, then go back over it: estimates from all of its samples, at every step.

    Samples count at their instants, however late they arrived.

    Args:
        filter: the extended Kalman filter whose model and noise these are.
        log: what was recorded.
        t_end: end of the interval [s]; default: the log's.

    Raises:
        LogError: channels are missing or have another unit.
        EstimationError: the log spans too many steps, or the filter lost its way.
    """
    order = np.argsort(log.t, kind="stable")
    channels = {name: values[order] for name, values in log.channels.items()}
    in_order = replace(log, t=log.t[order], channels=channels)
    return backwards(filter, track(filter, in_order, t_end=t_end))


def backwards(filter: EKF, found: Track) -> Track:
    r"""Rauch, Tung and Striebel's recursion over a filter's run.

    .. math::
        C = P_k F_k^T (P^-_{k+1})^{-1},\quad \hat z_k = z_k + C (\hat z_{k+1} - z^-_{k+1}),\quad
        \hat P_k = P_k + C (\hat P_{k+1} - P^-_{k+1}) C^T

    with the predictions z^-, P^- of the filter and F the step's derivative at its estimates (Simon,
    Optimal State Estimation, section 9.4.2). Where a prediction re-centred the coordinates, F
    leads into the new ones, so every estimate stays about the centre it has in the filter's run.

    Args:
        filter: the filter.
        found: its run, samples in the order of their instants.

    Raises:
        EstimationError: a result is not finite.
    """
    slope = _Slope(filter)
    later = found.estimates[-1]
    kept = [later]
    steps = zip(found.estimates[-2::-1], found.u[-2::-1], strict=True)
    for k, (est, u) in enumerate(steps, 2):
        predicted = filter.predict(est, u)
        F = np.eye(len(est.P)) if predicted.failure else slope(est, u)
        C = _gain(est.P @ F.T, predicted.P)
        dz = C @ (slope.packed(later) - slope.packed(predicted))
        P = est.P + C @ (later.P - predicted.P) @ C.T
        later = slope.moved(est, dz, (P + P.T) / 2)
        if not np.all(np.isfinite(later.x)):
            at = found.t[len(found.t) - k]
            raise EstimationError(f"smoother: the estimate at {at:.6g} s is not finite")
        kept.append(later)
    return replace(found, estimates=tuple(kept[::-1]))


def _gain(cross: np.ndarray, P: np.ndarray) -> np.ndarray:
    """Cross times the inverse of P; nothing is learnt along what is known exactly."""
    unsure = np.diag(P) > 0
    block = P[np.ix_(unsure, unsure)]
    gain = np.zeros(cross.shape)
    # Divided by the deviations first: P mixes angles, forces and pressures.
    sigma = np.sqrt(np.diag(block))
    scaled = block / np.outer(sigma, sigma)
    gain[:, unsure] = np.linalg.lstsq(scaled, (cross[:, unsure] / sigma).T, rcond=None)[0].T / sigma
    return gain


class _Slope:
    """Derivative of a step for z = (x; the estimated entries of theta), re-centring included."""

    def __init__(self, filter: EKF):
        discrete: Discrete = filter.discrete
        self._free, self._discrete = np.array(filter.free, dtype=int), discrete
        native = discrete.native("linearize")
        self._bound = Bound(twin(discrete.linearize, source=native), matrices={"F_x", "F_theta"})

    def packed(self, est: Estimate) -> np.ndarray:
        """What is estimated, shape (n_z,)."""
        return np.concatenate([est.x, est.theta[self._free]])

    def moved(self, est: Estimate, dz: np.ndarray, P: np.ndarray) -> Estimate:
        """The estimate moved by dz."""
        n, theta = len(est.x), est.theta.copy()
        theta[self._free] += dz[n:]
        return est.replaced(x=est.x + dz[:n], P=P, theta=theta)

    def __call__(self, est: Estimate, u: np.ndarray) -> np.ndarray:
        """F at an estimate, shape (n_z, n_z)."""
        x_next, F_x, _, F_theta = self._bound(est.x, u, est.theta)
        *_, T = self._discrete.recentre(x_next, est.theta)
        n = len(est.x)
        F = np.eye(len(est.P))
        F[:n, :n] = T @ F_x
        F[:n, n:] = T @ F_theta[:, self._free]
        return F
