"""Scenes for the adviser's tests, and what a model's error really is."""

import numpy as np

import dtcasadi as dtc
from dtcasadi.advise.lab import Lab
from dtcasadi.compile import QUICK_FLAGS
from dtcasadi.scene import parse_scene

TUBE = """\
schema = 1
name = "tube"
[robot]
up = [0, {up}, 0]
[robot.tube]
n_discs = 5
length_mm = 200
radius_mm = 20
wall_thickness_mm = 1.5
youngs_modulus_mpa = 0.593
poissons_ratio = 0.5
density = 1080
twist_deg = {twist}
payload = {payload}
retardation_time = {retardation}
[model]
inflation = "volume"
chart = "{chart}"
[pressure]
times = [0, {ramp}]
values_kpa = [0, {pressure}]
kind = "linear"
[run]
t_end = {t_end}
"""
FIELDS = {
    "up": -1,
    "twist": 0,
    "payload": 0,
    "retardation": 0.02,
    "chart": "cardan",
    "ramp": 0.5,
    "pressure": 10,
    "t_end": 1.0,
}


def tube(**fields) -> dtc.Scene:
    """A tube with a strip, held level, blown up."""
    return parse_scene(TUBE.format(**{**FIELDS, **fields}).encode())


def tip_path(scene: dtc.Scene, times: np.ndarray, **settings) -> np.ndarray:
    """Where the centre of the last section goes, (instants, 3), by `simulate` alone."""
    model = scene.build()
    model.flags = QUICK_FLAGS  # optimising would take longer than the run
    x0, pressure = scene.x0(model), scene.pressure if model.n_u else None
    run = dtc.simulate(model, x0, pressure=pressure, t_end=scene.t_end, **settings)
    assert run.success, run.message
    R, r = run.at(times).poses()
    return r[:, -1] + R[:, -1] @ scene.robot.discs[-1].centre_of_mass


def true_error(advice: dtc.Advice, **settings) -> float:
    """Of the advised model, against the scene's own discs by `simulate` alone."""
    assert advice.best is not None and advice.quantity == "tip"
    lab = Lab(advice.given, "tip", advice.tolerance)
    found = lab.path(advice.best.candidate).points[:, 0]
    truth = tip_path(advice.given, lab.times, **settings)
    return distance_over_range(found, truth, lab.length)


def distance_over_range(found: np.ndarray, truth: np.ndarray, length: float) -> float:
    reach = np.linalg.norm(truth - truth[0], axis=1).max()
    return np.linalg.norm(found - truth, axis=1).max() / np.clip(reach, 0.01 * length, length)
