"""`dtcasadi bench estimators`, and the case in which the filter's model is wrong."""

import json

import pytest

from dtcasadi.cli import main
from estimators import benchmark
from estimators.registry import ESTIMATORS
from estimators.timing import Case

FIGURES = {"us_per_step", "tip_rmse_over_length", "force_error", "nees_in_band", "convergence_s"}


@pytest.mark.slow
def test_the_record_has_the_figures_of_every_estimator(tmp_path, monkeypatch):
    errors = {"tip_rmse_over_length": 0.01, "force_error": 0.02}
    names = ("ekf", "ukf", "mhe", "smoother", "spv")
    monkeypatch.setattr(benchmark, "mismatch", lambda choices: dict.fromkeys(choices, errors))
    monkeypatch.setattr(benchmark, "convergence", lambda choices, chart: dict.fromkeys(choices))
    words = ["bench", "estimators", "--chart", "planar", "--runs", "1", "--steps", "4"]
    files = [str(tmp_path / name) for name in ("b.json", "b.png")]
    assert main([*words, "--json", files[0], "--png", files[1]]) == 0
    record = json.loads((tmp_path / "b.json").read_text())
    assert record["schema"] == 1 and set(record["estimators"]) == set(names)
    for name, row in record["estimators"].items():
        assert set(row) == FIGURES and row["us_per_step"] > 0
        # Smoothed errors of one run are no independent draws.
        assert row["nees_in_band"] is None if name == "smoother" else 0 <= row["nees_in_band"] <= 1
    assert record["filterpy_us_per_step"] is None or record["filterpy_us_per_step"] > 0
    assert (tmp_path / "b.png").stat().st_size > 5000


def test_the_timed_filter_works():
    """What is timed is a filter that updates, not one that failed."""
    case = Case("planar")
    ekf = case.ekf()
    est = ekf.update(ekf.predict(ekf.start, case.u), case.y, case.names, case.u)
    assert not est.failure and est.used == 12
    # At rest with the readings of that place, where it stays.
    assert abs(est.x - case.x).max() < 1e-6


@pytest.mark.slow
def test_all_stay_near_a_robot_that_is_another_than_theirs():
    """8 discs, 15 % stiffer, hysteresis, 1 % of the samples lost, against 4 discs."""
    found = benchmark.mismatch(ESTIMATORS)
    assert set(found) == set(ESTIMATORS)
    for errors in found.values():
        assert errors["tip_rmse_over_length"] < 0.03
