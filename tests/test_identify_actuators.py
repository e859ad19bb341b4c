"""Actuator parameters come back from recorded motions of a planar robot."""

from dataclasses import replace

import numpy as np
import pytest
from air_robots import gas
from recordings import sensed
from swept import scene_of

import dtcasadi as dtc
from dtcasadi.actuators import Orifice, PressureValve, Regulator
from dtcasadi.recording import experiment
from dtcasadi.sensors import Marker, PressureSensor

SENSORS = (
    Marker(name="tip", disc=2, noise=0.002),
    PressureSensor(name="gauge", noise=0.05),
)
# Filled from empty in about a second, so that steps of 20 ms see it.
SLOW = {"supply": Orifice(2e-6, 0.3), "exhaust": Orifice(2e-6, 0.3), "dead_volume": 0.5}
SUPPLIED = gas(valve=PressureValve(4.0, response_time=0.05), **SLOW)
CASES = {
    "regulator": (Regulator(0.2), {"actuator.time_constant": 0.35, "springs.stiffness": 1.2}),
    "gas": (SUPPLIED, {"actuator.supply.conductance": 3e-6, "actuator.dead_volume": 0.8}),
}


@pytest.mark.parametrize("name", CASES)
def test_actuator_parameters_come_back(name):
    actuator, true = CASES[name]
    steps = np.arange(0.0, 4.0, 0.5)
    pressure = dtc.Profile(steps, np.random.default_rng(4).uniform(0.0, 6.0, len(steps)))
    base = scene_of(t_end=4.0, pressure=pressure)
    robot = replace(base.robot, damping=dtc.Damping(c_a=10.0, c_b=10.0, c_w=10.0))
    options = {"chart": "planar", "actuator": actuator}
    scene = sensed(replace(base, robot=robot, options=options), *SENSORS)
    log = experiment(scene, 0.02, t_end=4.0, values=true, seed=3)
    found = dtc.identify(scene, log, tuple(true))
    assert found.success and found.tests.passed
    wanted = np.array([*true.values()])
    assert np.all(np.abs(found.values - wanted) < 3 * found.sigma)  # 0.3 % of chance for each
    # The data told them: an interval well inside the way the search had to go.
    assert np.all(3 * found.sigma < np.abs(wanted - found.starts))
