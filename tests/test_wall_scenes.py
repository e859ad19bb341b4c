"""A soft wall in what a filter and a controller know: scenes estimation/wall and control/wall."""

import json
from dataclasses import replace

import numpy as np
import pytest
from c_compilers import needs_compiler

import dtcasadi as dtc
from dtcasadi.cli import main
from estimators import EKF
from estimators.runner import track
from estimators.scenario import discrete_of, knowledge
from estimators.truth import moved, recorded

LENGTH = 0.2


@pytest.mark.parametrize("name", ["estimation/wall", "control/wall"])
def test_the_tube_rests_on_its_wall(name):
    """At a high pressure; without the wall it would be 3 to 5 mm further."""
    scene = dtc.load_scene(name)
    free = replace(scene, robot=replace(scene.robot, obstacles=()))
    places = []
    for one in (scene, free):
        model = one.build(actuator="direct")
        found = dtc.equilibrium(model, 12e3)
        assert found.success
        places.append(np.array(model.poses(found.q, found.theta)[1])[1, -1])
    assert places[0] > -0.063 and places[1] < places[0] - 0.003


def tips(discrete, x: np.ndarray) -> np.ndarray:
    model = discrete.model
    return np.array([model.poses(each[: model.n_q], discrete.theta0)[1] for each in x])[:, :, -1]


@pytest.mark.slow
@needs_compiler
def test_a_filter_that_knows_the_wall_knows_where_the_tip_is():
    """Both read a chip half way down; from 1.25 to 2.25 s the tube presses on the wall."""
    scene = dtc.load_scene("estimation/wall")
    truth = moved(scene)
    log = recorded(scene, truth)
    errors = []
    for robot in (scene.robot, replace(scene.robot, obstacles=())):
        own = replace(scene, robot=robot)
        discrete = discrete_of(own)
        known = knowledge(own, discrete)
        ekf = EKF(
            discrete, x0=known.x0, P0=known.P0, Q_w=known.Q_w, augment=known.augment,
            gate=known.gate,
        )  # fmt: skip
        found = track(ekf, log)
        assert not any(each.failure for each in found.estimates)
        off = tips(discrete, np.array([each.x for each in found.estimates]))
        off = off - tips(truth.discrete, truth.x)
        errors.append(np.linalg.norm(off, axis=1) / LENGTH)
    knows, not_ = errors
    pressed = slice(500, 900)
    # Free, 5 % of stiffness are worth a hundredth of the length; the wall leaves no room for it.
    assert np.max(knows[200:]) < 0.015
    assert np.sqrt(np.mean(knows[pressed] ** 2)) < 0.005
    assert np.sqrt(np.mean(not_[pressed] ** 2)) > 0.02


@pytest.mark.slow
@needs_compiler
def test_a_controller_bends_the_tube_on_and_off_its_wall(tmp_path):
    """Its targets are where the robot rests; no way there is worth a violated limit."""
    file = tmp_path / "loop.json"
    assert main(["mpc", "control/wall", "--json", str(file)]) == 0
    loop = json.loads(file.read_text())["loop"]
    assert loop["violations"] == 0
    assert max(rest["steady"] for rest in loop["rests"]) < 0.5  # degrees
