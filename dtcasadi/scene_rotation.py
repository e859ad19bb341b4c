"""Rotations of scene files."""

import numpy as np

from .scene_tables import Table
from .scene_units import ANGLE


def read_rotation(part: Table, key: str) -> np.ndarray | None:
    """Rx(a) Ry(b) Rz(c) from the angles (a, b, c)."""
    angles = part.array(key, (3,), ANGLE, default=None)
    if angles is None:
        return None
    (a, b, c), (sa, sb, sc) = np.cos(angles), np.sin(angles)
    about_x = np.array([[1, 0, 0], [0, a, -sa], [0, sa, a]])
    about_y = np.array([[b, 0, sb], [0, 1, 0], [-sb, 0, b]])
    about_z = np.array([[c, -sc, 0], [sc, c, 0], [0, 0, 1]])
    return about_x @ about_y @ about_z
