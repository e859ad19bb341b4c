"""State and contact force of a hanging tentacle from noisy sensors.

Simulates the scene `estimation/tentacle`, filters what its sensors say with every estimator,
prints how far each is off and draws them: `python examples/state_estimator_demo.py picture.png`.
With a second name, `film.gif`, truth and estimates move side by side.
"""

import os
import sys
from pathlib import Path

import numpy as np

import dtcasadi as dtc
from estimators.film import side_by_side
from estimators.plots import against_time
from estimators.registry import ESTIMATORS
from estimators.report import Tip, result_of, tip_errors
from estimators.scenario import discrete_of
from estimators.truth import moved, recorded

SHORT = bool(os.environ.get("DTCASADI_SHORT"))


def main(picture: str, film: str = "") -> None:
    """Run the experiment and draw it."""
    scene = dtc.load_scene("estimation/tentacle")
    t_end, t_pushed = (0.5, 0.25) if SHORT else (scene.t_end, 2.5)
    discrete, tip, truth = discrete_of(scene), Tip.of(scene), moved(scene, t_end)
    log = recorded(scene, truth)
    results = []
    for choice in ESTIMATORS.values():
        made = choice.build(scene, discrete)
        found = result_of(choice.title, tip, made.discrete, choice.run(made, log))
        results.append(found)
        error = tip_errors(found, tip, truth)
        k = np.searchsorted(truth.t, t_pushed)
        print(f"{choice.title}: tip off by {100 * error[-1]:.2f} % of the length at the end,")
        print(f"  contact force at {t_pushed} s {found.force[k].round(3)} N,", end=" ")
        print(f"true {truth.force[k]} N")
    print("drawn:", against_time(results, tip, truth, log, Path(picture)))
    if film:
        print("filmed:", side_by_side(results, truth, Path(film)))


if __name__ == "__main__":
    main(*(sys.argv[1:3] or ["state_estimator_demo.png"]))
