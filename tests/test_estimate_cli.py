"""`dtcasadi estimate`, and the tables of a scene that it reads."""

import json

import numpy as np
import pytest
from watched import SPRINGS, WATCHED

import dtcasadi as dtc
from dtcasadi.cli import main
from dtcasadi.errors import SceneError
from dtcasadi.scene import parse_scene
from estimators.scenario import discrete_of
from estimators.truth import moved, truth_scene


def test_the_shipped_scene_has_what_it_takes():
    scene = dtc.load_scene("estimation/tentacle")
    assert [sensor.name for sensor in scene.sensors] == ["gauge", "chip3", "chip4", "tip"]
    assert scene.estimation is not None and scene.estimation.step_s == 0.0025
    np.testing.assert_allclose(scene.estimation.contact(2.5), [0.05, 0.1, 0])
    assert not scene.estimation.contact(3.5).any()


BOUNDS = """
[estimation.bounds]
"wrench[2]" = [0, inf]
"""


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "small.toml"
    path.write_text(WATCHED)
    return path


def test_a_scene_is_simulated_filtered_and_drawn(scene_file, tmp_path, capsys):
    files = {name: str(tmp_path / name) for name in ("a.png", "a.json", "a.csv", "a.gif")}
    words = ["--png", files["a.png"], "--json", files["a.json"], "--save-log", files["a.csv"]]
    words += ["--animate", files["a.gif"], "--estimator", "all"]
    assert main(["estimate", str(scene_file), *words]) == 0
    record = json.loads((tmp_path / "a.json").read_text())
    assert record["schema"] == 1 and record["ekf"]["steps"] == 25
    assert record["ekf"]["failed"] == 0 and record["ekf"]["rms"] < 0.05
    assert (tmp_path / "a.png").stat().st_size > 10_000
    assert (tmp_path / "a.gif").stat().st_size > 10_000
    capsys.readouterr()
    assert main(["estimate", str(scene_file), files["a.csv"]]) == 0
    assert "25 steps" in capsys.readouterr().out


def test_what_its_sensors_see_comes_before_filtering(scene_file, tmp_path, capsys):
    words = ["--observability", "--bound", "1e3", "--json", str(tmp_path / "o.json")]
    words += ["--png", str(tmp_path / "o.png")]
    assert main(["estimate", str(scene_file), *words]) == 0
    text, record = capsys.readouterr().out, json.loads((tmp_path / "o.json").read_text())
    found = record["observability"]
    assert [row["sensors"] for row in found["sets"]] == ["tip", "chip", "tip + chip"]
    # A push across the plane moves nothing in it.
    assert found["smallest"] == "none" and "everything: none" in text
    assert found["unseen_directions"]["tip + chip"] == [["wrench[1]"]]
    bits = [row["bits"] for row in found["sets"]]
    assert max(bits[:2]) < bits[2] < sum(bits[:2])
    assert all(row["force_error_N"] > 0 for row in found["sets"])
    assert len(found["left"]["chip"]) == len(found["names"]) and "wrench[2]" in found["names"]
    assert (tmp_path / "o.png").stat().st_size > 10_000
    assert main(["estimate", str(scene_file), "--observability", "--bound", "0"]) == 2
    assert "bound: expected a finite positive number, got 0" in capsys.readouterr().err


def test_a_bad_log_is_one_line(scene_file, tmp_path, capsys):
    log = tmp_path / "bad.csv"
    log.write_text("t [s],tip.x [m]\n0,1\n0.02,fast\n")
    assert main(["estimate", str(scene_file), str(log)]) == 2
    assert "line 3: tip.x: expected a number, got 'fast'" in capsys.readouterr().err


def test_an_unknown_estimator_is_one_line(scene_file, capsys):
    assert main(["estimate", str(scene_file), "--estimator", "magic"]) == 2
    assert "estimator: expected one of ekf, " in capsys.readouterr().err


def test_a_force_that_can_only_push_stays_within_the_bounds_of_the_scene(tmp_path, capsys):
    """It begins to push at 0.2 s; the filter without bounds believes in one that pulls before."""
    scene, records = tmp_path / "push.toml", {}
    scene.write_text(WATCHED + BOUNDS)
    for name in ("ekf", "mhe"):
        target = tmp_path / f"{name}.json"
        words = ["--estimator", name, "--json", str(target)]
        assert main(["estimate", str(scene), *words]) == 0
        records[name] = json.loads(target.read_text())[name]
    assert records["ekf"]["force_least_N"][1] < -0.05
    assert records["mhe"]["force_least_N"][1] >= 0 and records["mhe"]["failed"] == 0
    # With what is known besides it is not further from the truth.
    assert records["mhe"]["force_rms_N"] <= records["ekf"]["force_rms_N"]
    scene.write_text(WATCHED + BOUNDS.replace("wrench[2]", "wrench[9]"))
    assert main(["estimate", str(scene), "--estimator", "mhe"]) == 2
    line = capsys.readouterr().err
    assert "bounds: expected names out of beta_1, psi_1, " in line and "got 'wrench[9]'" in line


def test_the_truth_may_be_another_robot_than_the_filters(scene_file):
    text = scene_file.read_text() + "truth_stiffness = 1.15\ntruth_hysteresis = 0.5\n"
    text = text.replace("[run]", SPRINGS + "[run]")
    scene = parse_scene(text.encode())
    true = truth_scene(scene)
    assert len(true.robot.springs) == 3
    for spring, stiffer in zip(scene.robot.springs, true.robot.springs, strict=True):
        assert stiffer.stiffness == pytest.approx(1.15 * spring.stiffness)
    states = set(moved(scene, 0.1).discrete.state_names) - set(discrete_of(scene).state_names)
    assert states == {"hysteresis_1"}
    with pytest.raises(SceneError, match="expected a robot made from a tube or a rod"):
        truth_scene(parse_scene((text + "truth_discs = 3\n").encode()))


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ('kind = "marker"', 'kind = "radar"', r"sensors\[1\].kind: expected pressure, imu"),
        ("disc = 2\nnoise", "disc = 9\nnoise", r"sensors\[1\].disc: expected an integer from 1 to"),
        ('"chip"', '"tip"', r"sensors\[2\].name: expected a name of its own"),
        ("step = 0.02", "step = -1", "estimation.step: expected a finite non-negative number"),
        ("offset", "bounds = 3\noffset", "estimation.bounds: expected a table, got 3"),
        ("offset", "bounds.psi_1 = 3\noffset", r"bounds.psi_1: expected a pair \(lower, upper\)"),
        ("offset", "bounds.psi_1 = [true, 1]\noffset", r"bounds.psi_1: .*got \[True, 1\]"),
        ("offset", "bounds.psi_1 = [1, 0]\noffset", "bounds.psi_1: expected lower bounds up to"),
        ("noise_mm", "nose_mm", r"sensors\[1\].nose_mm: expected one of .*did you mean noise_mm"),
    ],
)
def test_faults_in_the_tables_are_named(scene_file, old, new, line):
    text = scene_file.read_text()
    assert old in text
    with pytest.raises(SceneError, match=line):
        parse_scene(text.replace(old, new).encode())
