"""The robot on matplotlib axes: artists that follow its poses, gravity, directions and scale."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator

from .drawing import Shapes, View
from .robot import Robot
from .scenery import PushArtists
from .style import BLACK, BLUE, CHAMBERS, GREY, PURPLE, VERMILION, faded

SIGNS_HEIGHT = 0.56  # [in]


@dataclass(frozen=True, eq=False)
class Box:
    """Limits of a picture on the page [m]."""

    left: float
    right: float
    bottom: float
    top: float

    @classmethod
    def around(cls, points: np.ndarray) -> "Box":
        """The points with a margin, neither side shorter than a third of the other."""
        low, high = points.min(axis=0), points.max(axis=0)
        size = high - low
        size = np.maximum(1.12 * size, 0.33 * size.max() or 1.0)
        middle = (low + high) / 2
        low, high = middle - size / 2, middle + size / 2
        return cls(low[0], high[0], low[1], high[1])

    @property
    def size(self) -> np.ndarray:
        """Width and height [m]."""
        return np.array([self.right - self.left, self.top - self.bottom])


class RobotArtists:
    """A robot's discs, threads, springs and chambers on axes, moved from pose to pose.

    Attributes:
        discs, threads, springs, chambers, path, pushes: the artists.
    """

    def __init__(
        self,
        axes: Axes,
        robot: Robot,
        full_pressure: float,
        arrows: tuple[float, float] = (0.0, 0.0),
    ):
        """Put empty artists on the axes.

        Args:
            axes: where to draw.
            robot: the robot; the root disc is drawn in grey.
            full_pressure: absolute pressure at which a chamber has its strongest colour [Pa].
            arrows: typical contact force [N], and shorter side of the picture [m].
        """
        self._full = full_pressure
        width = min(max(16.0 / robot.n_discs, 0.6), 2.0)  # many discs, thin lines
        edges = [GREY] + [BLUE] * (robot.n_discs - 1)
        self._edges = np.array([faded(edge, 1.0) for edge in edges])
        self._faces = np.array([faded(edge, 0.22) for edge in edges])
        self.chambers = PathCollection([], linewidths=0.0, zorder=1)
        self.path = Line2D([], [], color=PURPLE, linewidth=1.0, linestyle=":", zorder=1.5)
        self.springs = LineCollection([], colors=VERMILION, linewidths=0.35 * width, zorder=2)
        self.discs = PolyCollection([], linewidths=width, joinstyle="round", zorder=3)
        self.threads = LineCollection([], colors=BLACK, linewidths=0.8 * width, zorder=4)
        for collection in (self.chambers, self.springs, self.discs, self.threads):
            axes.add_collection(collection, autolim=False)
        axes.add_line(self.path)
        self.pushes = PushArtists(axes, *arrows) if robot.touchable else None

    def show(self, shapes: Shapes, pressure: np.ndarray, path: np.ndarray) -> None:
        """Move everything to a pose.

        Args:
            shapes: the pose.
            pressure: of each chamber, shape (n_u,) [Pa].
            path: where the last disc's centre of mass has been, shape (n, 2) [m].
        """
        self.discs.set_verts([shapes.discs[i] for i in shapes.order])
        self.discs.set_edgecolor(self._edges[shapes.order])
        self.discs.set_facecolor(self._faces[shapes.order])
        self.threads.set_segments(list(shapes.threads))
        self.springs.set_segments(list(shapes.springs))
        self.chambers.set_paths([_union(wall) for _, wall in shapes.chambers])
        self.chambers.set_facecolor([self._shade(k, pressure[k]) for k, _ in shapes.chambers])
        self.path.set_data(path[:, 0], path[:, 1])
        if self.pushes is not None:
            self.pushes.show(shapes.pushes)

    def _shade(self, chamber: int, pressure: float) -> tuple[float, float, float, float]:
        share = min(abs(pressure) / self._full, 1.0) if self._full > 0 else 0.0
        return faded(CHAMBERS[chamber % len(CHAMBERS)], 0.08 + 0.42 * share)


def _union(triangles: np.ndarray) -> Path:
    """One path that fills what any of the triangles covers, once (non-zero winding)."""
    closed = np.concatenate([triangles, triangles[:, :1]], axis=1).reshape(-1, 2)
    codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY] * len(triangles)
    return Path(closed, codes)


def legend_handles(robot: Robot) -> dict[str, Line2D | Patch]:
    """What a legend shows, by label."""
    handles: dict[str, Line2D | Patch] = {
        "root": Line2D([], [], color=GREY, linewidth=2.0),
        "disc": Line2D([], [], color=BLUE, linewidth=2.0),
        "thread": Line2D([], [], color=BLACK, linewidth=1.6),
    }
    if robot.springs:
        handles["spring"] = Line2D([], [], color=VERMILION, linewidth=0.9)
    n = len(robot.chambers)
    for k in range(min(n, 3)):
        label = "chamber" if n == 1 else f"chamber {k + 1}"
        handles[label] = Patch(color=faded(CHAMBERS[k], 0.5), linewidth=0)
    if robot.obstacles:
        handles["obstacle"] = Patch(facecolor=faded(GREY, 0.25), edgecolor=GREY)
    if robot.touchable:
        handles["contact force"] = Line2D(
            [], [], color=BLACK, linewidth=0.0, marker=r"$\uparrow$", markersize=9.0
        )
    label = f"path of disc {robot.n_discs}"
    handles[label] = Line2D([], [], color=PURPLE, linewidth=1.0, linestyle=":")
    return handles


def set_stage(axes: Axes, view: View, box: Box, *, left: bool = True, bottom: bool = True) -> None:
    """Limits, equal scales, and axes to read off where the view has them.

    Args:
        axes: the axes.
        view: the view drawn.
        box: its limits.
        left: whether to write the vertical axis's numbers and name.
        bottom: whether to write those of the horizontal one.
    """
    axes.set_xlim(box.left, box.right)
    axes.set_ylim(box.bottom, box.top)
    axes.set_aspect("equal", adjustable="box")
    if view.labels is None:
        axes.set_axis_off()
        return
    axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    axes.tick_params(labelleft=left, labelbottom=bottom, length=2.5)
    if bottom:
        axes.set_xlabel(view.labels[0])
    if left:
        axes.set_ylabel(view.labels[1])


def signs_width(view: View) -> float:
    """How wide `add_signs` is [in]; it is `SIGNS_HEIGHT` high."""
    return 0.6 if view.labels else 1.75


def add_signs(
    figure: Figure, robot: Robot, view: View, corner: tuple[float, float], scale: float
) -> None:
    """An arrow along gravity; in an oblique view also the root's x, y, z and a length.

    Args:
        figure: where to draw.
        robot: the robot.
        view: the view of the picture.
        corner: left and lower edge on the figure [in].
        scale: inches on the page for a metre.
    """
    size = np.array([signs_width(view), SIGNS_HEIGHT])
    place = np.concatenate([corner, size]) / np.tile(figure.get_size_inches(), 2)
    axes = figure.add_axes(tuple(place), label="signs")
    axes.set_axis_off()
    axes.set_xlim(0.0, size[0])
    axes.set_ylim(0.0, size[1])
    if robot.gravity > 0:
        _gravity(axes, robot, view, np.array([0.33, size[1] / 2]))
    if view.labels is None:
        _directions(axes, view, np.array([0.85, size[1] / 2]))
        _length(axes, scale, np.array([1.2, 0.15]))


def _gravity(axes: Axes, robot: Robot, view: View, middle: np.ndarray) -> None:
    down = view.project(-robot.up)
    if np.linalg.norm(down) < 0.1:
        way = "into" if robot.up @ view.toward > 0 else "out of"
        text = f"g {way}\nthe page"
        axes.text(middle[0], middle[1], text, color=BLACK, fontsize=8, ha="center", va="center")
        return
    down = down / np.linalg.norm(down)
    axes.annotate(
        "",
        xy=_pair(middle + 0.19 * down),
        xytext=_pair(middle - 0.19 * down),
        arrowprops={"arrowstyle": "-|>", "color": BLACK, "linewidth": 1.2},
    )
    x, y = middle + 0.12 * np.array([-abs(down[1]), abs(down[0])])
    axes.text(x, y, "g", color=BLACK, style="italic", ha="center", va="center")


def _directions(axes: Axes, view: View, middle: np.ndarray) -> None:
    for letter, direction in zip("xyz", view.project(np.eye(3)), strict=True):
        axes.plot(*np.array([middle, middle + 0.17 * direction]).T, color=GREY, linewidth=1.0)
        if np.linalg.norm(direction) > 0.15:
            x, y = middle + 0.24 * direction
            axes.text(x, y, letter, color=GREY, ha="center", va="center", fontsize=8)


def _length(axes: Axes, scale: float, start: np.ndarray) -> None:
    """The longest round length that fits, with its name above."""
    power = 10.0 ** np.floor(np.log10(0.5 / scale))
    length = max(m * power for m in (1, 2, 5) if m * power * scale <= 0.5 * (1 + 1e-9))
    ends = [start[0], start[0] + length * scale]
    axes.plot(ends, [start[1]] * 2, color=GREY, linewidth=2.0)
    middle = sum(ends) / 2
    axes.text(middle, start[1] + 0.05, f"{length:g} m", color=GREY, ha="center", fontsize=8)


def _pair(point: np.ndarray) -> tuple[float, float]:
    return float(point[0]), float(point[1])
