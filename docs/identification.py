"""The picture of an identification in README.md: stiffness, damping and payload."""

from dataclasses import replace
from pathlib import Path

import dtcasadi as dtc
from dtcasadi.identify.plots import picture
from dtcasadi.recording import experiment
from dtcasadi.sensors import IMU, Marker

TRUE = {"springs.stiffness": 1.4, "damping.c_a": 70.0, "discs[4].mass": 5.0}


def draw(path: Path) -> None:
    """Record a robot with other numbers than the scene's, find them, draw."""
    pressure = dtc.Profile([0, 4, 8], [12.0, 3.0, 9.0])
    sensors = (Marker(name="tip", disc=4, noise=0.02), IMU(name="chip", disc=3, noise=0.02))
    scene = replace(dtc.load_scene("seed_four_disc"), pressure=pressure, sensors=sensors)
    log = experiment(scene, 0.02, t_end=12.0, values=TRUE, seed=1)
    found = dtc.identify(scene, log, tuple(TRUE))
    picture(found, path, channels=("tip.y", "tip.z", "chip.gx"))
    print(found.report())


if __name__ == "__main__":
    draw(Path(__file__).resolve().parent / "figures" / "identification.png")
