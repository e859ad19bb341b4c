"""Obstacles and contact forces on a page."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from scipy.spatial import ConvexHull

from .contact import HalfSpace, Obstacle
from .contact.record import Contacts
from .drawing import View
from .style import BLACK, GREY, faded

_CIRCLE = np.linspace(0.0, 2 * np.pi, 73)[:-1]
_SLAB = 0.02  # thickness of a plane seen obliquely, of the picture's size
_HEAD = 0.5  # of a typical arrow
_ARROW = 0.13  # of a typical force, of the picture's shorter side
_LONGEST = 2.0  # arrow, of a typical one


def silhouette(obstacle: Obstacle, view: View, middle: np.ndarray, reach: float) -> np.ndarray:
    """Outline of an obstacle on the page, shape (n, 2) [m].

    Args:
        obstacle: the obstacle.
        view: the projection.
        middle: of the picture, in the root's frame, shape (3,) [m].
        reach: how far from there a half-space is drawn [m].
    """
    shape = obstacle.shape
    balls = shape.balls()
    if balls is not None:
        ring = balls.radius * np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE)])
        points = (view.project(balls.centres)[:, np.newaxis] + ring).reshape(-1, 2)
        return _hull(points)
    assert isinstance(shape, HalfSpace)
    normal = shape.normal
    foot = middle - ((middle - shape.point) @ normal) * normal
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    sides = np.array([first, np.cross(normal, first)])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ sides * reach
    edge_on = abs(normal @ view.toward) < 1e-6
    depth = (2 * reach if edge_on else _SLAB * reach) * normal
    return _hull(view.project(foot + np.concatenate([corners, corners - depth])))


def _hull(points: np.ndarray) -> np.ndarray:
    return points[ConvexHull(points, qhull_options="QJ").vertices]


def draw_obstacles(
    axes: Axes, obstacles: tuple[Obstacle, ...], view: View, middle: np.ndarray, reach: float
) -> None:
    """Put obstacles behind everything else."""
    outlines = [silhouette(obstacle, view, middle, reach) for obstacle in obstacles]
    patches = PolyCollection(outlines, linewidths=0.8, zorder=0.5)
    patches.set_facecolor(faded(GREY, 0.25))
    patches.set_edgecolor(GREY)
    axes.add_collection(patches, autolim=False)


def pushes(contacts: Contacts, t: float) -> np.ndarray:
    """Where obstacles and plates push each disc at a time, and the force: shape (n, 2, 3) [m, N].

    The forces on the points of one rim are drawn as their sum, at their middle.
    """
    now = contacts.t == t
    found = []
    pairs = np.column_stack([contacts.disc, contacts.obstacle, contacts.plate])
    for pair in np.unique(pairs[now], axis=0):
        mine = now & np.all(pairs == pair, axis=1)
        force = contacts.force[mine]
        size = np.linalg.norm(force, axis=1)
        found.append([size @ contacts.place[mine] / size.sum(), force.sum(axis=0)])
    return np.array(found).reshape(-1, 2, 3)


def typical_force(frames: list[np.ndarray]) -> float:
    """Median of the largest force in each frame that has one [N]; 0 where there is none."""
    each = [np.linalg.norm(frame[:, 1], axis=1).max() for frame in frames if len(frame)]
    return float(np.median(each)) if each else 0.0


def surroundings(
    obstacles: tuple[Obstacle, ...], view: View, robot: np.ndarray, frames: list[np.ndarray]
) -> np.ndarray:
    """What a picture must show beside the robot's points: arrows, obstacles of a like size."""
    extent = np.ptp(robot, axis=0).max()
    points = [np.zeros((0, 2))]
    for frame in frames:
        for tip, force in frame:
            strength = np.hypot(*force)
            if strength > 0:
                points.append((tip - _LONGEST * _ARROW * extent * force / strength)[np.newaxis])
    for obstacle in obstacles:
        if obstacle.shape.balls() is not None:
            outline = silhouette(obstacle, view, np.zeros(3), extent)
            if np.ptp(outline, axis=0).max() < 1.5 * extent:
                points.append(outline)
    return np.concatenate(points)


class PushArtists:
    """Contact forces as arrows whose tips are where they act."""

    def __init__(self, axes: Axes, typical: float, size: float):
        """Put empty artists on the axes.

        Args:
            axes: where to draw.
            typical: force whose arrow is `_ARROW` long [N]; longer ones end at twice that.
            size: shorter side of the picture [m].
        """
        self._scale = _ARROW * size / typical if typical > 0 else 0.0
        self._arrow = _ARROW * size
        self.shafts = LineCollection([], colors=BLACK, linewidths=1.6, zorder=5)
        self.heads = PolyCollection([], facecolors=BLACK, linewidths=0.0, zorder=5)
        for collection in (self.shafts, self.heads):
            axes.add_collection(collection, autolim=False)

    def show(self, pushes: np.ndarray) -> None:
        """Move them, shape (n, 2, 2) [m, N]."""
        shafts, heads = [], []
        for tip, force in pushes:
            strength = float(np.hypot(*force))
            length = min(self._scale * strength, _LONGEST * self._arrow)
            if length == 0.0:
                continue
            along = force / strength
            head = min(_HEAD * self._arrow, 0.6 * length)
            base = tip - head * along
            across = 0.35 * head * np.array([-along[1], along[0]])
            shafts.append([tip - length * along, base])
            heads.append([tip, base + across, base - across])
        self.shafts.set_segments(shafts)
        self.heads.set_verts(heads)
