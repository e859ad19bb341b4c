"""The rim of a disc as points."""

import numpy as np

from .parts import Disc

_ANGLES = np.linspace(0.0, 2 * np.pi, 33)[:-1]


def outline_of(disc: Disc) -> np.ndarray:
    """The disc's rim, shape (n, 3) [m]; of a disc without one, the hoop that spins like it."""
    if len(disc.outline):
        return disc.outline
    return circle(disc.centre_of_mass, np.sqrt(disc.inertia[2, 2] / disc.mass))


def circle(centre: np.ndarray, radius: float) -> np.ndarray:
    """A circle in the disc's plane as 32 points, the first nearest to the thread [m]."""
    rim = np.column_stack([np.sin(_ANGLES), -np.cos(_ANGLES), 0 * _ANGLES])
    return centre + radius * rim


def rim_points(disc: Disc, n: int) -> np.ndarray:
    """Points evenly spread along the disc's rim, from its first vertex on, shape (n, 3) [m]."""
    rim = outline_of(disc)
    closed = np.concatenate([rim, rim[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    places = along[-1] * np.arange(n) / n
    return np.column_stack([np.interp(places, along, c) for c in closed.T])
