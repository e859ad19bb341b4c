"""Picture of the README: both estimators on the hanging tentacle."""

from pathlib import Path

import dtcasadi as dtc
from estimators.benchmark import experiment
from estimators.plots import against_time
from estimators.registry import ESTIMATORS
from estimators.truth import recorded


def draw(path: Path) -> None:
    """The scene `estimation/tentacle`."""
    scene = dtc.load_scene("estimation/tentacle")
    choices = {name: ESTIMATORS[name] for name in ("ekf", "spv")}
    results, tip, truth = experiment(scene, choices)
    against_time([*results.values()], tip, truth, recorded(scene, truth), path)
