"""A scene's tube or rod in another number of discs, everything else in its place."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .contact import Obstacle
from .errors import SceneError
from .forces.protocol import Force
from .robot import Robot
from .sampled import Sampled
from .sensors import Lengths

if TYPE_CHECKING:
    from .scene import Scene


def rediscretised(scene: "Scene", n_discs: int) -> "Scene":
    """See `Scene.rediscretised`."""
    if scene.beam is None:
        raise _error("robot", "a robot made from a tube or a rod", "one given disc by disc")
    if scene.robot.constraints:
        raise _error("robot", "a robot without constraints", f"{len(scene.robot.constraints)}")
    charts = set(scene.initial_chart or ())
    if len(charts) != 1 or not isinstance(scene.options.get("chart", ""), str):
        raise _error("chart", "one chart for all segments", "one for each")
    cut = scene.beam.robot(n_discs)
    before, after = _places(scene.robot), _places(cut)
    nearest = {i: int(np.argmin(np.abs(after - x))) + 1 for i, x in enumerate(before, 1)}
    forces = tuple(_moved(force, nearest) for force in scene.robot.forces)
    obstacles = tuple(_facing(obstacle, nearest) for obstacle in scene.robot.obstacles)
    middles, new_middles = _middles(before), _middles(after)
    poses = []
    for values in (scene.q0, scene.qd0):
        rates = values.reshape(len(middles), -1) / np.diff(before)[:, np.newaxis]
        at = [np.interp(new_middles, middles, column) for column in rates.T]
        poses.append((np.array(at).T * np.diff(after)[:, np.newaxis]).ravel())
    return replace(
        scene,
        robot=replace(cut, forces=forces, obstacles=obstacles, plates=scene.robot.plates),
        q0=poses[0],
        qd0=poses[1],
        initial_chart=charts.pop(),
        sensors=tuple(_sensor_moved(sensor, nearest) for sensor in scene.sensors),
    )


def _places(robot: Robot) -> np.ndarray:
    """Share of the thread's length before each disc."""
    along = np.cumsum([0.0, *(thread.length for thread in robot.threads)])
    return along / along[-1]


def _middles(places: np.ndarray) -> np.ndarray:
    return (places[1:] + places[:-1]) / 2


def _moved(force: Force, nearest: dict[int, int]) -> Force:
    number = getattr(force, "disc", None)
    if number is None:
        raise _error("robot.forces", "forces on single discs", type(force).__name__)
    changes: dict[str, Any] = {"disc": max(nearest[number], 2)}
    return replace(force, **changes)


def _facing(obstacle: Obstacle, nearest: dict[int, int]) -> Obstacle:
    if obstacle.discs is None:
        return obstacle
    return replace(obstacle, discs=tuple(sorted({max(nearest[d], 2) for d in obstacle.discs})))


def _sensor_moved(sensor: Sampled, nearest: dict[int, int]) -> Sampled:
    changes: dict[str, Any] = {}
    if hasattr(sensor, "disc"):
        changes["disc"] = nearest[sensor.disc]
    if isinstance(sensor, Lengths):
        spans = (tuple((nearest[disc], point) for disc, point in span) for span in sensor.spans)
        changes["spans"] = tuple(spans)
    return replace(sensor, **changes)


def _error(name: str, expected: str, got: str) -> SceneError:
    return SceneError([f"scene.{name}: expected {expected}, got {got}"])
