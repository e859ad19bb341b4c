"""The robot as lines and polygons on a page: its geometry in a pose, and the view on it."""

from dataclasses import dataclass

import numpy as np

from .rim import circle, outline_of
from .robot import Chamber, Disc, Robot

# Of an oblique view: how far the viewer stands above the horizon and off the robot's side.
_ELEVATION, _AZIMUTH = np.radians(18.0), np.radians(35.0)
_TEETH = 5  # zigzags of a spring


@dataclass(frozen=True, eq=False)
class View:
    """A parallel projection on a page.

    Attributes:
        horizontal: direction to the right, a unit vector in the root frame.
        vertical: direction up the page, a unit vector in the root frame.
        labels: what the two axes measure [m]; None: an oblique view, nothing to read off.
    """

    horizontal: np.ndarray
    vertical: np.ndarray
    labels: tuple[str, str] | None

    @property
    def toward(self) -> np.ndarray:
        """Direction to the viewer."""
        return np.cross(self.horizontal, self.vertical)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Points, shape (..., 3), on the page, shape (..., 2) [m]."""
        return points @ np.column_stack([self.horizontal, self.vertical])


def plane_view(robot: Robot) -> View:
    """The root's y-z plane seen from the side, up upward and the robot's axis to the right."""
    vertical = np.array([0.0, *robot.up[1:]])
    size = float(np.linalg.norm(vertical))
    # With gravity across the plane there is no up in it; y takes its place.
    vertical = vertical / size if size > 0.1 else np.array([0.0, 1.0, 0.0])
    horizontal = np.array([0.0, -vertical[2], vertical[1]])
    if horizontal[2] < -1e-9 or (abs(horizontal[2]) <= 1e-9 and horizontal[1] < 0):
        horizontal = -horizontal
    is_up = bool(np.allclose(vertical, robot.up, atol=1e-9))
    return View(
        horizontal,
        vertical,
        (_label(horizontal), "height [m]" if is_up else _label(vertical)),
    )


def oblique_view(robot: Robot) -> View:
    """A view on the robot in space, up upward and the robot's axis mostly to the right."""
    up = robot.up
    axis = np.array([0.0, 0.0, 1.0])
    if abs(up[2]) > 0.9:  # a standing or hanging robot
        axis = np.array([0.0, 1.0, 0.0])
    ahead = axis - (axis @ up) * up
    ahead /= np.linalg.norm(ahead)
    side = np.cross(ahead, up)
    level = np.cos(_AZIMUTH) * side + np.sin(_AZIMUTH) * ahead
    viewer = np.cos(_ELEVATION) * level + np.sin(_ELEVATION) * up
    horizontal = np.cross(up, viewer)
    horizontal /= np.linalg.norm(horizontal)
    return View(horizontal, np.cross(viewer, horizontal), None)


def view_of(robot: Robot, R: np.ndarray, r: np.ndarray, name: str | None) -> View:
    """The view of a name; without one the plane's if the discs never leave it."""
    if name is None:
        out_of_plane = max(np.abs(R[..., 0, 1:]).max(), np.abs(r[..., 0]).max() / robot.length)
        name = "plane" if out_of_plane < 1e-3 else "3d"
    return plane_view(robot) if name == "plane" else oblique_view(robot)


def _label(direction: np.ndarray) -> str:
    """The name of a direction, with its unit."""
    for axis, letter in enumerate("xyz"):
        if abs(direction[axis]) > 1 - 1e-9:
            return f"{'-' if direction[axis] < 0 else ''}{letter} [m]"
    return "along the plane [m]"


def _section(chamber: Chamber, k: int, disc: Disc) -> np.ndarray:
    """Where a chamber presses on its k-th disc: the rim, or a circle of the same area."""
    assert chamber.areas is not None and chamber.centroids is not None
    area, centroid = chamber.areas[k], chamber.centroids[k]
    if area == disc.area and np.array_equal(centroid, disc.centroid) and len(disc.outline):
        return disc.outline
    return circle(centroid, np.sqrt(area / np.pi))


@dataclass(frozen=True, eq=False)
class Shapes:
    """A robot in one pose on a page; every array holds points, shape (..., 2) [m].

    Attributes:
        discs: rim of each disc, the root first.
        order: disc numbers less one, the farthest from the viewer first.
        threads: both ends of each thread, shape (n_discs - 1, 2, 2).
        springs: a zigzag for each spring, shape (n_springs, n, 2).
        chambers: chamber number less one and the triangles of its wall, shape (n, 3, 2), for each
            pair of discs it spans.
        tip: centre of mass of the last disc, shape (2,).
        pushes: (point, force) of each contact, shape (n, 2, 2) [m, N].
    """

    discs: list[np.ndarray]
    order: np.ndarray
    threads: np.ndarray
    springs: np.ndarray
    chambers: list[tuple[int, np.ndarray]]
    tip: np.ndarray
    pushes: np.ndarray

    @property
    def points(self) -> np.ndarray:
        """Every point, for the limits of a picture, shape (n, 2)."""
        parts = [*self.discs, self.threads.reshape(-1, 2), self.springs.reshape(-1, 2)]
        return np.concatenate([*parts, *(wall.reshape(-1, 2) for _, wall in self.chambers)])


def shapes_of(
    robot: Robot, R: np.ndarray, r: np.ndarray, view: View, pushes: np.ndarray | None = None
) -> Shapes:
    """Project a robot.

    Args:
        robot: the robot.
        R: disc frames in the root frame, shape (n_discs, 3, 3).
        r: their origins, shape (n_discs, 3) [m].
        view: the projection.
        pushes: (place [m], force [N]) of each contact, shape (n, 2, 3).
    """
    flat = view.project

    def placed(i: int, points: np.ndarray) -> np.ndarray:
        return r[i] + points @ R[i].T

    rims = [placed(i, outline_of(disc)) for i, disc in enumerate(robot.discs)]
    starts = [placed(i, thread.exit_point) for i, thread in enumerate(robot.threads)]
    ends = [(placed(s.discs[0] - 1, s.start), placed(s.discs[1] - 1, s.end)) for s in robot.springs]
    chambers = []
    for number, chamber in enumerate(robot.chambers):
        first, last = chamber.discs[0] - 1, chamber.discs[1] - 1
        rings = [
            flat(placed(i, _section(chamber, i - first, robot.discs[i])))
            for i in range(first, last + 1)
        ]
        for one, other in zip(rings[:-1], rings[1:], strict=True):
            chambers.append((number, _wall(one, other)))
    return Shapes(
        discs=[flat(rim) for rim in rims],
        order=np.argsort([rim.mean(axis=0) @ view.toward for rim in rims], kind="stable"),
        threads=flat(np.stack([np.array(starts), r[1:]], axis=1)),
        springs=_zigzags(flat(np.array(ends).reshape(-1, 2, 3)), _swing(robot)),
        chambers=chambers,
        tip=flat(placed(robot.n_discs - 1, robot.discs[-1].centre_of_mass)),
        pushes=flat(np.zeros((0, 2, 3)) if pushes is None else pushes),
    )


def _swing(robot: Robot) -> float:
    """How wide springs are drawn [m]: to be seen along the robot, and not to hide its discs."""
    across = min(float(np.ptp(outline_of(disc), axis=0).max()) for disc in robot.discs)
    return min(0.04 * robot.length, 0.12 * across)


def _zigzags(ends: np.ndarray, width: float) -> np.ndarray:
    """Springs as zigzags between their ends, shape (n, 2, 2) -> (n, m, 2)."""
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    across = np.column_stack([-along[:, 1], along[:, 0]]) / np.maximum(length, 1e-12)
    across = across * np.minimum(width, 0.5 * length)
    share = np.concatenate([[0.0], np.linspace(0.15, 0.85, 2 * _TEETH + 1), [1.0]])
    swing = np.zeros(len(share))
    swing[2:-2] = np.where(np.arange(2 * _TEETH - 1) % 2, -0.5, 0.5)
    return (ends[:, :1] + share[:, np.newaxis] * along[:, np.newaxis]) + swing[
        :, np.newaxis
    ] * across[:, np.newaxis]


def _wall(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Triangles that cover the space between two rims on the page, all turning the same way.

    Straight lines join points at the same share of both rims; the rims' insides are covered too.
    """
    n = max(len(one), len(other))
    a, b = _resampled(one, n), _resampled(other, n)
    a_next, b_next = np.roll(a, -1, axis=0), np.roll(b, -1, axis=0)
    inside = [np.broadcast_to(ring.mean(axis=0), ring.shape) for ring in (a, b)]
    corners = (
        (a, a_next, b),
        (a_next, b_next, b),
        (a, a_next, inside[0]),
        (b, b_next, inside[1]),
    )
    triangles = np.concatenate([np.stack(each, axis=1) for each in corners])
    sides = triangles[:, 1:] - triangles[:, :1]
    turned = sides[:, 0, 0] * sides[:, 1, 1] < sides[:, 0, 1] * sides[:, 1, 0]
    triangles[turned] = triangles[turned, ::-1]
    return triangles


def _resampled(ring: np.ndarray, n: int) -> np.ndarray:
    """A closed line with n points."""
    if len(ring) == n:
        return ring
    closed = np.concatenate([ring, ring[:1]])
    place = np.arange(n) * len(ring) / n
    return np.column_stack([np.interp(place, np.arange(len(closed)), c) for c in closed.T])
