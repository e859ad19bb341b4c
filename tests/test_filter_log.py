"""The C example that filters a log: compiled, run, and held against the filter in Python."""

import runpy
import subprocess
from pathlib import Path

import numpy as np
import pytest
from c_compilers import needs_compiler
from exported import gcc
from watched import WATCHED_AIR

import dtcasadi as dtc
from dtcasadi.logs import read_log
from estimators.registry import ESTIMATORS
from estimators.scenario import discrete_of

EXAMPLE = Path(__file__).parent.parent / "examples" / "filter_log.py"
STRICT = ["-std=c99", "-O1", "-Wall", "-Werror"]


SHIPPED = "estimation/mismatch"


def filtered_in_c(folder: Path, precision: str, name: str) -> np.ndarray:
    """What the example prints: t, first coordinate, force along y."""
    runpy.run_path(str(EXAMPLE))["main"](str(folder), precision, name)
    words = [*gcc().command, *STRICT, "filter_log.c", "filter.c", "filter_core.c"]
    subprocess.run([*words, "-lm", "-o", "filter_log"], cwd=folder, check=True)
    with (folder / "log.csv").open() as log:
        done = subprocess.run(
            ["./filter_log"], cwd=folder, stdin=log, capture_output=True, text=True, check=True
        )
    return np.array([line.split() for line in done.stdout.splitlines()], dtype=float)


def filtered_in_python(folder: Path, name: str) -> tuple[np.ndarray, np.ndarray]:
    """The same in the same order, and the deviation of the two estimates."""
    scene = dtc.load_scene(name)
    discrete = discrete_of(scene)
    ekf = ESTIMATORS["ekf"].build(scene, discrete)
    log, est, rows, u = read_log(folder / "log.csv"), ekf.start, [], np.zeros(1)
    sigma = []
    for k, t in enumerate(log.t):
        est = ekf.predict(est, u) if k else est
        u = np.array([log.channels["command1"][k]])
        for sensor, each in discrete.sensors.items():
            y = np.array([log.channels[f"{sensor}.{c}"][k] for c, _ in each.channels])
            if np.all(np.isfinite(y)):
                est = ekf.update(est, y, sensor, u)
        force = est.theta[discrete.theta_blocks["wrench"]][1]
        rows.append((t, est.x[0], force))
        sigma.append(est.sigma[[0, len(est.x) + 1]])
    return np.array(rows), np.array(sigma)


@needs_compiler
@pytest.mark.parametrize(
    ("precision", "scene"),
    [
        ("double", "small"),
        pytest.param("single", "small", marks=pytest.mark.slow),
        pytest.param("double", SHIPPED, marks=pytest.mark.slow),
        pytest.param("single", SHIPPED, marks=pytest.mark.slow),
    ],
)
def test_the_example_filters_a_log_as_python_does(tmp_path, precision, scene):
    if scene == "small":
        scene = str(tmp_path / "small.toml")
        Path(scene).write_text(WATCHED_AIR)
    found = filtered_in_c(tmp_path / "c", precision, scene)
    expected, sigma = filtered_in_python(tmp_path / "c", scene)
    assert len(found) == len(expected) > 50
    # Printed with four digits; in single precision an instant of 1 s is good to 1e-7.
    np.testing.assert_allclose(found[:, 0], expected[:, 0], atol=1e-4)
    off = np.abs(found[:, 1:] - expected[:, 1:])
    # Double: round-off of a covariance of condition 1e8. Single: 1e-7 of rates of some 10 rad/s and
    # of accelerations of stiff walls, small beside what the filter itself leaves open.
    assert np.all(off < (1e-6 if precision == "double" else 0.1) * sigma)
