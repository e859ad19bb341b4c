"""A run prepared for drawing: its frames on one page, with one scale for all."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from matplotlib.axes import Axes

from .artists import Box, RobotArtists
from .drawing import Shapes, View, shapes_of, view_of
from .result import Run
from .scenery import draw_obstacles, pushes, surroundings, typical_force
from .style import PictureError, pressure_unit

VIEWS = ("plane", "3d")
_FRAMES = 8


@dataclass(frozen=True, eq=False)
class Motion:
    """Frames of a run.

    Attributes:
        run: the run.
        times: when, shape (m,) [s].
        view: how the robot is seen.
        shapes: the robot at each time.
        pressure: of each chamber at each time, shape (n_u, m) [Pa].
        full_pressure: the largest absolute one of the run [Pa].
        box: limits that hold every frame.
        middle: of all discs' origins in all frames, root frame, shape (3,) [m].
        path: where the last disc's centre of mass is at `path_times`, shape (n, 2) [m].
    """

    run: Run
    times: np.ndarray
    view: View
    shapes: list[Shapes]
    pressure: np.ndarray
    full_pressure: float
    box: Box
    middle: np.ndarray
    path: np.ndarray
    path_times: np.ndarray

    @classmethod
    def of(cls, run: Run, times: np.ndarray, view: str | None = None) -> Self:
        """Prepare a run's frames at some times.

        Raises:
            PictureError: unknown view.
        """
        if view is not None and view not in VIEWS:
            raise PictureError(f"view: expected one of {', '.join(VIEWS)}, got {view!r}")
        robot = run.model.robot
        moments = run.at(times)
        R, r = moments.poses()
        seen = view_of(robot, R, r, view)
        contacts = moments.contacts
        shapes = [
            shapes_of(robot, R[k], r[k], seen, pushes(contacts, t)) for k, t in enumerate(times)
        ]
        path_times, path = tip_path(run)
        page = seen.project(path)
        points = np.concatenate([page, *(shape.points for shape in shapes)])
        forces = [shape.pushes for shape in shapes]
        points = np.concatenate([points, surroundings(robot.obstacles, seen, points, forces)])
        pressure = run.pressure
        last = np.maximum(np.searchsorted(run.t, times, side="right") - 1, 0)
        return cls(
            run=run,
            times=times,
            view=seen,
            shapes=shapes,
            pressure=pressure[:, last],
            full_pressure=float(np.abs(pressure).max(initial=0.0)),
            box=Box.around(points),
            middle=r.reshape(-1, 3).mean(axis=0),
            path=page,
            path_times=path_times,
        )

    def artists_on(self, axes: Axes) -> RobotArtists:
        """The robot's artists on axes, not yet in a pose."""
        robot = self.run.model.robot
        size = self.box.size
        if robot.obstacles:
            draw_obstacles(axes, robot.obstacles, self.view, self.middle, size.max())
        arrows = typical_force([shape.pushes for shape in self.shapes]), float(size.min())
        return RobotArtists(axes, robot, self.full_pressure, arrows)

    def frame(self, k: int) -> tuple[Shapes, np.ndarray, np.ndarray]:
        """What `RobotArtists.show` takes."""
        gone = np.searchsorted(self.path_times, self.times[k], side="right")
        path = np.concatenate([self.path[:gone], self.shapes[k].tip[np.newaxis]])
        return self.shapes[k], self.pressure[:, k], path

    def caption(self, k: int) -> str:
        """Time and pressures, in words short enough for a title; several take a second line."""
        time = f"t = {_rounded(self.times[k])} s"
        pressure = self.pressure[:, k]
        if not len(pressure):
            return time
        factor, unit = pressure_unit(self.full_pressure)
        if len(pressure) == 1:
            return f"{time}, {_rounded(factor * pressure[0])} {unit}"
        # All to the last digit that three digits of the largest one have.
        largest = factor * self.full_pressure
        digits = max(0, 2 - math.floor(math.log10(largest))) if largest > 0 else 0
        words = [f"{factor * value:.{digits}f}" for value in pressure]
        if len(words) > 3:
            low, high = factor * pressure.min(), factor * pressure.max()
            words = [f"{low:.{digits}f} to {high:.{digits}f}"]
        return f"{time}\n{' | '.join(words)} {unit}"


def checked_times(run: Run, times: Sequence[float]) -> np.ndarray:
    """The times as an array.

    Raises:
        PictureError: none, or some outside the run.
    """
    moments = np.asarray(times, dtype=float).ravel()
    first, last = run.t[0], run.t[-1]
    if not len(moments) or not np.all((moments >= first) & (moments <= last)):
        raise PictureError(f"times: expected times from {first:g} to {last:g} s, got {times}")
    return moments


def telling_times(run: Run, n: int = _FRAMES) -> np.ndarray:
    """At most n times: start, end, where the last disc turns, the others spread along its way."""
    times, path = tip_path(run)
    if len(times) < 2:
        return times
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    # A little of the time itself, so that a robot at rest still gets frames.
    share = np.diff(times) / (times[-1] - times[0])
    way = np.concatenate([[0.0], np.cumsum(steps + 0.15 * (steps.sum() or 1.0) * share)])
    chosen = np.linspace(0.0, way[-1], n)
    turns = _turns(path @ run.model.robot.up)
    inner = list(range(1, n - 1))
    for turn in turns if len(turns) <= len(inner) else ():
        nearest = min(inner, key=lambda k: abs(chosen[k] - way[turn]))
        inner.remove(nearest)
        chosen[nearest] = way[turn]
    grid = 10.0 ** np.floor(np.log10(times[-1] - times[0]) - 3)
    found = np.round(np.interp(np.sort(chosen), way, times) / grid) * grid
    return np.unique(np.clip([times[0], *found[1:-1], times[-1]], times[0], times[-1]))


def _turns(height: np.ndarray) -> np.ndarray:
    """Indices of the highest and lowest points that stand out by 3 % of the range."""
    least = 0.03 * np.ptp(height)
    found: list[int] = []
    extreme, way = 0, 0.0
    for k in range(1, len(height)):
        rise = height[k] - height[extreme]
        if way == 0.0:  # not yet clear which way it goes
            if abs(rise) > least:
                extreme, way = k, np.sign(rise)
        elif rise * way >= 0:
            extreme = k
        elif abs(rise) > least:
            found.append(extreme)
            extreme, way = k, -way
    return np.array(found, dtype=int)


def tip_path(run: Run, n: int = 600) -> tuple[np.ndarray, np.ndarray]:
    """At most n times, and the last disc's centre of mass then, shape (m, 3) [m]."""
    at = np.unique(np.linspace(0, len(run.t) - 1, min(n, len(run.t))).round().astype(int))
    R, r = run.poses(at)
    return run.t[at], r[:, -1] + R[:, -1] @ run.model.robot.discs[-1].centre_of_mass


def _rounded(value: float) -> str:
    """Three digits, without an exponent where people write none."""
    text = f"{value:.3g}"
    return f"{value:.0f}" if "e+" in text and abs(value) < 1e6 else text
