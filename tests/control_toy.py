"""A cart on a spring, pushed by a command: a linear plant to try controllers on."""

import numpy as np
from linear_toy import LinearDiscrete
from scipy.linalg import expm


def cart(step_s: float = 0.1, spring: float = 2.0) -> LinearDiscrete:
    """Position and speed, a command and a constant load; sensors `place` and `both`."""
    A = np.array([[0.0, 1.0], [-spring, -0.3]])
    whole = np.zeros((4, 4))
    whole[:2] = np.hstack([A, [[0.0, 0.0], [1.0, 1.0]]])
    step = expm(whole * step_s)[:2]
    measured = {
        "place": (np.array([[1.0, 0.0]]), np.zeros((1, 1)), np.eye(1)),
        "both": (np.eye(2), np.zeros((2, 1)), np.eye(2)),
        "triple": (np.array([[1.0, 0], [0, 1], [1, 1]]), np.zeros((3, 1)), np.eye(3)),
    }
    blocks = {"load": slice(0, 1)}
    F, G, B = step[:, :2], step[:, 2:3], step[:, 3:]
    return LinearDiscrete(F, G, B, measured, np.zeros(1), blocks, step_s)
