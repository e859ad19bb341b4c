"""State and contact force of a hanging tentacle from noisy sensors.

Simulates the scene `estimation/tentacle`, filters what its sensors say, prints how far the
estimate is off and draws it: `python examples/state_estimator_demo.py picture.png`.
"""

import sys
from pathlib import Path

import numpy as np

import dtcasadi as dtc
from estimators.report import drawn
from estimators.runner import track
from estimators.scenario import discrete_of, ekf_of, moved, recorded


def main(picture: str) -> None:
    """Run the experiment and draw it."""
    scene = dtc.load_scene("estimation/tentacle")
    discrete = discrete_of(scene)
    truth = moved(scene, discrete)
    found = track(ekf_of(scene, discrete), recorded(scene, discrete, truth))
    block = discrete.theta_blocks["wrench"]
    force = np.array([est.theta[block][:3] for est in found.estimates])
    k = np.searchsorted(truth.t, 2.5)
    print(f"contact force at 2.5 s: {force[k].round(3)} N, true {truth.force[k]} N")
    print("drawn:", drawn(discrete, found, truth, Path(picture)))


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "state_estimator_demo.png")
