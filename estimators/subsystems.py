"""The linear subsystems of a scheduled observer, and their gains."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from dtcasadi.bound import Bound
from dtcasadi.errors import EstimationError
from dtcasadi.measuring import Sensor
from dtcasadi.waist import Discrete

from .augmented import Layout

# Largest eigenvalue of the errors; what nothing measures stays at 1, to round-off.
_SLOWEST = 1 - 1e-9
# Share of a parameter that is forgotten in a step where its random walk has no steady filter.
_FORGOTTEN = 1e-3


@dataclass(frozen=True, eq=False)
class Reading:
    """A sensor at one operating point.

    Attributes:
        K: gain, shape (n_z, n_y).
        S_inverse: of the innovation's covariance, shape (n_y, n_y).
        P: covariance after it, shape (n_z, n_z).
    """

    K: np.ndarray
    S_inverse: np.ndarray
    P: np.ndarray


@dataclass(frozen=True, eq=False)
class Subsystem:
    """x' = A (z; u) + c about one operating point, its sensors, and the covariance P before them.

    A has shape (n_x, n_z + n_u), c (n_x,), P (n_z, n_z).
    """

    A: np.ndarray
    c: np.ndarray
    P: np.ndarray
    readings: dict[str, Reading]


class Linearizer:
    """Linearizes a discrete model and its sensors at operating points."""

    def __init__(
        self,
        discrete: Discrete,
        layout: Layout,
        theta: np.ndarray,
        Q: np.ndarray,
        pushed: tuple[np.ndarray, tuple[int, ...]],
    ):
        """Prepare.

        Args:
            discrete: the model.
            layout: what is estimated.
            theta: parameters at the operating points, shape (n_theta,).
            Q: constant process noise of a step, shape (n_z, n_z).
            pushed: further noise: deviations and the entries of theta it acts through.
        """
        self._discrete, self._layout, self._theta = discrete, layout, theta
        self._Q, self._pushed = Q, pushed
        self._step = Bound(discrete.linearize, matrices={"F_x", "F_u", "F_theta"})
        matrices = {"H_x", "H_theta"}
        self._readings = {
            n: Bound(s.linearize, matrices=matrices) for n, s in discrete.sensors.items()
        }

    def at(self, x: np.ndarray, felt: np.ndarray, command: np.ndarray) -> Subsystem:
        """The subsystem about a state of rest.

        Args:
            x: the state.
            felt: the command under which the model rests there.
            command: the command that a robot with hysteresis needs for it.

        Raises:
            EstimationError: the step fails there, or what is estimated cannot be.
        """
        layout, n_x = self._layout, self._layout.n_x
        free = list(layout.free)
        _, F_x, F_u, F_theta = self._step(x, felt, self._theta)
        A = np.hstack([F_x, F_theta[:, free], F_u])
        if not np.all(np.isfinite(A)):
            raise EstimationError(f"operating point at {command.tolist()}: the step is not finite")
        rest = np.concatenate([x, self._theta[free], command])
        measured = {}
        for name, reading in self._readings.items():
            _, H_x, H_theta = reading(x, felt, self._theta)
            measured[name] = np.hstack([H_x, H_theta[:, free]])
        F = np.vstack([A[:, : layout.n_z], np.eye(layout.n_z)[n_x:]])
        deviations, entries = self._pushed
        G = F_theta[:, list(entries)] * deviations
        Q = self._Q.copy()
        Q[:n_x, :n_x] += G @ G.T
        P, readings = self._gains(F, Q, measured, command)
        return Subsystem(A, x - A @ rest, P, readings)

    def _gains(
        self,
        F: np.ndarray,
        Q: np.ndarray,
        measured: dict[str, np.ndarray],
        command: np.ndarray,
    ) -> tuple[np.ndarray, dict[str, Reading]]:
        """Steady covariance before the sensors, and each sensor's gain, one after the other.

        A sensor with longer periods or drop-outs enters the Riccati equation with as much more
        noise, so that it tells as much per second; its gain is that of a single reading.
        """
        n_z, n_x = self._layout.n_z, self._layout.n_x
        # What does not wander is known, and what acts on nothing cannot be: neither has a place.
        acts = np.any(np.vstack([F[:n_x], *measured.values()])[:, n_x:], axis=0)
        kept = np.concatenate([np.full(n_x, True), (np.diag(Q)[n_x:] > 0) & acts])
        sensors = self._discrete.sensors
        noises = {name: self._average(sensors[name]) for name in measured}
        H = np.vstack([H_s[:, kept] for H_s in measured.values()])
        R = np.array(ca.diagcat(*(ca.DM(noise) for noise in noises.values())))
        P = np.zeros((n_z, n_z))
        F, Q = F[np.ix_(kept, kept)], Q[np.ix_(kept, kept)]
        try:
            P[np.ix_(kept, kept)] = steady(F, H, Q, R, command)
        except EstimationError:
            # Such as a force along a straight thread, which no sensor sees there: wanders less far.
            bounded = F - np.diag(np.where(np.arange(len(F)) < n_x, 0.0, _FORGOTTEN))
            P[np.ix_(kept, kept)] = steady(bounded, H, Q, R, command)
        before, readings = P, {}
        for name, H_s in measured.items():
            S = H_s @ P @ H_s.T + sensors[name].R_v
            K = np.linalg.solve(S, H_s @ P).T
            average = np.linalg.solve(H_s @ P @ H_s.T + noises[name], H_s @ P).T
            left = np.eye(n_z) - average @ H_s
            P = left @ P @ left.T + average @ noises[name] @ average.T
            readings[name] = Reading(K, np.linalg.inv(S), P)
        return before, readings

    def _average(self, sensor: Sensor) -> np.ndarray:
        """Noise of a sensor that, read at every step, would tell as much."""
        steps = max(1.0, (sensor.period_s or 0.0) / self._discrete.step_s)
        return sensor.R_v * steps / (1.0 - sensor.dropout)


def steady(
    F: np.ndarray, H: np.ndarray, Q: np.ndarray, R: np.ndarray, where: object = ""
) -> np.ndarray:
    """The stabilizing P = F P F^T - F P H^T (H P H^T + R)^-1 H P F^T + Q, before a measurement.

    Raises:
        EstimationError: there is none: something is neither measured nor dies away.
    """
    # In units of the noise, or the pencil's entries would differ by ten orders.
    scale = np.sqrt(np.where(np.diag(Q) > 0, np.diag(Q), np.median(np.diag(Q))))
    scale[scale == 0] = 1.0
    noise = np.sqrt(np.diag(R))
    F, H = F * scale / scale[:, np.newaxis], H * scale / noise[:, np.newaxis]
    Q, R = Q / np.outer(scale, scale), R / np.outer(noise, noise)
    try:
        P = solve_discrete_are(F.T, H.T, Q, R)
        K = np.linalg.solve(H @ P @ H.T + R, H @ P @ F.T).T
        slowest = float(np.max(np.abs(np.linalg.eigvals(F - K @ H))))
    except (LinAlgError, ValueError):
        slowest = 1.0
    if not slowest < _SLOWEST:
        expected = "expected sensors that see all that is estimated, got errors that stay"
        raise EstimationError(f"operating point at {np.asarray(where).tolist()}: {expected}")
    P = P * np.outer(scale, scale)
    return (P + P.T) / 2
