"""The C example that filters a log: compiled, run, and held against the filter in Python."""

import runpy
import subprocess
from pathlib import Path

import numpy as np
import pytest
from c_compilers import needs_compiler
from exported import gcc

import dtcasadi as dtc
from dtcasadi.logs import read_log
from estimators.registry import ESTIMATORS
from estimators.scenario import discrete_of

EXAMPLE = Path(__file__).parent.parent / "examples" / "filter_log.py"
STRICT = ["-std=c99", "-O1", "-Wall", "-Werror"]


def filtered_in_c(folder: Path, precision: str) -> np.ndarray:
    """What the example prints: t, first coordinate, force along y."""
    runpy.run_path(str(EXAMPLE))["main"](str(folder), precision)
    words = [
        *gcc().command,
        *STRICT,
        "filter_log.c",
        "filter.c",
        "filter_core.c",
        "-lm",
        "-o",
        "filter_log",
    ]
    subprocess.run(words, cwd=folder, check=True)
    with (folder / "log.csv").open() as log:
        done = subprocess.run(
            ["./filter_log"], cwd=folder, stdin=log, capture_output=True, text=True, check=True
        )
    return np.array([line.split() for line in done.stdout.splitlines()], dtype=float)


def filtered_in_python(folder: Path) -> np.ndarray:
    """The same in the same order."""
    scene = dtc.load_scene("estimation/mismatch")
    discrete = discrete_of(scene)
    ekf = ESTIMATORS["ekf"].build(scene, discrete)
    log, est, rows, u = read_log(folder / "log.csv"), ekf.start, [], np.zeros(1)
    for k, t in enumerate(log.t):
        est = ekf.predict(est, u) if k else est
        u = np.array([log.channels["command1"][k]])
        for name, sensor in discrete.sensors.items():
            y = np.array([log.channels[f"{name}.{c}"][k] for c, _ in sensor.channels])
            if np.all(np.isfinite(y)):
                est = ekf.update(est, y, name, u)
        force = est.theta[discrete.theta_blocks["wrench"]][1]
        rows.append((t, est.x[0], force))
    return np.array(rows)


@needs_compiler
@pytest.mark.parametrize(
    # Double: round-off of 200 steps through a covariance. Single: 1e-7 of rates of some 10 rad/s,
    # innovations and accelerations of stiff walls.
    ("precision", "angle", "force"),
    [("double", 1e-8, 1e-7), pytest.param("single", 3e-3, 3e-2, marks=pytest.mark.slow)],
)
def test_the_example_filters_a_log_as_python_does(tmp_path, precision, angle, force):
    found = filtered_in_c(tmp_path / "c", precision)
    expected = filtered_in_python(tmp_path / "c")
    assert len(found) == 201
    np.testing.assert_allclose(found[:, 0], expected[:, 0], atol=1e-4)
    np.testing.assert_allclose(found[:, 1], expected[:, 1], atol=angle)
    np.testing.assert_allclose(found[:, 2], expected[:, 2], atol=force)
