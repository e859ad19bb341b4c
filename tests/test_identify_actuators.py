"""Actuator parameters come back from recorded motions of a planar robot; their intervals hold."""

from dataclasses import replace

import numpy as np
import pytest
from air_robots import gas
from recordings import covered, noisy, sensed
from swept import scene_of

import dtcasadi as dtc
from dtcasadi.actuators import Orifice, PressureValve, Regulator
from dtcasadi.recording import experiment, experiment_of
from dtcasadi.sensors import Marker, PressureSensor

NOISE = {"tip": 0.002, "gauge": 0.05}
SENSORS = (
    Marker(name="tip", disc=2, noise=NOISE["tip"]),
    PressureSensor(name="gauge", noise=NOISE["gauge"]),
)
# Filled from empty in about a second, so that steps of 20 ms see it.
SLOW = {"supply": Orifice(2e-6, 0.3), "exhaust": Orifice(2e-6, 0.3), "dead_volume": 0.5}
SUPPLIED = gas(valve=PressureValve(4.0, response_time=0.05), **SLOW)
CASES = {
    "regulator": (Regulator(0.2), {"actuator.time_constant": 0.35, "springs.stiffness": 1.2}),
    "gas": (SUPPLIED, {"actuator.supply.conductance": 3e-6, "actuator.dead_volume": 0.8}),
}


def scene_with(actuator) -> dtc.Scene:
    steps = np.arange(0.0, 4.0, 0.5)
    pressure = dtc.Profile(steps, np.random.default_rng(4).uniform(0.0, 6.0, len(steps)))
    base = scene_of(t_end=4.0, pressure=pressure)
    robot = replace(base.robot, damping=dtc.Damping(c_a=10.0, c_b=10.0, c_w=10.0))
    options = {"chart": "planar", "actuator": actuator}
    return sensed(replace(base, robot=robot, options=options), *SENSORS)


@pytest.mark.parametrize("name", CASES)
def test_actuator_parameters_come_back(name):
    actuator, true = CASES[name]
    scene = scene_with(actuator)
    log = experiment(scene, 0.02, t_end=4.0, values=true, seed=3)
    found = dtc.identify(scene, log, tuple(true))
    assert found.success and found.tests.passed
    wanted = np.array([*true.values()])
    assert np.all(np.abs(found.values - wanted) < 3 * found.sigma)  # 0.3 % of chance for each
    # An error of the steps that may show is told, the readings' number counted.
    assert name != "gas" or any("which may move values by up to" in note for note in found.notes)
    # The data told them: an interval well inside the way the search had to go.
    assert np.all(3 * found.sigma < np.abs(wanted - found.starts))


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_intervals_of_actuators_cover_the_truth(name):
    actuator, true = CASES[name]
    scene = scene_with(actuator)
    silent = sensed(scene, *(replace(sensor, noise=1e-12) for sensor in scene.sensors))
    model = silent.build(parameters=tuple(true))
    clean = experiment_of(silent, model.discrete(0.02, sensors=silent.sensors), values=true)
    # Steps of 20 ms, off by a fifth of the noise, move the gas's values by 1.3 deviations: the
    # result says that they may.
    found = dtc.identify(scene, noisy(clean, NOISE, 0), tuple(true), step_s=0.01)
    logs = (noisy(clean, NOISE, seed) for seed in range(200))
    share = covered(found.problem, np.array([*true.values()]), logs)
    assert np.all((share >= 0.9) & (share <= 0.99)), share
