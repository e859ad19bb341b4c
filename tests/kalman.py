"""The textbook's Kalman filter, and the linear plant that filters are compared on."""

import numpy as np
from linear_toy import LinearDiscrete

N, N_U = 5, 2


def toy_plant() -> LinearDiscrete:
    """Five states, two commands, a known and an unknown block of theta, two sensors."""
    rng = np.random.default_rng(0)
    F = np.eye(N) + 0.2 * rng.normal(size=(N, N))
    F /= 1.05 * np.max(np.abs(np.linalg.eigvals(F)))
    root = rng.normal(size=(3, 3))
    measured = {
        "pair": (rng.normal(size=(3, N)), rng.normal(size=(3, 4)), 0.1 * root @ root.T + np.eye(3)),
        "one": (rng.normal(size=(1, N)), np.zeros((1, 4)), np.array([[0.3]])),
    }
    blocks = {"wrench": slice(0, 2), "mass": slice(2, 4)}
    return LinearDiscrete(
        F, rng.normal(size=(N, N_U)), rng.normal(size=(N, 4)), measured, np.arange(4.0), blocks
    )


def covariance(rng: np.random.Generator, n: int) -> np.ndarray:
    root = rng.normal(size=(n, n))
    return root @ root.T + 0.1 * np.eye(n)


class Kalman:
    """The textbook's filter on (x, theta[2:4]) with the gain of a plain inverse."""

    def __init__(self, toy: LinearDiscrete, Q: np.ndarray):
        self.toy, self.Q = toy, Q
        self.F = np.block([[toy.F, toy.B[:, 2:]], [np.zeros((2, N)), np.eye(2)]])

    def predict(self, z: np.ndarray, P: np.ndarray, u: np.ndarray) -> tuple:
        push = self.toy.G @ u + self.toy.B[:, :2] @ self.toy.theta0[:2]
        return self.F @ z + np.concatenate([push, np.zeros(2)]), self.F @ P @ self.F.T + self.Q

    def update(self, z: np.ndarray, P: np.ndarray, y: np.ndarray, names: list) -> tuple:
        parts = [self.toy.measured[name] for name in names]
        H = np.vstack([np.hstack([H_x, H_theta[:, 2:]]) for H_x, H_theta, _ in parts])
        known = np.vstack([H_theta[:, :2] for _, H_theta, _ in parts]) @ self.toy.theta0[:2]
        R = np.zeros((len(H), len(H)))
        row = 0
        for _, _, block in parts:
            R[row : row + len(block), row : row + len(block)] = block
            row += len(block)
        kept = np.isfinite(y)
        H, e, R = H[kept], (y - known)[kept] - H[kept] @ z, R[np.ix_(kept, kept)]
        inverse = np.linalg.inv(H @ P @ H.T + R)
        K = P @ H.T @ inverse
        return z + K @ e, (np.eye(len(z)) - K @ H) @ P, float(e @ inverse @ e)
