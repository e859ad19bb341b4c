"""dtcasadi.sweep: rows against single runs made by other means, grids, draws, failures."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from c_compilers import needs_cxx
from swept import scene_of

import dtcasadi as dtc
from dtcasadi.batch import OneByOneWarning
from dtcasadi.errors import SweepError
from dtcasadi.sweep import Given, normal, uniform
from dtcasadi.sweep.axes import table

# The same operations in another order (lanes fuse and use another sine) over some hundred steps of
# a damped motion, whose errors do not grow.
ROUND_OFF = 1e-11
pytestmark = pytest.mark.filterwarnings(f"default::{OneByOneWarning.__module__}.OneByOneWarning")


OVER = {
    "springs.stiffness": "lin(0.5,2,2)",
    "pressure.scale": [0.5, 1.5],
    "payload": [0.0, 3.0],
    "initial.beta_1": [0.1, -0.3],
}


@needs_cxx
def test_rows_on_lanes_are_single_runs():
    scene = scene_of()
    found = dtc.sweep(scene, OVER, step_s=0.01, method="rk4", workers=1, save=["x", "tip.path"])
    assert len(found.status) == 16 and found.success.all()
    for k in (0, 5, 15):
        stiffness, scale, payload, beta = found.inputs[k]
        robot = replace(
            scene.robot,
            springs=tuple(replace(s, stiffness=stiffness) for s in scene.robot.springs),
            forces=(dtc.Payload(2, payload),),
        )
        profile = dtc.Profile(scene.pressure.times, scale * scene.pressure.values, "linear")
        model = dtc.build(robot, chart="planar")
        run = dtc.simulate(
            model, [beta, 0.1, 0, 0], pressure=profile, t_end=0.2, method="rk4", step_s=0.01
        )
        assert np.abs(found["x.final"][k] - run.x[:, -1]).max() < ROUND_OFF
        R, r = run.poses()
        assert np.abs(found["tip_rotation"][k] - R[-1, -1]).max() < ROUND_OFF
        centre = r[:, -1] + R[:, -1] @ robot.discs[-1].centre_of_mass
        assert np.abs(found["tip"][k] - centre[-1]).max() < ROUND_OFF
        assert np.abs(found["tip.path"][k] - centre).max() < ROUND_OFF
        assert found["max_tilt"][k] == pytest.approx(np.arccos(R[:, -1, 2, 2].min()), abs=1e-7)
        residual = np.abs(run.energy["residual"]).max()
        assert found["energy_residual"][k] == pytest.approx(residual, abs=1e-10)
        lengths = [_strain(spring, R, r) for spring in robot.springs]
        assert found["max_strain"][k] == pytest.approx(np.max(lengths), abs=1e-10)


def _strain(spring: dtc.Spring, R: np.ndarray, r: np.ndarray) -> float:
    start, end = r[:, 0] + R[:, 0] @ spring.start, r[:, 1] + R[:, 1] @ spring.end
    assert spring.rest_length is not None
    return np.max(np.linalg.norm(end - start, axis=1)) / spring.rest_length - 1


@needs_cxx
def test_adaptive_rows_are_single_runs():
    scene = scene_of(t_end=0.1)
    over = {"discs[2].mass": [1.0, 4.0], "pressure": [3.0]}
    found = dtc.sweep(scene, over, workers=1, method="tsit5", save=["x"])
    for k, mass in enumerate((1.0, 4.0)):
        discs = (scene.robot.discs[0], replace(scene.robot.discs[1], mass=mass))
        model = dtc.build(replace(scene.robot, discs=discs), chart="planar")
        x0 = scene.x0(model)
        run = dtc.simulate(model, x0, pressure=3.0, t_end=0.1, method="tsit5")
        # Step sizes follow round-off of the error estimate: equal to the tolerance, not to bits.
        assert np.abs(found["x.final"][k] - run.x[:, -1]).max() < 1e-7


@needs_cxx
@pytest.mark.parametrize("step_s", [0.01, None])
def test_whatever_the_executor(step_s):
    scene = scene_of(t_end=0.05)
    over = {"pressure": np.linspace(0, 8, 40)}
    options = {"step_s": step_s, "method": "ros2"}
    here = dtc.sweep(scene, over, workers=1, **options)
    with ThreadPoolExecutor(3) as executor:
        there = dtc.sweep(scene, over, executor=executor, workers=3, **options)
    for name, values in here.columns.items():
        assert np.array_equal(values, there[name]), name


@needs_cxx
def test_re_centring_on_lanes():
    """A robot in space that bends by more than 45 degrees: as `simulate` has it."""
    q0 = np.array([0.2, 0.1, 0.1, 0, 0.05])
    start: dict[str, Any] = {"q0": q0, "qd0": np.zeros(5), "initial_chart": "cardan"}
    scene = scene_of(t_end=1.2, options={"chart": "cardan"}, **start)
    model = scene.build()
    over = {"pressure": [0.0, 40.0], f"initial.{model.state_names[1]}": [0.75]}
    found = dtc.sweep(scene, over, step_s=0.02, method="euler", workers=1)
    x0 = scene.x0(model)
    x0[1] = 0.75
    recentred = 0
    for k, pressure in enumerate((0.0, 40.0)):
        run = dtc.simulate(model, x0, pressure=pressure, t_end=1.2, method="euler", step_s=0.02)
        recentred += len(run.recentrings)
        R, r = run.poses([-1])
        assert found["tip_rotation"][k] == pytest.approx(R[0, -1], abs=ROUND_OFF)
        share = np.abs(run.energy["residual"]).max()
        assert found["energy_residual"][k] == pytest.approx(share, rel=1e-6)
    assert recentred


def test_a_grid_and_its_draws():
    names, inputs = table({"a": [1, 2], "b": "log(1,100,3)", "c": normal(5, 2, 1000)}, seed=3)
    assert names == ("a", "b", "c") and inputs.shape == (6000, 3)
    assert inputs[::1000, :2] == pytest.approx(
        np.array([[1, 1], [1, 10], [1, 100], [2, 1], [2, 10], [2, 100]])
    )
    draws = inputs[:, 2].reshape(6, 1000)
    assert np.all(draws == draws[0])
    # Standard errors of mean and deviation: 2 / sqrt(1000), 2 / sqrt(2000); four of them.
    assert abs(draws[0].mean() - 5) < 0.26 and abs(draws[0].std() - 2) < 0.18
    _, more = table({"c": normal(5, 2, 1000), "d": uniform(0, 1, 1000)}, seed=3)
    assert np.array_equal(more[:, 0], draws[0])
    assert abs(np.corrcoef(more.T)[0, 1]) < 0.13
    _, other = table({"c": normal(5, 2, 1000)}, seed=4)
    assert not np.array_equal(other[:, 0], draws[0])
    assert table({"a": "1, 2.5", "b": Given(np.array([7.0, 8.0]))})[1].tolist() == [
        [1, 7],
        [1, 8],
        [2.5, 7],
        [2.5, 8],
    ]
    assert table({"a": "log(-1,-4,3)"})[1].ravel() == pytest.approx([-1, -2, -4])


@needs_cxx
def test_a_failed_run_is_a_row_with_a_reason():
    scene = scene_of(t_end=0.5)
    over = {"discs[2].mass": [2.0, -1.0], "pressure": [5.0, 1e25]}
    found = dtc.sweep(scene, over, step_s=0.01, method="rk4", workers=1, force=True)
    assert found.status.tolist() == [0, 1, 1, 1]
    assert "rk4: the step gave a state that is not finite after t = " in found.reason[1]
    assert found["t_reached"][1] < 0.5 and np.isfinite(found["tip"]).all()
    assert found.reason[2] == "discs[2].mass: expected a positive number, got -1"
    alone = dtc.sweep(scene, {"pressure": [5.0]}, step_s=0.01, method="rk4", workers=1)
    assert np.array_equal(found["tip"][0], alone["tip"][0])


@pytest.mark.parametrize(
    "over, message",
    [
        ({}, "over: expected at least one path with values, got {}"),
        ({"pressure": "lin(1,2)"}, "over pressure: expected lin(a,b,n), log(a,b,n)"),
        ({"pressure": "lin(1,2,0)"}, "a number of values in lin(a,b,n), got '0'"),
        ({"pressure": "log(-1,2,3)"}, "two numbers of the same sign in log(a,b,n)"),
        ({"pressure": [1.0, np.nan]}, "over pressure: expected finite numbers of shape (n)"),
        ({"a": normal(0, 1, 3), "b": normal(0, 1, 4)}, "over: expected as many draws for each"),
    ],
)
def test_wrong_values(over, message):
    with pytest.raises(SweepError) as error:
        table(over)
    assert message in str(error.value)


@pytest.mark.parametrize(
    "path, message",
    [
        ("spring.stiffness", "over: expected a path of dtcasadi.build's parameters"),
        ("up", "over up: expected an entry, up[1] to up[3], got 'up'"),
        ("up[4]", "over up[4]: expected an entry from 1 to 3"),
        ("pressure[2]", "over pressure[2]: expected a chamber from 1 to 1"),
        ("opening", "over opening: expected pressure, pressure[1] or pressure.scale"),
        ("initial.beta_9", "over initial.beta_9: expected initial.STATE with one of beta_1, psi_1"),
    ],
)
def test_wrong_paths(path, message):
    with pytest.raises(SweepError) as error:
        dtc.sweep(scene_of(), {path: [1.0]}, workers=1)
    assert message in str(error.value)


def test_paths_that_change_the_same():
    over = {"pressure": [1.0], "pressure[1]": [2.0]}
    with pytest.raises(SweepError, match=r"over pressure\[1\]: .* pressure does not change"):
        dtc.sweep(scene_of(), over, workers=1)


def test_wrong_settings():
    scene = scene_of()
    with pytest.raises(SweepError, match="save: expected one of x, q, .*, got 'tips'"):
        dtc.sweep(scene, {"pressure": [1.0]}, save=["tips"])
    with pytest.raises(SweepError, match="method: expected one of euler.*, got 'Radau'"):
        dtc.sweep(scene, {"pressure": [1.0]}, step_s=0.1, method="Radau")
    with pytest.raises(SweepError, match="step_s: expected a step within the linear stability"):
        dtc.sweep(scene, {"pressure": [1.0]}, step_s=9.0, method="rk4", t_end=20.0)
