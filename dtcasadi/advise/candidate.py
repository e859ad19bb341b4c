"""A model that an adviser may recommend, as plain values."""

from dataclasses import dataclass, replace
from typing import Any

from ..model import Model
from ..scene import Scene

STATICS = "statics"


@dataclass(frozen=True)
class Candidate:
    """How to model a scene.

    Attributes:
        n_discs: number of discs, the root included.
        chart: one name for all segments, or one for each.
        velocity_terms: `full` or `none`.
        dynamic: whether it moves in time, or is at rest at each instant.
        actuator: `scene` (as it is there), or `direct` (the command is the pressure).
        contact: whether the scene's obstacles are there.
        method: integrator, or `statics`.
        step_s: its fixed step [s]; None: adaptive, or none at all.
    """

    n_discs: int
    chart: str | tuple[str, ...]
    velocity_terms: str = "full"
    dynamic: bool = True
    actuator: str = "scene"
    contact: bool = True
    method: str = "auto"
    step_s: float | None = None

    def scene(self, given: Scene) -> Scene:
        """The scene with this model's robot, options and integrator.

        Raises:
            SceneError: the scene's robot cannot be cut into so many discs.
            RobotError: the same, by the beam.
        """
        scene = given
        if self.n_discs != scene.robot.n_discs:
            scene = scene.rediscretised(self.n_discs)
        options = {**scene.options, "chart": self.chart, "velocity_terms": self.velocity_terms}
        if self.actuator == "direct":
            options["actuator"] = "direct"
        robot = scene.robot if self.contact else replace(scene.robot, obstacles=())
        changes: dict[str, Any] = {"method": self.method} if self.dynamic else {}
        return replace(scene, robot=robot, options=options, step_s=self.step_s, **changes)

    @property
    def physics(self) -> "Candidate":
        """The same without the integrator."""
        return replace(self, method="auto", step_s=None)

    def record(self) -> dict[str, Any]:
        """What the JSON file says of it."""
        chart: Any = self.chart if isinstance(self.chart, str) else list(self.chart)
        return {
            "n_discs": self.n_discs,
            "chart": chart,
            "velocity_terms": self.velocity_terms,
            "dynamic": self.dynamic,
            "method": self.method,
            "step_s": self.step_s,
        }

    def more(self) -> dict[str, Any]:
        """And of its candidates besides."""
        return {"actuator": self.actuator, "contact": self.contact}


def chart_word(chart: str | tuple[str, ...]) -> str:
    """A chart in a word or two: `3 planar, 5 cardan`."""
    if isinstance(chart, str):
        return chart
    counts = {name: chart.count(name) for name in dict.fromkeys(chart)}
    return ", ".join(f"{count} {name}" for name, count in counts.items())


def merged(charts: tuple[str, ...]) -> str | tuple[str, ...]:
    """One name where all segments share it."""
    return charts[0] if len(set(charts)) == 1 else charts


def models_of(candidate: Candidate, given: Scene) -> tuple[Scene, Model]:
    """A candidate's scene and its model."""
    scene = candidate.scene(given)
    return scene, scene.build()
