"""Area, centroid and second moments of a plane polygon."""

from typing import NamedTuple

import numpy as np

from . import checks
from .errors import RobotError


class PlateMoments(NamedTuple):
    """Moments of a uniform plate; xx, yy and xy are per unit mass, about the centroid.

    Attributes:
        area: enclosed area [m^2].
        centroid: shape (2,) [m].
        xx: mean of y^2, the moment about the x axis [m^2].
        yy: mean of x^2, the moment about the y axis [m^2].
        xy: mean of x y, the product of inertia with its sign not yet turned [m^2].
    """

    area: float
    centroid: np.ndarray
    xx: float
    yy: float
    xy: float


def polygon_moments(corners: np.ndarray) -> PlateMoments:
    """Moments of a simple polygon from its edge sums (Green's theorem).

    Steger 1996, "On the calculation of arbitrary moments of polygons".

    Args:
        corners: shape (n, 2) [m], in either direction.

    Raises:
        RobotError: field `vertices`: fewer than three, no enclosed area, or edges that cross.
    """
    if len(corners) < 3:
        raise RobotError("vertices", "at least 3 corners", len(corners))
    # About their mean, so that a small plate far from the origin loses no digits.
    origin = corners.mean(axis=0)
    x, y = (corners - origin).T
    xn, yn = np.roll(x, -1), np.roll(y, -1)
    cross = x * yn - xn * y
    area = float(cross.sum()) / 2
    if abs(area) <= 1e-12 * float(np.max(np.ptp(corners, axis=0))) ** 2:
        raise RobotError("vertices", "corners that enclose an area", checks.shown(corners))
    if _edges_cross(corners - origin):
        raise RobotError("vertices", "edges that do not cross", checks.shown(corners))
    cx = float(((x + xn) * cross).sum()) / (6 * area)
    cy = float(((y + yn) * cross).sum()) / (6 * area)
    xx = float(((y * y + y * yn + yn * yn) * cross).sum()) / (12 * area) - cy * cy
    yy = float(((x * x + x * xn + xn * xn) * cross).sum()) / (12 * area) - cx * cx
    products = x * yn + 2 * x * y + 2 * xn * yn + xn * y
    xy = float((products * cross).sum()) / (24 * area) - cx * cy
    return PlateMoments(abs(area), origin + np.array([cx, cy]), xx, yy, xy)


def _edges_cross(corners: np.ndarray) -> bool:
    """Whether two edges cross at a point inside both; touching is allowed."""
    start, end = corners, np.roll(corners, -1, axis=0)
    for k in range(len(corners) - 2):
        a, b, c, d = start[k], end[k], start[k + 2 :], end[k + 2 :]
        apart = _side(a, b, c) * _side(a, b, d) < 0
        if np.any(apart & (_side(c, d, a) * _side(c, d, b) < 0)):
            return True
    return False


def _side(a: np.ndarray, b: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Sign of the point's side of the line from a to b; +1 on the left."""
    (ax, ay), (bx, by), (px, py) = a.T, b.T, point.T
    return np.sign((bx - ax) * (py - ay) - (by - ay) * (px - ax))
