"""Volume between the discs of a chamber by a triangle mesh of its surface."""

import numpy as np

from dtcasadi.robot import Robot


def polygon(n: int, area: float, rng: np.random.Generator) -> np.ndarray:
    """An irregular convex polygon with its centroid at the origin, shape (n, 2)."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, n))
    points = np.column_stack([2.0 * np.cos(angles), np.sin(angles)])
    after = np.roll(points, -1, axis=0)
    turns = points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0]
    centroid = ((points + after) * turns[:, None]).sum(axis=0) / (3 * turns.sum())
    return (points - centroid) * np.sqrt(area / (turns.sum() / 2))


def _signed(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    """Volume of the tetrahedra from the origin to triangles, shape (n, 3) each."""
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def between(first: np.ndarray, second: np.ndarray) -> float:
    """Volume between two plane rims with corresponding points, shape (n, 3) each.

    Each wall quadrilateral is the mean of its two triangulations: the volume under the surface of
    straight lines from rim to rim. Each end is a fan.
    """
    a, b = first, np.roll(first, -1, axis=0)
    c, d = second, np.roll(second, -1, axis=0)
    walls = _signed(a, b, d) + _signed(a, d, c) + _signed(a, b, c) + _signed(b, d, c)
    near, far = first.mean(axis=0), second.mean(axis=0)
    ends = _signed(b, a, 0 * a + near) + _signed(c, d, 0 * c + far)
    return walls / 2 + ends


def volumes(
    robot: Robot, R: np.ndarray, r: np.ndarray, outline: np.ndarray, pressure: np.ndarray
) -> np.ndarray:
    """Volume of each chamber whose sections are scaled copies of an outline of area 1.

    Args:
        robot: the robot.
        R: rotations of the discs side by side, shape (3, 3 n_discs).
        r: their origins, shape (3, n_discs) [m].
        outline: polygon of area 1 with its centroid at the origin, shape (n, 2).
        pressure: of each chamber [Pa].
    """
    found = []
    for chamber, p in zip(robot.chambers, pressure, strict=True):
        assert chamber.areas is not None and chamber.centroids is not None  # by Robot
        scale = 1 + chamber.radial_compliance * p
        first, last = chamber.discs
        rims = []
        for k, disc in enumerate(range(first - 1, last)):
            flat = np.column_stack([outline * np.sqrt(chamber.areas[k]), np.zeros(len(outline))])
            local = scale * (chamber.centroids[k] + flat)
            rims.append(r[:, disc] + local @ R[:, 3 * disc : 3 * disc + 3].T)
        found.append(sum(between(a, b) for a, b in zip(rims, rims[1:], strict=False)))
    return np.array(found)
