"""Stiffness, damping and payload of a robot from a camera's recording, with outliers.

python examples/identify.py writes identify.png, log.csv into the current folder. A robot with other
numbers than the scene's stands in for the real one; DTCASADI_SHORT=1 records it for 2 s only.
"""

import os
from dataclasses import replace

import numpy as np

import dtcasadi as dtc
from dtcasadi.identify import Settings
from dtcasadi.identify.plots import picture
from dtcasadi.recording import experiment
from dtcasadi.sensors import Marker

TRUE = {"springs.stiffness": 1.4, "damping.c_a": 70.0, "discs[4].mass": 5.0}


def main() -> None:
    """Record, spoil, identify, validate, draw."""
    short = os.environ.get("DTCASADI_SHORT") == "1"
    cameras = (Marker(name="tip", disc=4, noise=0.005), Marker(name="mid", disc=3, noise=0.005))
    scene = replace(dtc.load_scene("seed_four_disc"), sensors=cameras)
    log = experiment(scene, 0.02, t_end=2.0 if short else 8.0, values=TRUE, seed=1)
    # One frame in fifty takes something else for the marker.
    rng = np.random.default_rng(0)
    channels = dict(log.channels)
    lost = rng.random(len(log.t)) < 0.02
    channels["tip.y"] = channels["tip.y"] + np.where(lost, rng.normal(0, 1, len(log.t)), 0)
    replace(log, channels=channels).save("log.csv")

    found = dtc.identify(
        scene,
        "log.csv",
        free=(*TRUE, "damping.c_w"),  # a thread's spin: nothing in the plane shows it
        bounds={"discs[4].mass": (1, 20)},
        priors={"damping.c_w": (100, 30)},
        validate=0.25,
        settings=Settings(loss="huber"),
    )
    print(found.report())
    for name, value in TRUE.items():
        print(f"{name}: {found[name]:.4g}, true {value:.4g}")
    picture(found, "identify.png")

    # The model with the numbers found, to simulate, filter or control with.
    model = found.problem.discrete.model
    theta = found.theta[: len(model.theta0)]
    run = dtc.simulate(model, found.x0[0], pressure=5.0, t_end=1.0, theta=theta)
    print(run.message)


if __name__ == "__main__":
    main()
