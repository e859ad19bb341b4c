"""The filter of a scene as C, and a C program that filters a log with it.

`python examples/filter_log.py folder` writes the exported EKF, `start.h`, `filter_log.c` and a
simulated log into the folder. There, `cc -O2 filter_log.c filter.c filter_core.c -lm -o filter_log`
and `./filter_log < log.csv` filter it. With a second word, `single`, in single precision; with a
third, of another scene with sensors and a chamber.
"""

import shutil
import sys
from pathlib import Path

import numpy as np

import dtcasadi as dtc
from estimators import EKF
from estimators.registry import ESTIMATORS
from estimators.scenario import discrete_of
from estimators.truth import moved, recorded


def main(folder: str, precision: str = "double", name: str = "estimation/mismatch") -> None:
    """Write everything into a folder."""
    scene = dtc.load_scene(name)
    ekf = ESTIMATORS["ekf"].build(scene, discrete_of(scene))
    assert isinstance(ekf, EKF)
    target = Path(folder)
    dtc.export_c(ekf.functions(), target, name="filter", single=precision == "single")
    (target / "start.h").write_text(start_of(ekf))
    shutil.copy(Path(__file__).with_suffix(".c"), target)
    recorded(scene, moved(scene, 1.0)).save(target / "log.csv")
    print("written:", target)


def start_of(ekf: EKF) -> str:
    """C text: sizes, sensors, and the estimate at the start."""
    est, sensors = ekf.start, ekf.discrete.sensors
    sizes = {
        "N_X": len(est.x),
        "N_Z": len(est.P),
        "N_THETA": len(est.theta),
        "N_U": ekf.discrete.linearize.size1_in("u"),
        "N_SENSORS": len(sensors),
        "MOST_READINGS": max(sensor.n_y for sensor in sensors.values()),
        "FORCE_Y": ekf.discrete.theta_blocks["wrench"].start + 1,
    }
    updates = ", ".join(f"filter_update_{name}" for name in sensors)
    lines = [f"enum {{ {name} = {value} }};" for name, value in sizes.items()]
    lines.append(f"#define UPDATES {{{updates}}}")
    counts = ", ".join(str(sensor.n_y) for sensor in sensors.values())
    lines.append(f"static const int readings[N_SENSORS] = {{{counts}}};")
    lines.append("static filter_real u[N_U];")
    for name, values in (("x", est.x), ("P", est.P), ("theta", est.theta)):
        numbers = ", ".join(f"(filter_real){float(value)!r}" for value in np.ravel(values))
        lines.append(f"static filter_real {name}[{np.size(values)}] = {{{numbers}}};")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main(*(sys.argv[1:4] or ["filter_log"]))
