"""What the filter has to do in the scene `estimation/tentacle`, in the plane and in space."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import dtcasadi as dtc
from dtcasadi.scene import Scene
from estimators.registry import ESTIMATORS
from estimators.report import Result, Tip, result_of, tip_errors
from estimators.scenario import discrete_of
from estimators.truth import Truth, moved, recorded

# Three of the slowest time constants, 1 / 0.39 s at rest under 3 kPa, after the pressure is there.
SETTLED, WINDOW = 1.5 + 3 / 0.39, 1.0
QUIET = (0.0, 0.0, 0.0)


@cache
def scene_of(chart: str) -> Scene:
    scene = dtc.load_scene("estimation/tentacle")
    assert scene.estimation is not None
    # In the plane a force sideways moves nothing.
    sides: dict[str, Any] = {
        "force_sigma": [0, 0.05, 0],
        "force_walk": [0, 0.2, 0],
        "contact_force": [0, 0.1, 0],
    }
    changes = sides if chart == "planar" else {}
    return replace(scene, options={"chart": chart}, estimation=replace(scene.estimation, **changes))


@cache
def discrete_in(chart: str):
    return discrete_of(scene_of(chart))


def changed(chart: str, **changes: Any) -> Scene:
    scene = scene_of(chart)
    assert scene.estimation is not None
    return replace(scene, estimation=replace(scene.estimation, **changes))


@cache
def truth_of(chart: str, t_end: float, push: tuple[float, ...]) -> Truth:
    return moved(changed(chart, contact_force=np.array(push)), t_end)


def run(
    chart: str, t_end: float, push: Sequence[float], name: str = "ekf", **changes: Any
) -> tuple[Result, Any]:
    """What a filter makes of a tentacle pushed so, and its tip errors."""
    scene, truth = changed(chart, **changes), truth_of(chart, t_end, tuple(push))
    discrete, choice = discrete_in(chart), ESTIMATORS[name]
    found = choice.run(choice.build(scene, discrete), recorded(scene, truth))
    result = result_of(choice.title, Tip.of(scene), discrete, found)
    return result, tip_errors(result, Tip.of(scene), truth)


@pytest.mark.parametrize(
    ("name", "chart", "settled", "window"),
    [
        # Far sooner than asked for: what the sensors see is known at once.
        ("ekf", "planar", 1.0, 0.25),
        pytest.param("ukf", "planar", 0.25, 0.25, marks=pytest.mark.slow),
        pytest.param("mhe", "planar", 0.25, 0.25, marks=pytest.mark.slow),
        pytest.param("smoother", "planar", 1.0, 0.25, marks=pytest.mark.slow),
        *(
            pytest.param(name, chart, SETTLED, WINDOW, marks=pytest.mark.slow)
            for name in ("ekf", "ukf")
            for chart in ("planar", "cardan")
        ),
    ],
)
def test_it_finds_the_pose_from_far_off(name, chart, settled, window):
    result, error = run(chart, settled + window, QUIET, name, offset=0.3, angle_sigma=0.3)
    _, steady = run(chart, settled + window, QUIET, name, offset=0.0)
    late = result.track.t >= settled
    rms = [float(np.sqrt(np.mean(e[late] ** 2))) for e in (error, steady)]
    # The first readings are in already, for the smoother all.
    assert error[0] > 10 * rms[1] and rms[0] <= 2 * rms[1] < 0.004
    assert result.track.last.failed == 0


@pytest.mark.slow
@pytest.mark.parametrize("chart", ["planar", "cardan"])
def test_at_constant_pressure_no_bias_is_left(chart):
    result, _ = run(chart, SETTLED + 4 * WINDOW, QUIET)
    late = result.track.t >= SETTLED
    force = result.force[late]
    # Errors of a random walk's filter are correlated over some tenths of a second: 4 s hold some
    # ten independent ones, whose mean has a third of their deviation.
    sigma = np.sqrt(np.mean(result.force_sigma[late] ** 2, axis=0))
    assert np.all(np.abs(force.mean(axis=0)) <= sigma + 1e-12)
    assert np.all(np.abs(force.mean(axis=0)) < 2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("chart", ["planar", "cardan"])
def test_a_push_of_twenty_sigma_is_found_and_forgotten(chart):
    quiet, _ = run(chart, 1.0, QUIET)
    sigma = quiet.force_sigma[-1, 1]
    push = (0.0, 20 * sigma, 0.0)
    forces = []
    for seed in range(4):
        result, _ = run(chart, 4.0, push, seed=seed)
        forces.append(result.force[:, 1])
    t, mean = result.track.t, np.mean(forces, axis=0)
    # Four runs and a tenth of a second: the noise of a single instant, 5 % itself, is averaged.
    for start, stop, expected in ((2.5, 2.6, push[1]), (3.5, 3.6, 0.0)):
        found = mean[(t >= start) & (t < stop)].mean()
        assert abs(found - expected) <= 0.05 * push[1]
