"""Identification of robots whose motion a finer integrator recorded, in Python and by command."""

import json
import re
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest
from recordings import sensed

import dtcasadi as dtc
from dtcasadi.cli import main
from dtcasadi.errors import IdentificationError
from dtcasadi.identify import Experiment, solve
from dtcasadi.identify.data import gridded
from dtcasadi.identify.parameters import parameters_of, theta_of
from dtcasadi.identify.problem import wanted_of
from dtcasadi.recording import experiment
from dtcasadi.sensors import Marker

TRUE = {"springs.stiffness": 1.2, "damping.c_a": 80.0}
FREE = tuple(TRUE)
SCENE = resources.files("dtcasadi").joinpath("scenes/seed_four_disc.toml").read_text()
TIP = Marker(name="tip", disc=4, noise=0.001)


@pytest.fixture(scope="module")
def scene():
    return sensed(dtc.load_scene("seed_four_disc"), TIP)


@pytest.fixture(scope="module")
def log(scene):
    return experiment(scene, 0.02, t_end=4.0, values=TRUE, seed=2)


@pytest.fixture(scope="module")
def found(scene, log):
    return dtc.identify(scene, log, FREE)


def test_two_parameters_of_the_seed_robot_come_back(found):
    assert found.success and found.tests.passed
    off = (found.values - [*TRUE.values()]) / found.sigma
    assert np.all(np.abs(off) < 3)  # 0.3 % of chance for each
    assert np.all(found.sigma / found.values < 0.05)
    assert found.units == ("N/m", "N m s/rad")
    assert np.all((found.intervals[:, 0] < found.values) & (found.values < found.intervals[:, 1]))


def test_commands_in_another_unit_are_told(scene, log):
    channels = {**log.channels, "command1": 1e3 * log.channels["command1"]}
    found = dtc.identify(scene, replace(log, channels=channels), FREE)
    assert not found.success and "cannot run from the start" in found.message
    assert any("commands go up to 1.2e+04, those of the scene to 12" in n for n in found.notes)
    assert not found.tests.passed and "there are no residuals to test" in found.report()


def test_theta_runs_the_model_as_it_was_fitted(scene, found):
    model = found.problem.discrete.model
    pressure = scene.pressure
    run = dtc.simulate(model, found.x0[0], pressure=pressure, t_end=4.0, theta=found.theta)
    z = run.at(found.fits[0].t).poses()[1][:, 3, 2]
    # The fit's own step of 20 ms against an adaptive integrator: below the noise of 1 mm.
    assert np.max(np.abs(z - found.fits[0].h[:, 2])) < 5e-4


def test_a_wrong_start_far_away_comes_back(found):
    start = {"springs.stiffness": 5.0, "damping.c_a": 20.0}
    discrete = found.problem.discrete
    parameters = parameters_of(discrete.theta0, discrete.theta_blocks, FREE, start=start)
    again = solve(replace(found.problem, parameters=parameters))
    assert again.success
    np.testing.assert_allclose(again.values, found.values, rtol=1e-3)
    np.testing.assert_array_equal(again.starts, [5, 20])


def test_other_logs_are_predicted_and_a_wrong_one_is_not(scene, found):
    wanted = wanted_of(found.problem.discrete, found.problem.sensors)
    sigma = np.r_[np.ones(6), 3 * np.ones(6)]
    good, bad = (
        gridded(
            Experiment(experiment(scene, 0.02, t_end=2.0, values=values, seed=9), sigma=sigma),
            wanted,
        )
        for values in (TRUE, {**TRUE, "damping.c_a": 40.0})
    )
    good, bad = solve(found.problem, held_out=[good, bad]).validation
    assert good.size < 1.2 and bad.size > 2


def test_the_command(scene, log, tmp_path, capsys):
    text = SCENE + SENSOR
    (tmp_path / "robot.toml").write_text(text)
    log.save(tmp_path / "log.csv")
    words = ["identify", str(tmp_path / "robot.toml"), str(tmp_path / "log.csv")]
    words += ["--free", ",".join(FREE), "--start", "damping.c_a=60", "--validate", "0.2"]
    words += ["--prior", "springs.stiffness=1.2:1", "--bounds", "damping.c_a=10:"]
    files = ["--json", str(tmp_path / "a.json"), "-o", str(tmp_path / "a.npz")]
    assert main([*words, *files]) == 0
    out = capsys.readouterr().out
    assert "springs.stiffness" in out and "95 % interval" in out and "left out" in out
    record = json.loads((tmp_path / "a.json").read_text())
    assert record["schema"] == 1 and record["identify"]["status"] == "converged"
    first = record["identify"]["parameters"][0]
    assert first["name"] == "springs.stiffness" and first["unit"] == "N/m"
    assert first["interval"][0] < 1.2 < first["interval"][1]
    with np.load(tmp_path / "a.npz") as saved:
        np.testing.assert_allclose(saved["values"][0], first["value"])


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--free", "springs.stiff"], "parameters: expected paths such as"),
        (["--free", "springs.stiffness,springs.stiffness"], "already a parameter"),
        (["--free", "muscles[*].mass"], "muscles[*].mass: the robot has no muscles"),
        (["--bounds", "springs.stiffness=2"], "expected two numbers as LOW:HIGH, got '2'"),
        (["--start", "springs.stiffness"], "--start: expected PATH=..., got"),
        (["--initial", "maybe"], "--initial: expected a number, got 'maybe'"),
        (["--validate", "0.95"], "validate: expected logs, or a share up to 0.9"),
        (["--level", "1"], "level: expected a probability below 1"),
        (["--nodes", "0"], "nodes: expected an integer from 1"),
    ],
)
def test_bad_words_are_one_line(words, line, log, tmp_path, capsys):
    (tmp_path / "robot.toml").write_text(SCENE + SENSOR)
    log.save(tmp_path / "log.csv")
    given = ["identify", str(tmp_path / "robot.toml"), str(tmp_path / "log.csv")]
    free = [] if "--free" in words else ["--free", "springs.stiffness"]
    assert main([*given, *free, *words]) == 2
    err = capsys.readouterr().err
    assert line in err and len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        ({"bounds": {"gravity": (1, 2)}}, "bounds: expected one of k, c, got 'gravity'"),
        ({"bounds": {"k": (2, 1)}}, "bounds: k: expected lower below upper, got 2:1"),
        ({"bounds": {"k": (2, 3)}}, "bounds: k: expected a range with the start, 1, in it"),
        ({"bounds": {"k": 3}}, "bounds: k: expected two numbers, got 3"),
        ({"bounds": {"k": ("a", 3)}}, "bounds: k: expected a finite number, got 'a'"),
        ({"priors": {"k": (1, 0)}}, "priors: k: expected a finite positive number, got 0"),
        ({"priors": {"k": (None, 1)}}, "priors: k: expected a finite number, got None"),
        ({"start": {"k": np.nan}}, "start: k: expected a finite number, got nan"),
        ({"free": ("q",)}, "free: expected one of k, c, got 'q'"),
        ({"free": ()}, "free: expected different parameters, got none"),
        ({"free": ("k", "k")}, "free: expected different parameters, got k, k"),
    ],
)
def test_bad_parameters_are_one_line(settings, line):
    given = {"free": ("k", "c"), **settings}
    blocks = {"k": slice(0, 1), "c": slice(1, 3)}
    with pytest.raises(IdentificationError, match=re.escape(line)):
        parameters_of(np.array([1.0, 2.0, 3.0]), blocks, **given)


def test_a_start_of_a_positive_number_is_positive():
    blocks = {"springs.stiffness": slice(0, 3)}
    with pytest.raises(IdentificationError, match="springs.stiffness: expected a positive number"):
        parameters_of(np.ones(3), blocks, tuple(blocks), start={"springs.stiffness": -1.0})


def test_numbers_that_differ_share_a_factor_or_stand_alone():
    blocks = {"springs.stiffness": slice(0, 3)}
    theta0 = np.array([1.0, 2.0, 4.0])
    (factor,) = parameters_of(theta0, blocks, ("springs.stiffness",))
    assert factor.unit == "x start" and factor.value(0.0) == 1
    theta, S = theta_of((factor,), theta0, np.array([np.log(3)]))
    np.testing.assert_allclose(theta, 3 * theta0)
    np.testing.assert_allclose(S[:, 0], 3 * theta0)
    each = parameters_of(theta0, blocks, ("springs.stiffness[*]",))
    assert [p.name for p in each] == [f"springs.stiffness[{k}]" for k in (1, 2, 3)]
    assert [p.value(0.0) for p in each] == [1, 2, 4]


SENSOR = """
[[sensors]]
name = "tip"
kind = "marker"
disc = 4
noise_mm = 1
"""
