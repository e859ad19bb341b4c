"""The adviser where the motion leaves the plane: which segments need space, and shapes."""

from dataclasses import replace

import numpy as np
import pytest
from advised import distance_over_range, true_error, tube
from c_compilers import needs_compiler
from swept import scene_of

import dtcasadi as dtc
from dtcasadi.advise.aside import flatter, out_of_plane
from dtcasadi.advise.lab import POINTS, Lab

# A load aside that grows along the robot: the root's segment carries it farthest.
SIDE = dtc.PointLoad(2, 2.0, np.array([1.0, 0.3, 0.0]))


def seen(scene: dtc.Scene, q: np.ndarray) -> np.ndarray:
    model = scene.build(chart="cardan")
    R, r = (np.array(part) for part in model.poses(q, model.theta0))
    n = model.n_discs
    return out_of_plane(scene.robot, R.reshape(3, 1, n, 3).transpose(1, 2, 0, 3), r.T[np.newaxis])


@pytest.mark.parametrize("twist", [0, 60])
def test_what_a_segment_carries_out_of_its_plane(twist):
    scene = tube(twist=twist)
    planar = np.zeros(20)
    planar[[0, 2, 5, 7]] = 0.3, -0.2, 0.4, 0.1
    assert np.all(seen(scene, planar) < 1e-14)
    # The second thread leaves its plane by b: its direction by sin b, and the x axis of the disc
    # behind it, B e_x at rest, turns about y.
    b = 0.1
    aside = planar.copy()
    aside[[5, 6, 7]] = 0.0, b, 0.0
    found = seen(scene, aside)
    assert found[[0, 2, 3]] == pytest.approx(0.0, abs=1e-14)
    threads = scene.robot.threads
    left = sum(thread.length for thread in threads[1:])
    turned = 2 * np.sin(b / 2) * np.linalg.norm(threads[1].twist[[0, 2], 0])
    assert found[1] == pytest.approx(left * (np.sin(b) + turned), rel=1e-12)


def test_charts_with_planar_segments():
    aside = np.array([0.4, 0.1, 0.3, 0.2])
    charts = list(flatter(aside, 4))
    assert charts[0] == "planar"
    assert charts[1:] == [
        ("cardan", "planar", "planar", "planar"),
        ("cardan", "planar", "cardan", "planar"),
        ("cardan", "planar", "cardan", "cardan"),
    ]
    # The same places of a robot cut twice as fine.
    assert list(flatter(aside, 8))[2] == ("cardan",) * 2 + ("planar",) * 2 + (
        "cardan",
        "cardan",
        "planar",
        "planar",
    )


@pytest.mark.slow
@needs_compiler
def test_the_promise_on_a_small_robot_in_space():
    scene = scene_of(t_end=1.0, options={"chart": "cardan"})
    aside = replace(scene, robot=replace(scene.robot, forces=(SIDE,)))
    advice = dtc.advise(aside, 0.02)
    assert not advice.planarity.planar and advice.reference.converged
    assert advice.best is not None and advice.best.candidate.chart == "cardan"
    charts = {one.candidate.chart for one in advice.candidates}
    # The robot starts bent, so that no other chart holds its start.
    assert charts == {"cardan"}
    assert true_error(advice, method="DOP853", rtol=1e-10, atol=1e-12) <= 0.02


@pytest.mark.slow
@needs_compiler
def test_shape_of_a_planar_robot():
    scene = scene_of(t_end=1.0)
    advice = dtc.advise(scene, 0.02, quantity="shape")
    assert advice.best is not None
    lab = Lab(scene, "shape", 0.02)
    found = lab.path(advice.best.candidate).points
    assert found.shape[1:] == (POINTS, 3)
    # Two discs: the shape is the line from the root's centre to the tip's, by `simulate` alone.
    run = dtc.simulate(scene, method="DOP853", rtol=1e-10, atol=1e-12)
    R, r = run.at(lab.times).poses()
    ends = r + R @ scene.robot.discs[-1].centre_of_mass
    share = np.linspace(0.0, 1.0, POINTS)[:, np.newaxis]
    truth = (1 - share) * ends[:, :1] + share * ends[:, 1:]
    reach = np.linalg.norm(truth - truth[0], axis=-1).max()
    off = np.linalg.norm(found - truth, axis=-1).max()
    assert off / np.clip(reach, 0.01 * lab.length, lab.length) <= 0.02
    assert distance_over_range(found[:, -1], truth[:, -1], lab.length) <= 0.02
