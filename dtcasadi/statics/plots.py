"""Pictures of equilibria: a branch against its parameter with poses beside it, and mode shapes.

As in `dtcasadi.plots`, every function returns the matplotlib Figure and writes it where a path is
given: PNG, SVG or PDF by the file's suffix.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..artists import SIGNS_HEIGHT, Box, RobotArtists, add_signs, set_stage, signs_width
from ..drawing import Shapes, View, shapes_of, view_of
from ..robot import Robot
from ..style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    VERMILION,
    WIDTH_IN,
    PictureError,
    finished,
    new_figure,
    pressure_unit,
    styled,
)
from .branch import Branch
from .equilibrium import Equilibrium

Quantity = Callable[[Equilibrium], float]
_POSES = 5  # beside a diagram
# Largest movement of a disc in the picture of a mode, of the robot's length, and rotation [rad].
_SWING, _TURN = 0.12, 0.5
_LINES: dict[str, dict[str, Any]] = {
    "stable": {"color": BLUE, "linestyle": "-"},
    "neutral": {"color": BLUE, "linestyle": "-"},
    "divergence": {"color": VERMILION, "linestyle": "--"},
    "flutter": {"color": ORANGE, "linestyle": ":"},
}
_LABELS = {"stable": "stable", "divergence": "gives way", "flutter": "flutters"}
_MARKS = {"limit": ("o", BLACK), "bifurcation": ("D", GREEN), "flutter": ("^", ORANGE)}
_NAMES = {"limit": "limit point", "bifurcation": "bifurcation", "flutter": "onset of flutter"}


@styled
def diagram(
    branches: Branch | Sequence[Branch],
    path: str | Path | None = None,
    quantity: Quantity | None = None,
    label: str | None = None,
    view: str | None = None,
) -> Figure:
    """Bifurcation diagram: branches against their parameter, events marked, some poses below.

    Args:
        branches: one branch, or several of the same parameter.
        path: file to write, ending in .png, .svg or .pdf.
        quantity: what the vertical axis shows of each equilibrium; default: the coordinate of the
            last disc's centre of mass that changes most.
        label: what the vertical axis is called.
        view: how the robot is seen, `plane` or `3d`; default: the plane if it stays in it.

    Raises:
        PictureError: a branch without points, another suffix, or an unknown view.
        OSError: the file cannot be written.
    """
    shown = [branches] if isinstance(branches, Branch) else list(branches)
    if not shown or not all(branch.points for branch in shown):
        raise PictureError("branches: expected branches with points")
    if quantity is None:
        quantity, found = _most_changed(shown)
        label = label or found
    poses = _telling(shown)
    stage = _Stage.of([point for _, point in poses], view)
    width, height = stage.box.size
    each = (WIDTH_IN - 0.2) / _POSES
    below = min(each * height / width, 2.4)
    total = 4.4 + below + 0.35
    figure = new_figure(WIDTH_IN, total)
    left, right, top = 0.8, 0.15, SIGNS_HEIGHT + 0.05
    bottom = below + 0.95
    axes = figure.add_axes(
        (left / WIDTH_IN, bottom / total, 1 - (left + right) / WIDTH_IN, 1 - (bottom + top) / total)
    )
    factor, name = _parameter(shown[0])
    for branch in shown:
        _draw_branch(axes, branch, quantity, factor)
        for event in branch.events:
            mark, colour = _MARKS[event.kind]
            axes.plot(factor * event.s, quantity(event.equilibrium), mark, color=colour, zorder=4)
    axes.set_xlabel(name)
    axes.set_ylabel(label or "")
    axes.grid(color="#dddddd", linewidth=0.6)
    _legend(figure, shown, signs_width(stage.view) / WIDTH_IN, total)
    corner = (0.03, total - SIGNS_HEIGHT - 0.03)
    add_signs(figure, stage.robot, stage.view, corner, 0.94 * each / width)
    for k, (s, point) in enumerate(poses):
        place = (0.1 + k * each) / WIDTH_IN
        small = figure.add_axes((place, 0.02, 0.94 * each / WIDTH_IN, below / total))
        stage.draw(small, point)
        small.set_title(f"{'abcde'[k]}", loc="left", pad=2)
        axes.annotate(
            "abcde"[k],
            (factor * s, quantity(point)),
            textcoords="offset points",
            xytext=(5, 5 if k % 2 == 0 else -12),  # apart where two poses lie close
            color=GREY,
        )
    return finished(figure, path)


@styled
def modes(
    equilibrium: Equilibrium,
    path: str | Path | None = None,
    count: int = 6,
    view: str | None = None,
) -> Figure:
    """The slowest modes about an equilibrium: the pose, and two shapes that it swings between.

    Args:
        equilibrium: the equilibrium.
        path: file to write, ending in .png, .svg or .pdf.
        count: how many modes at most.
        view: `plane` or `3d`; default: the plane if all shapes stay in it.

    Raises:
        StaticsError: there is no equilibrium.
        PictureError: another suffix, or an unknown view.
        OSError: the file cannot be written.
    """
    count = min(count, equilibrium.model.n_q)
    swings = [_swing(equilibrium, k) for k in range(count)]
    stage = _Stage.of([equilibrium], view, [pose for pair in swings for pose in pair])
    width, height = stage.box.size
    columns = min(count, 3)
    rows = -(-count // columns)
    each = (WIDTH_IN - 0.3) / columns
    tall = min(each * height / width, 3.2)
    total = rows * (tall + 0.35) + SIGNS_HEIGHT
    figure = new_figure(WIDTH_IN, total)
    for k, pair in enumerate(swings):
        row, column = divmod(k, columns)
        bottom = total - SIGNS_HEIGHT - (row + 1) * (tall + 0.35) + 0.05
        place = (0.15 + column * each) / WIDTH_IN, bottom / total
        axes = figure.add_axes((*place, 0.96 * each / WIDTH_IN, tall / total))
        stage.draw(axes, equilibrium)
        for pose, colour in zip(pair, (VERMILION, GREEN), strict=True):
            _outline(axes, stage.shapes(*pose), colour)
        axes.set_title(f"mode {k + 1}: {_rate(equilibrium, k)}", pad=3)
    scale = 0.96 * each / width
    add_signs(
        figure, equilibrium.model.robot, stage.view, (0.03, total - SIGNS_HEIGHT - 0.03), scale
    )
    return finished(figure, path)


@dataclass(frozen=True, eq=False)
class _Stage:
    """One view and one scale for several poses of a robot."""

    robot: Robot
    view: View
    box: Box
    full_pressure: float

    @classmethod
    def of(
        cls, points: Sequence[Equilibrium], view: str | None, extra: Sequence[tuple] = ()
    ) -> "_Stage":
        poses = [point.poses for point in points] + list(extra)
        robot = points[0].model.robot
        R, r = (np.array(part) for part in zip(*poses, strict=True))
        if view not in (None, "plane", "3d"):
            raise PictureError(f"view: expected plane or 3d, got {view!r}")
        seen = view_of(robot, R, r, view)
        shapes = [shapes_of(robot, R, r, seen).points for R, r in poses]
        full = max(float(np.abs(point.pressure).max(initial=0.0)) for point in points)
        return cls(robot, seen, Box.around(np.concatenate(shapes)), full)

    def shapes(self, R: np.ndarray, r: np.ndarray) -> Shapes:
        """A pose on the page."""
        return shapes_of(self.robot, R, r, self.view)

    def draw(self, axes: Axes, point: Equilibrium) -> None:
        """The robot in an equilibrium, without axes to read off."""
        set_stage(axes, self.view, self.box)
        axes.set_axis_off()
        shapes = self.shapes(*point.poses)
        artists = RobotArtists(axes, self.robot, self.full_pressure)
        artists.show(shapes, point.pressure, shapes.tip[np.newaxis])


def _draw_branch(axes: Axes, branch: Branch, quantity: Quantity, factor: float) -> None:
    """The curve in pieces of one kind; where the kind changes at an event, the piece ends there."""
    places = [(s, point, point.kind) for s, point in zip(branch.s, branch.points, strict=True)]
    for event in reversed(branch.events):  # from behind, so that the numbers stay
        k = event.after + 1
        places.insert(k, (event.s, event.equilibrium, places[k][2]))
    piece = places[:1]
    for place in places[1:]:
        piece.append(place)
        if place[2] != piece[0][2]:
            _draw_piece(axes, piece, quantity, factor)
            piece = [place]
    _draw_piece(axes, piece, quantity, factor)


def _draw_piece(axes: Axes, piece: list[tuple], quantity: Quantity, factor: float) -> None:
    s, values = zip(*((factor * s, quantity(point)) for s, point, _ in piece), strict=True)
    axes.plot(s, values, **_LINES[piece[0][2]])


def _parameter(branch: Branch) -> tuple[float, str]:
    """Factor and name of the horizontal axis."""
    if not branch.parameter.startswith("pressure"):
        return 1.0, f"{branch.parameter} [SI]" if branch.parameter != "s" else "s [-]"
    factor, unit = pressure_unit(max(map(abs, branch.limits)))
    return factor, f"{branch.parameter} [{unit}]"


def _most_changed(branches: Sequence[Branch]) -> tuple[Quantity, str]:
    """The last disc's centre along the axis on which it moves most, and what it is called."""
    tips = np.concatenate([branch.tips for branch in branches])
    axis = int(np.argmax(np.ptp(tips, axis=0)))
    robot = branches[0].model.robot

    def tip(point: Equilibrium) -> float:
        R, r = point.poses
        return float((r[-1] + R[-1] @ robot.discs[-1].centre_of_mass)[axis])

    return tip, f"centre of disc {robot.n_discs}, {'xyz'[axis]} [m]"


def _telling(branches: Sequence[Branch]) -> list[tuple[float, Equilibrium]]:
    """Poses to show, in order: both ends, events, and others spread between where there is room."""
    first = branches[0]
    last = len(first.s) - 1
    order: dict[tuple[int, float], tuple[float, Equilibrium]] = {}
    for k, branch in enumerate(branches):
        ends = (0, len(branch.s) - 1) if k == 0 else (len(branch.s) - 1,)
        order |= {(k, end): (float(branch.s[end]), branch.points[end]) for end in ends}
        order |= {(k, e.after + 0.5): (e.s, e.equilibrium) for e in branch.events}
    for k in np.linspace(0, last, _POSES).round().astype(int)[1:-1]:
        if len(order) < _POSES:
            order.setdefault((0, int(k)), (float(first.s[k]), first.points[k]))
    places = sorted(order)
    kept = np.linspace(0, len(places) - 1, min(_POSES, len(places))).round().astype(int)
    return [order[places[k]] for k in kept]


def _legend(figure: Figure, branches: Sequence[Branch], left: float, height: float) -> None:
    """What lines and marks mean, right of the signs."""
    kinds = {point.kind for branch in branches for point in branch.points}
    handles = [
        Line2D([], [], **_LINES[kind], label=label)
        for kind, label in _LABELS.items()
        if kind in kinds or (kind == "stable" and "neutral" in kinds)
    ]
    seen = {event.kind for branch in branches for event in branch.events}
    for kind in sorted(seen):
        mark, colour = _MARKS[kind]
        line = Line2D([], [], linestyle="", marker=mark, color=colour, label=_NAMES[kind])
        handles.append(line)
    place = ((left + 1) / 2, 1 - 0.3 / height)
    figure.legend(handles=handles, loc="center", bbox_to_anchor=place, ncols=len(handles))


def _swing(point: Equilibrium, k: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Poses at both ends of a mode's swing."""
    model, shape = point.model, point.mode_shapes[:, k]
    # Of a complex pair the two parts are the two shapes that the motion goes through.
    second = np.imag(point.squared_frequencies[k]) > 0
    shape = np.imag(shape) if second else np.real(shape)
    size = _TURN / np.max(np.abs(shape))
    for _ in range(20):  # to first order the movement is linear in the size
        moved = np.array(model.poses(point.q + size * shape, point.theta)[1]).T - point.poses[1]
        most = np.max(np.linalg.norm(moved, axis=1)) / (_SWING * model.robot.length)
        if most <= 1:
            break
        size /= most
    ends = [replace(point, q=point.q + sign * size * shape) for sign in (1, -1)]
    return [end.poses for end in ends]


def _rate(point: Equilibrium, k: int) -> str:
    square = complex(point.squared_frequencies[k])
    if point.frequencies[k] == 0 and square.real < 0:
        return f"gives way, {np.sqrt(-square.real):.3g} 1/s"
    return f"{point.frequencies[k]:.3g} rad/s"


def _outline(axes: Axes, shapes: Shapes, colour: str) -> None:
    """Rims and threads as thin lines."""
    rims = [np.concatenate([rim, rim[:1]]) for rim in shapes.discs]
    axes.add_collection(LineCollection(rims, colors=colour, linewidths=0.8, zorder=5))
    axes.add_collection(
        LineCollection(list(shapes.threads), colors=colour, linewidths=0.8, zorder=5)
    )
